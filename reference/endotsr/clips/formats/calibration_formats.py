"""Calibration files of other programs, as stored.

Every format has a function that maps the path, and the keys of a YAML file, to a `StoredCalibration`. It returns None
for a file in another format. A new format needs such a function and a line in `FORMATS`. Every format here uses
OpenCV's pixel coordinates, with pixel centres at integers. A pair satisfies x_right = rotation @ x_left + translation.
"""

import configparser
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from endotsr.clips.formats.calibration_fields import (
    DISTORTIONS,
    INI,
    KALIBR,
    MATRICES,
    OPENCV,
    PAIR_DISTORTIONS,
    PAIRS,
    ROS,
)
from endotsr.clips.formats.camera import rows_of_motion
from endotsr.clips.formats.files import shortened
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.files import read_text
from endotsr.untrusted.json import Keys, number
from endotsr.untrusted.names import choice, decimal_commas, plain_line
from endotsr.untrusted.yaml import matrix, read_yaml

HALF_A_PIXEL = "its pixel centres are at integers, as in OpenCV: half a pixel was added to cx and cy"
LARGEST_MATRIX, LARGEST_INI = 1 << 16, 1 << 20  # bytes
COEFFICIENTS = 8  # kc_0 .. kc_7 of an ini file
KALIBR_MODELS = {"camera_model": ("pinhole",), "distortion_model": ("radtan", "none")}
ROS_MODELS, ROS_MARK = ("plumb_bob", "rational_polynomial"), "projection_matrix"
ECHO = {"k": "camera_matrix", "d": "distortion_coefficients", "r": "rectification_matrix", "p": ROS_MARK,
        "width": "image_width", "height": "image_height"}  # fmt: skip
CAMERA_NAMES = frozenset({*MATRICES, *(name for names in PAIRS for name in names)})
SIZES = (("image_width", "image_height"), ("image_Width", "image_Height"), ("width", "height"))


class StoredIntrinsics(NamedTuple):
    """One camera, as stored."""

    matrix: FloatArray  # (3, 3) in OpenCV's convention
    distortion: tuple[float, ...] = ()  # in OpenCV's order; empty or zeros: none
    size: tuple[int, int] | None = None  # width, height; None: not in the file


class StoredCalibration(NamedTuple):
    """The contents of a calibration file."""

    left: StoredIntrinsics
    right: StoredIntrinsics | None = None
    rotation: FloatArray = np.eye(3)
    translation: FloatArray = np.zeros(3)  # millimetres
    baseline: float | None = None  # of an already rectified pair, millimetres
    notes: tuple[str, ...] = ()


class Format(NamedTuple):
    """One calibration format."""

    about: str  # for messages
    read: Callable[[Path, Keys], StoredCalibration | None]


def distortion_of(numbers: FloatArray, where: str) -> tuple[float, ...]:
    """No, four, five or eight coefficients. Other counts above four lose trailing zeros down to the next of these.

    Raises:  InputError for a count that is none of these then.
    """
    values = [float(value) for value in numbers.ravel()]
    while len(values) > 4 and values[-1] == 0 and len(values) not in (5, 8):
        values.pop()
    if len(values) not in (0, 4, 5, 8):
        raise InputError(f"{where}: {len(values)} distortion coefficients; use none, 4, 5 or 8")
    return tuple(values)


def read_stereo_ini(path: Path, keys: Keys) -> StoredCalibration | None:
    """The pair of an ini file with the sections StereoLeft and StereoRight, as in StereoMIS.

        [StereoLeft]  res_x res_y fc_x fc_y cc_x cc_y kc_0 .. kc_7        pixels
        [StereoRight] the same, and R_0 .. R_8 (row by row), T_0 .. T_2   millimetres

    Raises:  InputError naming the file, the section and the key.
    """
    if path.suffix.lower() != ".ini":
        return None
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    text = read_text(path, LARGEST_INI)
    try:
        parser.read_string(text)
    except configparser.Error as error:
        raise InputError(f"{path}: not a calibration in ini form: {str(error).splitlines()[0]}") from None
    for section in ("StereoLeft", "StereoRight"):
        if section not in parser:
            raise InputError(f"{path}: section [{section}] is missing; use StereoLeft and StereoRight")
    sections = ("StereoLeft", "StereoRight")
    notes = [note for name in sections for note in INI.noted(dict(parser[name]), f"{path}: [{name}]")]
    left, right = (_ini_camera(parser, section, path) for section in sections)
    rotation = [_ini_number(parser, "StereoRight", f"R_{k}", path) for k in range(9)]
    translation = [_ini_number(parser, "StereoRight", f"T_{k}", path) for k in range(3)]
    turn = np.array(rotation).reshape(3, 3)
    return StoredCalibration(left, right, turn, np.array(translation), notes=tuple(notes))


def _ini_camera(parser: configparser.ConfigParser, section: str, path: Path) -> StoredIntrinsics:
    fx, fy, cx, cy = (_ini_number(parser, section, key, path) for key in ("fc_x", "fc_y", "cc_x", "cc_y"))
    width, height = (_ini_number(parser, section, key, path) for key in ("res_x", "res_y"))
    if width < 1 or height < 1 or width % 1 or height % 1:
        raise InputError(f"{path}: [{section}] res_x = {width:g}, res_y = {height:g}: use whole numbers > 0")
    count = max((k + 1 for k in range(COEFFICIENTS) if f"kc_{k}" in parser[section]), default=0)
    given = [_ini_number(parser, section, f"kc_{k}", path) for k in range(count)]
    distortion = distortion_of(np.array(given), f"{path}: [{section}] kc_0 .. kc_{COEFFICIENTS - 1}")
    return StoredIntrinsics(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]), distortion, (int(width), int(height)))


def _ini_number(parser: configparser.ConfigParser, section: str, key: str, path: Path) -> float:
    if key not in parser[section]:
        raise InputError(f"{path}: [{section}] {key} is missing")
    try:
        value = float(parser[section][key])
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f"{path}: [{section}] {key} = {parser[section][key]!r} is not allowed; use a number")
    return value


def read_matrix_text(path: Path, keys: Keys) -> StoredCalibration | None:
    """One camera without distortion, from a text file. Raises InputError as `read_matrix`.

    Nine numbers and one more: the second line is the baseline of a rectified pair in metres (FoundationStereo).
    """
    if path.suffix.lower() not in (".txt", ".csv"):
        return None
    lines = [line for line in read_text(path, LARGEST_MATRIX).splitlines() if line.strip()]
    if len(lines) == 2 and len(lines[0].split()) == 9 and len(lines[1].split()) == 1:
        numbers = matrix([_number(word) for word in [*lines[0].split(), lines[1]]], f"{path}", (10,))
        note = f"{path.name}: second line: baseline of the rectified pair, {numbers[9]:g} m"
        found = StoredIntrinsics(_checked_matrix(numbers[:9].reshape(3, 3), path))
        return StoredCalibration(found, baseline=1000.0 * float(numbers[9]), notes=(note,))
    return StoredCalibration(StoredIntrinsics(read_matrix(path)))


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")


def read_matrix(path: Path) -> FloatArray:
    """K (3, 3) from nine numbers row by row, or twelve (3x4, Hamlyn) with a last column of 0. Raises InputError."""
    text = read_text(path, LARGEST_MATRIX)
    words = re.sub(r"[,;\[\]]", " ", text).split()
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.size not in (9, 12) or not np.isfinite(numbers).all() or decimal_commas(text):
        raise InputError(
            f"{path}: {len(words)} words; use a camera matrix of 3x3 or 3x4 finite numbers{decimal_commas(text)}"
        )
    rows = numbers.reshape(3, -1)
    if rows.shape[1] == 4 and rows[:, 3].any():
        raise InputError(f"{path}: the fourth column is not 0: a projection of another camera than the left one")
    return _checked_matrix(rows[:, :3], path)


def _checked_matrix(rows: FloatArray, path: Path) -> FloatArray:
    """K (3, 3). Raises InputError unless it has the zeros of a camera matrix."""
    if (rows[2] != (0, 0, 1)).any() or rows[1, 0] != 0:
        raise InputError(f"{path}: use rows `fx 0 cx`, `0 fy cy`, `0 0 1`")
    return rows


def read_kalibr(path: Path, keys: Keys) -> StoredCalibration | None:
    """cam0 of Kalibr's camchain.yaml, and cam1 with T_cn_cnm1, which maps cam0 to cam1 in metres, if there is one.

    Raises:  InputError for another model than pinhole with radtan or none, and for a cam1 without fields.
    """
    if not isinstance(keys.get("cam0"), dict):
        return None
    if not isinstance(keys.get("cam1", {}), dict):
        raise InputError(f"{path}: cam1: use the fields of a camera, as of cam0")
    left = _kalibr_camera(path, keys["cam0"], "cam0")
    notes = [note for name in ("cam0", "cam1") for note in KALIBR.noted(keys.get(name) or {}, f"{path}: {name}")]
    if more := sorted(set(keys) - {"cam0", "cam1"}):
        notes.append(f"{path}: not used: {shortened([plain_line(name) for name in more])}; a pair has cam0 and cam1")
    if "cam1" not in keys:
        return StoredCalibration(left, notes=tuple(notes))
    where = f"{path}: cam1: T_cn_cnm1"
    turn, shift = rows_of_motion(matrix(keys["cam1"].get("T_cn_cnm1"), where, (4, 4)), where)
    right = _kalibr_camera(path, keys["cam1"], "cam1")
    return StoredCalibration(left, right, turn, 1000.0 * shift, notes=tuple(notes))


def _kalibr_camera(path: Path, keys: Keys, name: str) -> StoredIntrinsics:
    where = f"{path}: {name}"
    for key, allowed in KALIBR_MODELS.items():
        if keys.get(key, allowed[0]) not in allowed:
            raise InputError(f"{where}: {key} {keys[key]!r} is not allowed; use {choice(allowed)}")
    fx, fy, cx, cy = matrix(keys.get("intrinsics"), f"{where}: intrinsics", (4,))
    given = matrix(keys.get("distortion_coeffs", [0.0] * 4), f"{where}: distortion_coeffs", (-1,))
    width, height = matrix(keys.get("resolution"), f"{where}: resolution", (2,))
    if min(width, height) < 1 or width % 1 or height % 1:
        raise InputError(f"{where}: resolution: use two whole numbers > 0")
    found = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return StoredIntrinsics(found, distortion_of(given, where), (int(width), int(height)))


def read_ros(path: Path, keys: Keys) -> StoredCalibration | None:
    """A ROS camera_info file, or a pair from a folder with left.yaml and right.yaml.

    The projection matrix of the right camera contains Tx = -fx B, with the baseline B in metres. `rectification_matrix`
    rotates a camera to the rectified pair: rotation = R_right^T R_left, translation = R_right^T (Tx / fx, 0, 0).

    Raises:  InputError for another distortion model, or a pair without a baseline.
    """
    if not path.is_dir():
        keys, notes = _ros_keys(keys, path)
        if ROS_MARK not in keys:
            return None
        return StoredCalibration(_ros_camera(path, keys), notes=(*notes, *_right_camera(path, keys)))
    files = [path / f"{side}.yaml" for side in ("left", "right")]
    if not all(file.is_file() for file in files):
        return None
    (left, notes), (right, more) = (_ros_keys(read_yaml(file), file) for file in files)
    turns = [matrix(k.get("rectification_matrix"), f"{f}: rectification_matrix", (3, 3))
             for k, f in zip((left, right), files)]  # fmt: skip
    projection = matrix(right.get(ROS_MARK), f"{files[1]}: {ROS_MARK}", (3, 4))
    if projection[0, 3] >= 0:
        raise InputError(
            f"{files[1]}: {ROS_MARK}: Tx = {projection[0, 3]:g}; use a number below 0, -fx times the baseline"
        )
    across = np.array([1000.0 * projection[0, 3] / projection[0, 0], 0.0, 0.0])
    cameras = _ros_camera(files[0], left), _ros_camera(files[1], right)
    return StoredCalibration(*cameras, turns[1].T @ turns[0], turns[1].T @ across, notes=(*notes, *more))


def _right_camera(path: Path, keys: Keys) -> list[str]:
    """A note on the file of a right camera that is read as one camera."""
    across = matrix(keys[ROS_MARK], f"{path}: {ROS_MARK}", (3, 4))[0, 3]
    if across == 0:
        return []
    return [f"{path.name}: Tx = {across:g}: a right camera; for a pair use a folder with left.yaml and right.yaml"]


def _ros_keys(keys: Keys, path: Path) -> tuple[Keys, list[str]]:
    """The keys of a ROS file under the names of its form on disk, and notes on unknown ones; other keys unchanged.

    `rostopic echo` prints K, D, R, P, width and height; ROS 2 spells k, d, r, p.
    """
    echoed = "distortion_model" in keys and ("K" in keys or "k" in keys)
    if not echoed and ROS_MARK not in keys:
        return keys, []
    found = {ECHO.get(name.lower() if len(name) == 1 else name, name): value for name, value in keys.items()}
    return found, ROS.noted(keys, path)


def _ros_camera(path: Path, keys: Keys) -> StoredIntrinsics:
    model = keys.get("distortion_model", ROS_MODELS[0])
    if model not in ROS_MODELS:
        raise InputError(f"{path}: distortion_model {model!r} is not allowed; use {choice(ROS_MODELS)}")
    size = keys.get("image_width"), keys.get("image_height")
    if not all(isinstance(side, int) and side > 0 for side in size):
        raise InputError(f"{path}: image_width and image_height: use whole numbers > 0")
    found = matrix(keys.get("camera_matrix"), f"{path}: camera_matrix", (3, 3))
    given = matrix(keys.get("distortion_coefficients"), f"{path}: distortion_coefficients", (-1,))
    return StoredIntrinsics(found, distortion_of(given, f"{path}: distortion_coefficients"), (size[0], size[1]))  # type: ignore[arg-type]


def read_opencv(path: Path, keys: Keys) -> StoredCalibration | None:
    """One camera of OpenCV's FileStorage, or a pair as `cv2.stereoCalibrate` returns it, with T in millimetres.

    Raises:  InputError for a pair without R or T, and for a matrix or a distortion under two names.
    """
    if not CAMERA_NAMES & set(keys):
        return None
    size = opencv_size(keys, path)
    notes = (*OPENCV.noted(keys, path), *_four_coefficients(keys, path), *_of_matlab(path))
    if pair := next((names for names in PAIRS if set(names) <= set(keys)), None):
        for name in ("R", "T"):
            if name not in keys:
                raise InputError(f"{path}: {name} is missing next to {' and '.join(pair)}")
        bent = next((names for names in PAIR_DISTORTIONS if set(names) & set(keys)), ("", ""))
        return StoredCalibration(
            _opencv_camera(path, keys, pair[0], bent[0], size),
            _opencv_camera(path, keys, pair[1], bent[1], size),
            matrix(keys["R"], f"{path}: R", (3, 3)),
            matrix(keys["T"], f"{path}: T", (3,)),
            notes=notes,
        )
    one = one_name(keys, MATRICES, path)
    if not one:
        return None
    return StoredCalibration(_opencv_camera(path, keys, one, one_name(keys, DISTORTIONS, path), size), notes=notes)


def one_name(keys: Keys, names: tuple[str, ...], path: Path) -> str:
    """The one of these names that a file has; empty if it has none. Raises InputError for two with other values."""
    found = [name for name in names if name in keys]
    if any(keys[name] != keys[found[0]] for name in found):
        raise InputError(f"{path}: {' and '.join(found)} differ; use one of them")
    return found[0] if found else ""


def _opencv_camera(
    path: Path, keys: Keys, name: str, distortion: str, size: tuple[int, int] | None
) -> StoredIntrinsics:
    found = matrix(keys[name], f"{path}: {name}", (3, 3))
    given = matrix(keys[distortion], f"{path}: {distortion}", (-1,)) if distortion in keys else None
    return StoredIntrinsics(found, () if given is None else distortion_of(given, f"{path}: {distortion}"), size)


def _four_coefficients(keys: Keys, path: Path) -> list[str]:
    """A note on four coefficients, which OpenCV's fisheye model has too, stored under the same names."""
    names = (*DISTORTIONS, *(name for both in PAIR_DISTORTIONS for name in both))
    given = [matrix(keys[name], f"{path}: {name}", (-1,)) for name in names if keys.get(name)]
    if not any(found.size == 4 and found.any() for found in given):
        return []
    return [f"{path.name}: 4 coefficients are read as k1 k2 p1 p2; those of a fisheye model, stored alike, are not"]


def _of_matlab(path: Path) -> list[str]:
    """A note on plain matrices in a MAT-file, whose pixel coordinates nothing states."""
    if path.suffix.lower() != ".mat":
        return []
    return [f"{path.name}: its camera matrix is read in OpenCV's coordinates; those of MATLAB's classes are 1 larger"]


def opencv_size(keys: Keys, path: Path, names: tuple[tuple[str, str], ...] = SIZES) -> tuple[int, int] | None:
    """Width and height, if the file has both. Raises InputError unless they are whole numbers > 0."""
    found = next((both for both in names if set(both) <= set(keys)), None)
    if found is None:
        return None
    width, height = (number(keys[name], f"{path}: {name}", 1) for name in found)
    if width % 1 or height % 1:
        raise InputError(f"{path}: {' and '.join(found)}: use whole numbers > 0")
    return int(width), int(height)


FORMATS = (  # in the order in which they are tried
    Format("FILE.ini with StereoLeft and StereoRight, millimetres", read_stereo_ini),
    Format("FILE.txt or .csv with a camera matrix K of 3x3 numbers, and a baseline in metres", read_matrix_text),
    Format("camchain.yaml of Kalibr (pinhole, radtan), metres", read_kalibr),
    Format("camera_info of ROS, FILE.yaml or a folder with left.yaml and right.yaml, metres", read_ros),
    Format(
        "FILE.yaml, .xml, .json or .npz of OpenCV (camera_matrix or mtx, or M1 D1 M2 D2 R T in millimetres)",
        read_opencv,
    ),
)
