"""The intrinsics or the stereo calibration of a calibration file, for pictures of a given size.

OpenCV's pixel centres are at integers; half a pixel is added to cx and cy, because pixel edges are at integers here.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from endotsr.clips.formats.calibration_formats import FORMATS as GENERAL
from endotsr.clips.formats.calibration_formats import StoredCalibration, StoredIntrinsics
from endotsr.clips.formats.camera import Intrinsics, StereoCalibration, checked_rotation, intrinsics_of_matrix
from endotsr.clips.formats.conversions import calibration_conversion
from endotsr.clips.formats.files import shortened
from endotsr.clips.formats.matlab_calibrations import FORMATS as MATLAB
from endotsr.clips.formats.matlab_calibrations import matlab_keys
from endotsr.clips.formats.plain_calibrations import FORMATS as PLAIN
from endotsr.clips.formats.plain_calibrations import numpy_keys
from endotsr.clips.formats.projections import FORMATS as PROJECTIONS
from endotsr.clips.formats.slam_calibrations import FORMATS as SLAM
from endotsr.errors import InputError
from endotsr.untrusted.json import read_json
from endotsr.untrusted.names import plain_line
from endotsr.untrusted.storage import read_storage
from endotsr.untrusted.yaml import read_yaml

FORMATS = (GENERAL[0], *SLAM, *PROJECTIONS, *MATLAB, *GENERAL[1:], *PLAIN)  # in the order in which they are tried
READERS = {".yaml": read_yaml, ".yml": read_yaml, ".json": read_json, ".xml": read_storage, ".mat": matlab_keys,
           ".npz": numpy_keys, ".npy": numpy_keys}  # fmt: skip


def read_calibration(path: Path) -> StoredCalibration:
    """The calibration in a file, or in a folder with one file for left and one for right.

    Raises:  InputError naming the file, the key and what is allowed.
    """
    if not path.exists():
        raise InputError(f"{path}: not found")
    read = READERS.get(path.suffix.lower())
    keys = read(path) if read else {}
    for entry in FORMATS:
        found = entry.read(path, keys)
        if found is not None:
            return found
    known = "; ".join(entry.about for entry in FORMATS)
    held = f": it holds {shortened([plain_line(name)[:60] for name in keys])}" if keys else calibration_conversion(path)
    raise InputError(f"{path}: no calibration that is known here{held}; use {known}")


SAME_SHAPE = 0.02  # relative difference of proportions
ROUNDED = 1  # pixels by which rounding to an even number changes a side at most


class StatedCamera(NamedTuple):
    """What a user states about the camera of a source; None for the rest."""

    intrinsics: Intrinsics | None = None
    calibration: StereoCalibration | None = None
    baseline: float | None = None  # of an already rectified pair, millimetres
    notes: tuple[str, ...] = ()


def calibrated(path: Path, width: int, height: int) -> StatedCamera:
    """The camera or the pair of a file, for pictures of this size. Proportional sizes are scaled, which is noted.

    Raises:  InputError naming the file, the key and what is allowed.
    """
    found = read_calibration(path)

    def intrinsics(stored: StoredIntrinsics, side: str) -> Intrinsics:
        where = f"{path}: {side}" if found.right else str(path)
        distortion = stored.distortion if any(stored.distortion) else ()
        whole = intrinsics_of_matrix(stored.matrix, *(stored.size or (width, height)), distortion, where=where)
        notes.update(dict.fromkeys(_scaling(whole, width, height, path)))
        return fitted_intrinsics(whole, width, height, where)

    notes = dict.fromkeys(found.notes)  # without repetitions: two cameras of one size are scaled alike
    left = intrinsics(found.left, "left")
    if found.right is None:
        return StatedCamera(left, baseline=found.baseline, notes=tuple(notes))
    rotation = checked_rotation(found.rotation, f"{path}: rotation between the cameras")
    if not np.isfinite(found.translation).all() or not found.translation.any():
        raise InputError(f"{path}: both cameras are in one place; use a translation between them")
    pair = StereoCalibration(left, intrinsics(found.right, "right"), rotation, found.translation)
    return StatedCamera(calibration=pair, notes=tuple(notes))


def _squeezed(whole: float, found: float) -> str:
    """The remedy, if pictures have half or twice the proportions of the calibration."""
    for factor, way in ((2.0, "half_side_by_side"), (0.5, "half_stacked")):
        if abs(whole / found / factor - 1) < SAME_SHAPE:
            return f"; if the views of a pair are squeezed to half, --stereo {way} restores them"
    return ""


def _one_shape(size: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether the smaller size is the larger one times a factor, each side rounded to a whole or an even number.

    A factor f with |f W - w| <= 1 and |f H - h| <= 1 exists where |w H - h W| <= W + H.
    """
    (w, h), (width, height) = sorted((size, other), key=lambda sides: sides[0] * sides[1])
    return abs(w * height - h * width) <= ROUNDED * (width + height)


def _scaling(stored: Intrinsics, width: int, height: int, path: Path) -> list[str]:
    """A note on a calibration of another size than the pictures; none for their size and for another shape."""
    if (stored.width, stored.height) == (width, height):
        return []
    exact = stored.width * height == stored.height * width
    return [
        f"{path.name}: calibration of {stored.width}x{stored.height} pixels, scaled to the {width}x{height} of the"
        f" pictures{'' if exact else '; the proportions differ by rounding'}"
    ]


def fitted_intrinsics(intrinsics: Intrinsics, width: int, height: int, where: object) -> Intrinsics:
    """The intrinsics for pictures of this size. Raises InputError if the aspect ratio differs by more than rounding."""
    if not _one_shape((intrinsics.width, intrinsics.height), (width, height)):
        raise InputError(
            f"{where}: the calibration is of {intrinsics.width}x{intrinsics.height} pixels, the pictures have"
            f" {width}x{height}{_squeezed(intrinsics.width / intrinsics.height, width / height)}"
        )
    return intrinsics.scaled(width, height)
