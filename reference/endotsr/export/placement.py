"""The axes of everything that is written for other programs, whatever those of the input were.

A scene is trained in the world of its sequence, and layouts differ: an EndoNeRF world has y up and z backward. Every
output (ply, point cloud, mesh, camera paths) is in the axes of the camera of the first frame instead: x to the right, y
down, z forward, the origin at its optical centre. The camera with the identity as its pose sees what the first frame
shows. Outputs are converted when they are written: checkpoints, sequence.json and the arrays of a slim model stay in
the world of the training, to the bit, and `cameras[0]` of their records leads from it to the outputs.
"""

from typing import NamedTuple

import numpy as np

from endotsr.kernels.arrays import FloatArray
from endotsr.splatting.camera import Camera
from endotsr.splatting.harmonics_formulas import harmonic_basis
from endotsr.splatting.render import Scene

DIRECTIONS = 64  # from which the rotation of the harmonics is found
DEGREES = (slice(0, 3), slice(3, 8), slice(8, 15))  # Y_1 ... Y_15 of degree 1, 2 and 3
NEAR_WHOLE = 1e-12  # an entry of a rotation of harmonics this near to a whole number is that number


class Placement(NamedTuple):
    """x_out = rotation @ x_training + translation."""

    rotation: FloatArray  # (3, 3)
    translation: FloatArray  # (3,) scene units

    @property
    def unchanged(self) -> bool:
        """Whether the outputs have the axes of the training."""
        return bool((self.rotation == np.eye(3)).all()) and not np.any(self.translation)


HERE = Placement(np.eye(3), np.zeros(3))


def placement_of(camera: Camera) -> Placement:
    """The placement that makes this camera the identity."""
    return Placement(np.asarray(camera.rotation, np.float64), np.asarray(camera.translation, np.float64))


def placed_points(points: FloatArray, placement: Placement) -> FloatArray:
    """Positions (3, N) in the axes of the outputs, in their type; unchanged positions to the bit."""
    if placement.unchanged:
        return points
    moved = placement.rotation @ points.astype(np.float64) + placement.translation[:, None]
    return moved.astype(points.dtype)


def placed_scene(scene: Scene, placement: Placement) -> Scene:
    """Gaussians in the axes of the outputs: positions, rotations, and the directions of their colours."""
    if placement.unchanged:
        return scene
    return scene._replace(
        position=placed_points(scene.position, placement),
        quaternion=_turned_quaternions(scene.quaternion, placement.rotation),
        harmonics=_turned_harmonics(scene.harmonics, placement.rotation),
    )


def _turned_quaternions(quaternion: FloatArray, rotation: FloatArray) -> FloatArray:
    """The quaternions (4, N), w x y z, of rotation @ R(quaternion); their lengths stay."""
    from scipy.spatial.transform import Rotation

    a, b, c, d = Rotation.from_matrix(rotation).as_quat(scalar_first=True)
    left = np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])
    return (left @ quaternion.astype(np.float64)).astype(quaternion.dtype)


def _turned_harmonics(harmonics: FloatArray, rotation: FloatArray) -> FloatArray:
    """Coefficients (K, 3, N) whose colour in the direction rotation @ d is that of the given ones in d."""
    found = harmonics.astype(np.float64)
    if len(harmonics) > 1:
        directions = np.random.default_rng(0).normal(size=(DIRECTIONS, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        before, after = _basis(directions), _basis(directions @ rotation.T)
        for degree in DEGREES:
            rows = slice(degree.start + 1, degree.stop + 1)
            if rows.stop <= len(harmonics):
                turn = np.linalg.lstsq(after[:, degree], before[:, degree], rcond=None)[0]
                turn = np.where(np.abs(turn - np.rint(turn)) < NEAR_WHOLE, np.rint(turn), turn)
                found[rows] = np.tensordot(turn, found[rows], 1)
    return found.astype(harmonics.dtype)


def _basis(directions: FloatArray) -> FloatArray:
    """Y_1 ... Y_15 (M, 15) in unit directions (M, 3)."""
    return np.array([harmonic_basis(x, y, z) for x, y, z in directions.tolist()], np.float64)


def placed_camera(camera: Camera, placement: Placement) -> Camera:
    """The pose of a camera of the training in the axes of the outputs."""
    if placement.unchanged:
        return camera
    rotation = np.asarray(camera.rotation, np.float64) @ placement.rotation.T
    return camera._replace(rotation=rotation, translation=camera.translation - rotation @ placement.translation + 0.0)


def training_camera(camera: Camera, placement: Placement) -> Camera:
    """A camera in the axes of the outputs, such as that of a file, in the world of the training."""
    if placement.unchanged:
        return camera
    translation = camera.rotation @ placement.translation + camera.translation
    return camera._replace(rotation=camera.rotation @ placement.rotation, translation=translation)
