"""Calibrations as other programs write them, one file a format.

A module of `FORMATS` has a function `read`: from the path and, of a YAML file, its keys, to a `StoredCalibration`,
or None if the file is in another format. Every format here has OpenCV's pixels, whose centres lie at integers; half a
pixel is added to cx and cy to get this project's, whose edges do. Pairs: x_right = rotation @ x_left + translation.

Comes in: a path and the size of the pictures; goes out: a `Lens`, or a `Rig` of a pair.
"""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.sequences.calibrations.stored import Intrinsics, StoredCalibration
from endotsr.sequences.recording import Lens, Rig, lens_of_matrix
from endotsr.sequences.sequence_file import checked_rotation
from endotsr.untrusted.yaml import read_yaml

YAML_ENDINGS = (".yaml", ".yml")


def formats() -> tuple[ModuleType, ...]:
    """The modules of the formats, in the order in which they are tried."""
    from endotsr.sequences.calibrations import kalibr, matrix_text, opencv_yaml, ros, stereo_ini

    return (stereo_ini, matrix_text, kalibr, ros, opencv_yaml)


def read_calibration(path: Path) -> StoredCalibration:
    """The calibration of a file, or of a folder with one file for left and one for right.

    Raises:  InputError naming the file, the key and what is allowed.
    """
    keys: dict[str, Any] = read_yaml(path) if path.suffix.lower() in YAML_ENDINGS else {}
    for module in formats():
        found = module.read(path, keys)
        if found is not None:
            return found
    known = "; ".join(module.ABOUT for module in formats())
    raise InputError(f"{path}: no calibration that is known here; allowed: {known}")


def lens_or_rig(path: Path, width: int, height: int) -> tuple[Lens | None, Rig | None]:
    """The lens, or the rig of a pair, for pictures of this size; proportional sizes are scaled. Raises InputError."""
    found = read_calibration(path)

    def lens(stored: Intrinsics, side: str) -> Lens:
        where = f"{path}: {side}" if found.right else str(path)
        distortion = stored.distortion if any(stored.distortion) else ()
        whole = lens_of_matrix(stored.matrix, *(stored.size or (width, height)), distortion, where=where)
        return fitted_lens(whole, width, height, where)

    if found.right is None:
        return lens(found.left, "left"), None
    rotation = checked_rotation(found.rotation, f"{path}: rotation between the cameras")
    if not np.isfinite(found.translation).all() or not found.translation.any():
        raise InputError(f"{path}: both cameras are in one place; allowed: a translation between them")
    return None, Rig(lens(found.left, "left"), lens(found.right, "right"), rotation, found.translation)


def fitted_lens(lens: Lens, width: int, height: int, where: object) -> Lens:
    """The lens for pictures of this size. Raises InputError if they have other proportions than the calibration."""
    if abs(lens.width * height - lens.height * width) > max(lens.width, width) // 100:
        raise InputError(
            f"{where}: the calibration is of {lens.width}x{lens.height} pixels, the pictures have {width}x{height}"
        )
    return lens.scaled(width, height)
