"""Stereo calibrations: an ini file with the sections StereoLeft and StereoRight, as StereoMIS has it.

    [StereoLeft]  res_x res_y fc_x fc_y cc_x cc_y kc_0 .. kc_7        pixels, OpenCV's convention and order
    [StereoRight] the same, and R_0 .. R_8 (row by row), T_0 .. T_2   x_right = R x_left + T, millimetres

Comes in: a path; goes out: the pair, in this project's conventions, or an `InputError` that names section and key.
"""

import configparser
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.sequences.calibrations.stored import Intrinsics, StoredCalibration
from endotsr.sequences.recording import Lens, Rig, lens_of_matrix, opencv_matrix
from endotsr.sequences.sequence_file import checked_rotation
from endotsr.untrusted.files import read_text

ABOUT = "FILE.ini with StereoLeft and StereoRight, millimetres"
LARGEST_FILE = 1 << 20  # bytes
COEFFICIENTS = 8  # kc_0 .. kc_7; files without the last ones have five or four
FEWEST = (8, 5, 4)


def read(path: Path, keys: dict[str, Any]) -> StoredCalibration | None:
    """The pair of the file. Raises InputError."""
    if path.suffix.lower() != ".ini":
        return None
    rig = read_rig(path)
    return StoredCalibration(_stored(rig.left), _stored(rig.right), rig.rotation, rig.translation)


def _stored(lens: Lens) -> Intrinsics:
    return Intrinsics(opencv_matrix(lens), lens.distortion, (lens.width, lens.height))


def read_rig(path: Path) -> Rig:
    """The rig of an ini file.

    Raises:  InputError naming the file, the section and the key.
    """
    parser = configparser.ConfigParser(interpolation=None)
    text = read_text(Path(path), LARGEST_FILE)
    try:
        parser.read_string(text)
    except configparser.Error as error:
        raise InputError(f"{path}: not a calibration in ini form: {str(error).splitlines()[0]}") from None
    for section in ("StereoLeft", "StereoRight"):
        if section not in parser:
            raise InputError(f"{path}: section [{section}] is missing; allowed: StereoLeft and StereoRight")
    left, right = (_lens(parser, section, path) for section in ("StereoLeft", "StereoRight"))
    numbers = [_number(parser, "StereoRight", f"R_{k}", path) for k in range(9)]
    rotation = checked_rotation(np.array(numbers).reshape(3, 3), f"{path}: [StereoRight] R_0 to R_8")
    translation = np.array([_number(parser, "StereoRight", f"T_{k}", path) for k in range(3)])
    if not translation.any():
        raise InputError(f"{path}: [StereoRight] T_0 to T_2 are 0: the cameras stand in one place")
    return Rig(left, right, rotation, translation)


def _lens(parser: configparser.ConfigParser, section: str, path: Path) -> Lens:
    fx, fy, cx, cy = (_number(parser, section, key, path) for key in ("fc_x", "fc_y", "cc_x", "cc_y"))
    width, height = (_number(parser, section, key, path) for key in ("res_x", "res_y"))
    if width < 1 or height < 1 or width % 1 or height % 1:
        raise InputError(f"{path}: [{section}] res_x = {width:g}, res_y = {height:g}: allowed: whole numbers > 0")
    given = sum(f"kc_{k}" in parser[section] for k in range(COEFFICIENTS))
    count = next((number for number in FEWEST if given >= number), 0)
    distortion = tuple(_number(parser, section, f"kc_{k}", path) for k in range(count))
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    where = f"{path}: [{section}]"
    return lens_of_matrix(matrix, int(width), int(height), distortion if any(distortion) else (), where=where)


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
