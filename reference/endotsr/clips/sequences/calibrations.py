"""The lens or the stereo rig of a calibration file, for pictures of a given size.

OpenCV's pixel centres are at integers; half a pixel is added to cx and cy, because pixel edges are at integers here.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.sequences.calibration_formats import FORMATS, Intrinsics, StoredCalibration
from endotsr.clips.sequences.recording import Lens, Rig, lens_of_matrix
from endotsr.clips.sequences.sequence_file import checked_rotation
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


def lens_or_rig(path: Path, width: int, height: int) -> tuple[Lens | None, Rig | None]:
    """The lens, or the rig of a pair, for pictures of this size. A calibration of a proportional size is scaled.

    Raises:  InputError naming the file, the key and what is allowed.
    """
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
    """The lens for pictures of this size. Raises InputError for another aspect ratio than that of the calibration."""
    if abs(lens.width * height - lens.height * width) > max(lens.width, width) // 100:
        raise InputError(
            f"{where}: the calibration is of {lens.width}x{lens.height} pixels, the pictures have {width}x{height}"
        )
    return lens.scaled(width, height)
