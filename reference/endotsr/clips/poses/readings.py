"""What given poses would be if their file meant something else: the usual misreadings, each with its remedy.

In: poses world to camera in OpenCV axes, as they were read. Out: poses under every reading.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.poses.views import inverse
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose

OPENGL = np.diag([1.0, -1.0, -1.0])  # x right, y up, z backward: the columns of a camera-to-world rotation
LLFF = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # columns down, right, back to right, up, back
TO_MM = 1000.0
# Order that the file has -> places of the true x y z w in the quaternion that was read as x y z w.
ORDERS = {"w x y z": [1, 2, 3, 0], "x y z w": [3, 0, 1, 2]}


class Reading(NamedTuple):
    """Poses under another reading of their file."""

    name: str
    poses: list[CameraPose]
    remedy: str


REMEDIES = {
    "inverse": "the other direction: prepare --trajectory-direction, or [poses] direction in sequence.toml",
    "OpenGL axes": "the other axes: prepare --trajectory-axes opengl or opencv, or [poses] axes in sequence.toml",
    "LLFF axes": "the columns of the rotations are down, right, backward: prepare --trajectory-axes llff",
    "axes turned as from LLFF": "the columns of the rotations were turned as if they were LLFF's: prepare"
    " --trajectory-axes opengl; if the file itself was changed, undo it (columns -1, 0, 2 of each 3x5 matrix)",
    "quaternions w x y z": "write the quaternions in the order x y z w",
    "quaternions x y z w": "the quaternions were reordered once too often: write them as they were",
    "unit x 1000": "a unit 1000 times as long: prepare --trajectory-unit, or unit in sequence.toml",
    "unit / 1000": "a unit 1000 times as short: prepare --trajectory-unit, or unit in sequence.toml",
    "one frame late": "frame k belongs to pose k + 1: leave out the first pose and the last frame",
    "one frame early": "frame k belongs to pose k - 1: leave out the last pose and the first frame",
    "reversed order": "the last pose belongs to the first frame: write the poses from the last to the first",
}


def readings(poses: list[CameraPose]) -> list[Reading]:
    """Every usual misreading of the poses, undone."""
    turn = np.array([pose.rotation.T for pose in poses])  # camera to world
    centre = np.array([-pose.rotation.T @ pose.translation for pose in poses])
    found = {
        "inverse": [inverse(pose) for pose in poses],
        "OpenGL axes": _placed(turn @ OPENGL, centre),
        # Columns as read are x right, y down, z forward, after the reader's change from LLFF's x right, y up, z back.
        "LLFF axes": _placed(turn @ OPENGL @ LLFF @ OPENGL, centre),
        "axes turned as from LLFF": _placed(turn @ OPENGL @ LLFF.T @ OPENGL, centre),
        "unit x 1000": _placed(turn, centre * TO_MM),
        "unit / 1000": _placed(turn, centre / TO_MM),
        "one frame late": poses[1:] + poses[-1:],
        "one frame early": poses[:1] + poses[:-1],
        "reversed order": poses[::-1],
    }
    for name, order in ORDERS.items():
        found[f"quaternions {name}"] = _placed(_reordered(turn, order), centre)
    return [Reading(name, moved, REMEDIES[name]) for name, moved in found.items()]


def _placed(turn: FloatArray, centre: FloatArray) -> list[CameraPose]:
    """World-to-camera poses from camera-to-world rotations (n, 3, 3) and centres (n, 3)."""
    return [CameraPose(t.T, -t.T @ c) for t, c in zip(turn, centre)]


def _reordered(turn: FloatArray, order: list[int]) -> FloatArray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(Rotation.from_matrix(turn).as_quat()[:, order]).as_matrix()
