"""The ini file of StereoMIS; see `endotsr.sequences.calibration`."""

from pathlib import Path
from typing import Any

from endotsr.sequences.calibration import read_rig
from endotsr.sequences.calibrations.stored import Intrinsics, StoredCalibration
from endotsr.sequences.recording import Lens, opencv_matrix

ABOUT = "FILE.ini with StereoLeft and StereoRight, millimetres"


def read(path: Path, keys: dict[str, Any]) -> StoredCalibration | None:
    """The pair of the file. Raises InputError."""
    if path.suffix.lower() != ".ini":
        return None
    rig = read_rig(path)
    return StoredCalibration(_stored(rig.left), _stored(rig.right), rig.rotation, rig.translation)


def _stored(lens: Lens) -> Intrinsics:
    return Intrinsics(opencv_matrix(lens), lens.distortion, (lens.width, lens.height))
