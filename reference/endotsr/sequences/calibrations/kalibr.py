"""Kalibr's camchain.yaml: cam0, and for a pair cam1 with T_cn_cnm1, which maps cam0 to cam1, metres."""

from pathlib import Path
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.sequences.calibrations.stored import Intrinsics, StoredCalibration, distortion_of
from endotsr.untrusted.yaml import matrix

ABOUT = "camchain.yaml of Kalibr (pinhole, radtan), metres"
MODELS = {"camera_model": ("pinhole",), "distortion_model": ("radtan", "none")}


def read(path: Path, keys: dict[str, Any]) -> StoredCalibration | None:
    """The first camera, or the first two. Raises InputError for another model than pinhole with radtan."""
    if not isinstance(keys.get("cam0"), dict):
        return None
    left = _camera(path, keys["cam0"], "cam0")
    if not isinstance(keys.get("cam1"), dict):
        return StoredCalibration(left)
    motion = matrix(keys["cam1"].get("T_cn_cnm1"), f"{path}: cam1: T_cn_cnm1", (4, 4))
    return StoredCalibration(left, _camera(path, keys["cam1"], "cam1"), motion[:3, :3], 1000.0 * motion[:3, 3])


def _camera(path: Path, keys: dict[str, Any], name: str) -> Intrinsics:
    where = f"{path}: {name}"
    for key, allowed in MODELS.items():
        if keys.get(key, allowed[0]) not in allowed:
            raise InputError(f"{where}: {key} {keys[key]!r} is not allowed; allowed: {', '.join(allowed)}")
    fx, fy, cx, cy = matrix(keys.get("intrinsics"), f"{where}: intrinsics", (4,))
    given = matrix(keys.get("distortion_coeffs", [0.0] * 4), f"{where}: distortion_coeffs", (-1,))
    width, height = matrix(keys.get("resolution"), f"{where}: resolution", (2,))
    if min(width, height) < 1 or width % 1 or height % 1:
        raise InputError(f"{where}: resolution: allowed: two whole numbers > 0")
    return Intrinsics(
        np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), distortion_of(given, where), (int(width), int(height))
    )
