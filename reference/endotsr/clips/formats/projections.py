"""Calibrations that are projection matrices (3, 4) of a rectified pair: KITTI, and `cv2.stereoRectify`.

The fourth column of the right camera contains -fx times the baseline.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.calibration_fields import OPENCV
from endotsr.clips.formats.calibration_formats import (
    CAMERA_NAMES,
    LARGEST_MATRIX,
    Format,
    StoredCalibration,
    StoredIntrinsics,
    opencv_size,
)
from endotsr.clips.formats.files import shortened
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.files import read_text
from endotsr.untrusted.json import Keys
from endotsr.untrusted.names import plain_line
from endotsr.untrusted.yaml import matrix

KITTI_PAIRS = (("P0", "P1"), ("P2", "P3"), ("P_rect_00", "P_rect_01"), ("P_rect_02", "P_rect_03"))
UPWARDS = 0.1  # most vertical over horizontal offset of a rectified pair


def rectified_baseline(left: FloatArray, right: FloatArray, where: str) -> float:
    """The baseline of two projection matrices (3, 4) of one rectified pair, in the unit of their fourth column.

    Raises:  InputError unless both have the same intrinsics and the second camera is to the right of the first.
    """
    if not np.allclose(left[:, :3], right[:, :3], rtol=1e-9):
        raise InputError(
            f"{where}: the first three columns differ: use matrices of one rectified pair, whose principal points agree"
            " (OpenCV: CALIB_ZERO_DISPARITY)"
        )
    baseline = float(left[0, 3] - right[0, 3]) / float(left[0, 0])
    upwards = abs(float(left[1, 3] - right[1, 3]) / float(left[1, 1]))
    if baseline <= 0 or upwards > UPWARDS * baseline:
        raise InputError(
            f"{where}: the second camera is {baseline:.4g} to the right of the first and {upwards:.4g} above or below"
            " it; use the left camera first, and a pair side by side"
        )
    return baseline


def read_projections(path: Path, keys: Keys) -> StoredCalibration | None:
    """The rectified pair P1, P2 of `cv2.stereoRectify` in a file without the cameras themselves, in millimetres.

    Raises:  InputError as `rectified_baseline`.
    """
    if not {"P1", "P2"} <= set(keys) or CAMERA_NAMES & set(keys):
        return None
    left, right = (matrix(keys[name], f"{path}: {name}", (3, 4)) for name in ("P1", "P2"))
    baseline = rectified_baseline(left, right, f"{path}: P1 and P2")
    note = f"{path.name}: P1 and P2 are read as a rectified pair, baseline {baseline:g} mm (--baseline overrides it)"
    found = StoredIntrinsics(left[:, :3].copy(), size=opencv_size(keys, path))
    return StoredCalibration(found, baseline=baseline, notes=(note, *OPENCV.noted(keys, path)))


def read_kitti(path: Path, keys: Keys) -> StoredCalibration | None:
    """The rectified pair of a file with lines `P0: ` or `P_rect_00: ` and twelve numbers; the baseline is in metres.

    Raises:  InputError for a line without twelve numbers, or as `rectified_baseline`.
    """
    if path.suffix.lower() != ".txt":
        return None
    lines = dict(line.split(":", 1) for line in read_text(path, LARGEST_MATRIX).splitlines() if ":" in line)
    pair = next((pair for pair in KITTI_PAIRS if set(pair) <= set(lines)), None)
    if pair is None:
        single = next((name for names in KITTI_PAIRS for name in names if name in lines), None)
        return None if single is None else _kitti_camera(path, lines, single)
    left, right = (matrix(_floats(lines[name]), f"{path}: {name}", (3, 4)) for name in pair)
    baseline = rectified_baseline(left, right, f"{path}: {pair[0]} and {pair[1]}")
    notes = [f"{path.name}: {pair[0]} and {pair[1]} are read", *_kitti_unused(path, lines, pair)]
    found = StoredIntrinsics(left[:, :3].copy(), size=_kitti_size(path, lines, pair[0]))
    return StoredCalibration(found, baseline=1000.0 * baseline, notes=tuple(notes))


def _kitti_camera(path: Path, lines: dict[str, str], name: str) -> StoredCalibration:
    """One camera of a rig. Its fourth column is its place in the rig, and a clip of one camera does not need it."""
    found = matrix(_floats(lines[name]), f"{path}: {name}", (3, 4))
    notes = [f"{path.name}: {name} is read as one camera, without a baseline", *_kitti_unused(path, lines, (name,))]
    return StoredCalibration(
        StoredIntrinsics(found[:, :3].copy(), size=_kitti_size(path, lines, name)), notes=tuple(notes)
    )


def _kitti_unused(path: Path, lines: dict[str, str], used: tuple[str, ...]) -> list[str]:
    unused = [plain_line(name) for name in lines if name not in used and not name.startswith("S_rect_")]
    return [f"{path.name}: not used: {shortened(unused)}"] if unused else []


def _kitti_size(path: Path, lines: dict[str, str], name: str) -> tuple[int, int] | None:
    """Width and height of the rectified pictures in calib_cam_to_cam.txt; None if the file does not state them."""
    key = name.replace("P_rect_", "S_rect_")
    if key == name or key not in lines:
        return None
    width, height = matrix(_floats(lines[key]), f"{path}: {key}", (2,))
    return int(width), int(height)


def _floats(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []


FORMATS = (
    Format("calib.txt or calib_cam_to_cam.txt of KITTI (P0: P1: ...), metres", read_kitti),
    Format("P1 and P2 of OpenCV's stereoRectify, for rectified pictures, millimetres", read_projections),
)
