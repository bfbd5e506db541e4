"""ROS camera_info in YAML, as `camera_calibration` writes it: one file, or a folder with left.yaml and right.yaml.

The right camera of a pair has Tx = -fx B in its projection matrix, B in metres, and each has the rotation
`rectification_matrix` to the rectified pair: rotation = R_right^T R_left, translation = R_right^T (Tx / fx, 0, 0).
"""

from pathlib import Path
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.sequences.calibrations.stored import Intrinsics, StoredCalibration, distortion_of
from endotsr.untrusted.yaml import matrix, read_yaml

ABOUT = "camera_info of ROS, FILE.yaml or a folder with left.yaml and right.yaml, metres"
MODELS = ("plumb_bob", "rational_polynomial")
MARK = "projection_matrix"


def read(path: Path, keys: dict[str, Any]) -> StoredCalibration | None:
    """One camera, or the pair of a folder. Raises InputError for another model of distortion, or no baseline."""
    if not path.is_dir():
        return StoredCalibration(_camera(path, keys)) if MARK in keys else None
    files = [path / f"{side}.yaml" for side in ("left", "right")]
    if not all(file.is_file() for file in files):
        return None
    left, right = (read_yaml(file) for file in files)
    turns = [matrix(k.get("rectification_matrix"), f"{f}: rectification_matrix", (3, 3))
             for k, f in zip((left, right), files)]  # fmt: skip
    projection = matrix(right.get(MARK), f"{files[1]}: {MARK}", (3, 4))
    if projection[0, 3] >= 0:
        raise InputError(f"{files[1]}: {MARK}: Tx = {projection[0, 3]:g}; allowed: below 0, -fx times the baseline")
    across = np.array([1000.0 * projection[0, 3] / projection[0, 0], 0.0, 0.0])
    return StoredCalibration(
        _camera(files[0], left), _camera(files[1], right), turns[1].T @ turns[0], turns[1].T @ across
    )


def _camera(path: Path, keys: dict[str, Any]) -> Intrinsics:
    model = keys.get("distortion_model", MODELS[0])
    if model not in MODELS:
        raise InputError(f"{path}: distortion_model {model!r} is not allowed; allowed: {', '.join(MODELS)}")
    size = keys.get("image_width"), keys.get("image_height")
    if not all(isinstance(side, int) and side > 0 for side in size):
        raise InputError(f"{path}: image_width and image_height: allowed: whole numbers > 0")
    found = matrix(keys.get("camera_matrix"), f"{path}: camera_matrix", (3, 3))
    given = matrix(keys.get("distortion_coefficients"), f"{path}: distortion_coefficients", (-1,))
    return Intrinsics(found, distortion_of(given, f"{path}: distortion_coefficients"), (size[0], size[1]))  # type: ignore[arg-type]
