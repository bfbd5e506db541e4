"""Stereo calibrations: an ini file with the sections StereoLeft and StereoRight, as StereoMIS has it.

    [StereoLeft]  res_x res_y fc_x fc_y cc_x cc_y kc_0 .. kc_7        pixels, OpenCV's convention and order
    [StereoRight] the same, and R_0 .. R_8 (row by row), T_0 .. T_2   x_right = R x_left + T, millimetres

Comes in: a path; goes out: the pair as stored, or an `InputError` that names section and key.
"""

import configparser
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.sequences.calibrations.stored import Intrinsics, StoredCalibration
from endotsr.untrusted.files import read_text

ABOUT = "FILE.ini with StereoLeft and StereoRight, millimetres"
LARGEST_FILE = 1 << 20  # bytes
COEFFICIENTS = 8  # kc_0 .. kc_7; files without the last ones have five or four
FEWEST = (8, 5, 4)


def read(path: Path, keys: dict[str, Any]) -> StoredCalibration | None:
    """The pair of the file. Raises InputError naming the file, the section and the key."""
    if path.suffix.lower() != ".ini":
        return None
    parser = configparser.ConfigParser(interpolation=None)
    text = read_text(Path(path), LARGEST_FILE)
    try:
        parser.read_string(text)
    except configparser.Error as error:
        raise InputError(f"{path}: not a calibration in ini form: {str(error).splitlines()[0]}") from None
    for section in ("StereoLeft", "StereoRight"):
        if section not in parser:
            raise InputError(f"{path}: section [{section}] is missing; allowed: StereoLeft and StereoRight")
    left, right = (_camera(parser, section, path) for section in ("StereoLeft", "StereoRight"))
    rotation = [_number(parser, "StereoRight", f"R_{k}", path) for k in range(9)]
    translation = [_number(parser, "StereoRight", f"T_{k}", path) for k in range(3)]
    return StoredCalibration(left, right, np.array(rotation).reshape(3, 3), np.array(translation))


def _camera(parser: configparser.ConfigParser, section: str, path: Path) -> Intrinsics:
    fx, fy, cx, cy = (_number(parser, section, key, path) for key in ("fc_x", "fc_y", "cc_x", "cc_y"))
    width, height = (_number(parser, section, key, path) for key in ("res_x", "res_y"))
    if width < 1 or height < 1 or width % 1 or height % 1:
        raise InputError(f"{path}: [{section}] res_x = {width:g}, res_y = {height:g}: allowed: whole numbers > 0")
    given = sum(f"kc_{k}" in parser[section] for k in range(COEFFICIENTS))
    count = next((number for number in FEWEST if given >= number), 0)
    distortion = tuple(_number(parser, section, f"kc_{k}", path) for k in range(count))
    return Intrinsics(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]), distortion, (int(width), int(height)))


def _number(parser: configparser.ConfigParser, section: str, key: str, path: Path) -> float:
    if key not in parser[section]:
        raise InputError(f"{path}: [{section}] {key} is missing")
    try:
        value = float(parser[section][key])
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f"{path}: [{section}] {key} = {parser[section][key]!r} is not allowed; allowed: a number")
    return value
