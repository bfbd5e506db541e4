"""Calibrations as ROS and Kalibr write them."""

import cv2
import numpy as np
import yaml

SIZE = (128, 96)
BENT = [-0.2, 0.05, 0.001, -0.002, 0.01]
TURN = cv2.Rodrigues(np.array([0.01, -0.02, 0.005]))[0]
SHIFT = np.array([-5.0, 0.1, -0.2])  # mm


def ros(matrix, distortion=BENT, **changes):
    """A camera_info as ROS writes it."""
    stored = lambda values, rows: {"rows": rows, "cols": len(values) // rows, "data": [float(v) for v in values]}
    return yaml.safe_dump({
        "image_width": 128, "image_height": 96, "camera_name": "left", "camera_matrix": stored(np.ravel(matrix), 3),
        "distortion_model": "plumb_bob", "distortion_coefficients": stored(distortion, 1),
        "rectification_matrix": stored(np.eye(3).ravel(), 3),
        "projection_matrix": stored(np.column_stack([matrix, np.zeros(3)]).ravel(), 3),
    } | changes)  # fmt: skip


def kalibr(pair=True, **changes):
    """A camchain as Kalibr writes it."""
    camera = {"camera_model": "pinhole", "intrinsics": [100.0, 101.0, 63.5, 47.5], "distortion_model": "radtan",
              "distortion_coeffs": BENT[:4], "resolution": [128, 96], "rostopic": "/cam0"}  # fmt: skip
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = TURN, SHIFT / 1000
    chain = {"cam0": camera | changes}
    return yaml.safe_dump(chain | ({"cam1": camera | {"T_cn_cnm1": motion.tolist()}} if pair else {}))
