"""Calibrations of programs that localise a moving camera: ORB-SLAM, and the recordings of EuRoC and KITTI.

As in `calibration_formats`: a function per format returns None for a file in another one, and pixel centres are at
integers.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.calibration_formats import (
    Format,
    StoredCalibration,
    StoredIntrinsics,
    distortion_of,
)
from endotsr.clips.formats.inventory import Inventory
from endotsr.errors import InputError
from endotsr.untrusted.json import Keys, number
from endotsr.untrusted.names import choice
from endotsr.untrusted.yaml import matrix

ORB = Inventory(
    "settings of ORB-SLAM2 and ORB-SLAM3",
    used={
        "Camera.type": "PinHole or Rectified",
        "Camera.fx Camera.fy Camera.cx Camera.cy Camera1.fx Camera1.fy Camera1.cx Camera1.cy": "intrinsics, pixel"
        " centres at integers",
        "Camera.k1 Camera.k2 Camera.p1 Camera.p2 Camera.k3 Camera1.k1 Camera1.k2 Camera1.p1 Camera1.p2 Camera1.k3": ""
        "distortion in the model of OpenCV",
        "Camera.width Camera.height": "size of the pictures",
        "Camera.bf Stereo.b": "baseline of a rectified pair: times fx, or in metres",
    },
    refused={
        "Camera1.k4 Camera.k4": "a fisheye model is not supported: undistort the pictures first",
        "Camera2.* Stereo.T_c1_c2 LEFT.* RIGHT.*": "a pair that is not rectified: state both cameras in the form of"
        " OpenCV or Kalibr",
    },
    told={
        "DepthMapFactor RGBD.DepthMapFactor": "steps of the depth per metre: the layout tum applies it; for files of"
        " --depth state it with --depth-unit m and --depth-scale, one divided by it",
    },
    harmless={
        "File.version": "it documents the file",
        "Camera.fps Camera.RGB Camera.newWidth Camera.newHeight": "a setting of the program that reads the pictures",
        "ThDepth Stereo.ThDepth": "it sets which depth the program uses",
        "ORBextractor.* Viewer.* System.* IMU.* Tbc loopClosing": "a setting of the program",
    },
)
EUROC = Inventory(
    "sensor.yaml of a camera of EuRoC",
    used={
        "camera_model distortion_model": "pinhole, with radial-tangential or radtan",
        "intrinsics": "fx fy cx cy, pixel centres at integers",
        "distortion_coefficients": "k1 k2 p1 p2",
        "resolution": "width and height",
        "T_BS": "from the camera to the body, metres: in mav0/ it relates two cameras, and the camera to the poses",
    },
    harmless={
        "sensor_type comment": "it documents the calibration",
        "rate_hz": "the times of the pictures are in data.csv; a file of one camera needs none",
    },
)
EUROC_MODELS = {"camera_model": ("pinhole",), "distortion_model": ("radial-tangential", "radtan", "none")}


def read_orb(path: Path, keys: Keys) -> StoredCalibration | None:
    """One camera, or a rectified pair by its baseline. Raises InputError for a missing number or another model."""
    camera = next((name for name in ("Camera", "Camera1") if f"{name}.fx" in keys), None)
    if camera is None:
        return None
    notes = ORB.noted(keys, path)
    model = keys.get("Camera.type", "PinHole")
    if model not in ("PinHole", "Rectified"):
        raise InputError(f"{path}: Camera.type {model!r}; use PinHole or Rectified: undistort the pictures first")

    def value(name: str, otherwise: float | None = None) -> float:
        return number(keys.get(name, otherwise), f"{path}: {name}")

    fx, fy, cx, cy = (value(f"{camera}.{name}") for name in ("fx", "fy", "cx", "cy"))
    bent = np.array([value(f"{camera}.{name}", 0.0) for name in ("k1", "k2", "p1", "p2", "k3")])
    size = None
    if "Camera.width" in keys and "Camera.height" in keys:
        size = int(value("Camera.width")), int(value("Camera.height"))
    baseline = value("Stereo.b") if "Stereo.b" in keys else value("Camera.bf", 0.0) / fx
    found = StoredIntrinsics(_matrix(fx, fy, cx, cy), tuple(bent.tolist()) if bent.any() else (), size)
    return StoredCalibration(found, baseline=1000.0 * baseline or None, notes=tuple(notes))


def read_euroc(path: Path, keys: Keys) -> StoredCalibration | None:
    """One camera. Raises InputError for another model than pinhole with radial-tangential distortion."""
    if "intrinsics" not in keys or "resolution" not in keys:
        return None
    notes = EUROC.noted(keys, path)
    for key, allowed in EUROC_MODELS.items():
        if keys.get(key, allowed[0]) not in allowed:
            raise InputError(f"{path}: {key} {keys[key]!r}; use {choice(allowed)}")
    fx, fy, cx, cy = matrix(keys["intrinsics"], f"{path}: intrinsics", (4,)).tolist()
    width, height = matrix(keys["resolution"], f"{path}: resolution", (2,)).tolist()
    given = matrix(keys.get("distortion_coefficients", [0.0] * 4), f"{path}: distortion_coefficients", (-1,))
    found = StoredIntrinsics(
        _matrix(fx, fy, cx, cy), distortion_of(given, f"{path}: distortion_coefficients"), (int(width), int(height))
    )
    return StoredCalibration(found, notes=tuple(notes))


def _matrix(fx: float, fy: float, cx: float, cy: float) -> np.ndarray:
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


FORMATS = (
    Format("settings of ORB-SLAM (Camera.fx ...), metres", read_orb),
    Format("sensor.yaml of EuRoC", read_euroc),
)
