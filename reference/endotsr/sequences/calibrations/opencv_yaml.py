"""YAML of OpenCV's FileStorage: one camera, or a pair as `cv2.stereoCalibrate` gives it.

Names of keys are free in that format; those of OpenCV's samples, of SCARED and of common tools are read. The unit of T
is that of the chessboard; here it counts as millimetres.
"""

from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.sequences.calibrations.stored import Intrinsics, StoredCalibration, distortion_of
from endotsr.untrusted.yaml import matrix

ABOUT = "FILE.yaml of OpenCV (camera_matrix, or M1 D1 M2 D2 R T in millimetres)"
ONE = (("camera_matrix", "distortion_coefficients"), ("Camera_Matrix", "Distortion_Coefficients"), ("K", "D"),
       ("cameraMatrix", "distCoeffs"))  # fmt: skip
PAIRS = (("M1", "D1", "M2", "D2"), ("K1", "D1", "K2", "D2"), ("cameraMatrix1", "distCoeffs1", "cameraMatrix2",
         "distCoeffs2"))  # fmt: skip
SIZES = (("image_width", "image_height"), ("image_Width", "image_Height"), ("width", "height"))


def read(path: Path, keys: dict[str, Any]) -> StoredCalibration | None:
    """The camera or the pair of the file. Raises InputError for a key that a pair lacks."""
    size = _size(keys)
    for left, left_distortion, right, right_distortion in PAIRS:
        if left in keys and right in keys:
            for name in ("R", "T"):
                if name not in keys:
                    raise InputError(f"{path}: {name} is missing next to {left} and {right}")
            return StoredCalibration(
                _camera(path, keys, left, left_distortion, size),
                _camera(path, keys, right, right_distortion, size),
                matrix(keys["R"], f"{path}: R", (3, 3)),
                matrix(keys["T"], f"{path}: T", (3,)),
            )
    for name, distortion in ONE:
        if name in keys:
            return StoredCalibration(_camera(path, keys, name, distortion, size))
    return None


def _camera(path: Path, keys: dict[str, Any], name: str, distortion: str, size: tuple[int, int] | None) -> Intrinsics:
    found = matrix(keys[name], f"{path}: {name}", (3, 3))
    given = matrix(keys[distortion], f"{path}: {distortion}", (-1,)) if distortion in keys else None
    return Intrinsics(found, () if given is None else distortion_of(given, f"{path}: {distortion}"), size)


def _size(keys: dict[str, Any]) -> tuple[int, int] | None:
    for width, height in SIZES:
        if isinstance(keys.get(width), int) and isinstance(keys.get(height), int) and keys[width] > 0 < keys[height]:
            return keys[width], keys[height]
    return None
