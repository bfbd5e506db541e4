"""The intrinsics or the stereo calibration of a calibration file, for pictures of a given size.

OpenCV's pixel centres are at integers; half a pixel is added to cx and cy, because pixel edges are at integers here.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.sequences.calibration_formats import FORMATS, StoredCalibration, StoredIntrinsics
from endotsr.clips.sequences.camera import Intrinsics, StereoCalibration, checked_rotation, intrinsics_of_matrix
from endotsr.errors import InputError
from endotsr.untrusted.yaml import read_yaml


def read_calibration(path: Path) -> StoredCalibration:
    """The calibration in a file, or in a folder with one file for left and one for right.

    Raises:  InputError naming the file, the key and what is allowed.
    """
    keys = read_yaml(path) if path.suffix.lower() in (".yaml", ".yml") else {}
    for entry in FORMATS:
        found = entry.read(path, keys)
        if found is not None:
            return found
    known = "; ".join(entry.about for entry in FORMATS)
    raise InputError(f"{path}: no calibration that is known here; allowed: {known}")


def intrinsics_or_stereo(path: Path, width: int, height: int) -> tuple[Intrinsics | None, StereoCalibration | None]:
    """The intrinsics, or the calibration of a pair, for pictures of this size. Proportional sizes are scaled.

    Raises:  InputError naming the file, the key and what is allowed.
    """
    found = read_calibration(path)

    def intrinsics(stored: StoredIntrinsics, side: str) -> Intrinsics:
        where = f"{path}: {side}" if found.right else str(path)
        distortion = stored.distortion if any(stored.distortion) else ()
        whole = intrinsics_of_matrix(stored.matrix, *(stored.size or (width, height)), distortion, where=where)
        return fitted_intrinsics(whole, width, height, where)

    if found.right is None:
        return intrinsics(found.left, "left"), None
    rotation = checked_rotation(found.rotation, f"{path}: rotation between the cameras")
    if not np.isfinite(found.translation).all() or not found.translation.any():
        raise InputError(f"{path}: both cameras are in one place; allowed: a translation between them")
    return None, StereoCalibration(
        intrinsics(found.left, "left"), intrinsics(found.right, "right"), rotation, found.translation
    )


def fitted_intrinsics(intrinsics: Intrinsics, width: int, height: int, where: object) -> Intrinsics:
    """The intrinsics for pictures of this size. Raises InputError for another aspect ratio."""
    if abs(intrinsics.width * height - intrinsics.height * width) > max(intrinsics.width, width) // 100:
        raise InputError(
            f"{where}: the calibration is of {intrinsics.width}x{intrinsics.height} pixels, the pictures have"
            f" {width}x{height}"
        )
    return intrinsics.scaled(width, height)
