"""The axes of exported files, independent of the axes of the input.

Training uses the world coordinates of the sequence, which depend on its layout: EndoNeRF has y up and z backward. All
exports (ply, point cloud, mesh, camera paths) use the camera axes of the first frame: x right, y down, z forward,
origin at its optical centre. A camera with the identity pose therefore shows the first frame. The conversion takes
place on export only: checkpoints, sequence.json and slim models keep the training coordinates. The pose of
`MovingScene.cameras[0]` is the transformation to the exports. In the record of a slim model this is `cameras[0]`; in
sequence.json, `cameras[0]` lacks the pose correction of the model, if it has one.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.harmonics_formulas import harmonic_basis
from endotsr.method.splatting.render import Scene

DIRECTIONS = 64  # sample directions for the rotation of the harmonics
DEGREES = (slice(0, 3), slice(3, 8), slice(8, 15))  # Y_1 ... Y_15 of degree 1, 2 and 3
NEAR_WHOLE = 1e-12  # entries of a harmonics rotation this close to an integer are rounded to it


class Placement(NamedTuple):
    """x_out = rotation @ x_training + translation."""

    rotation: FloatArray  # (3, 3)
    translation: FloatArray  # (3,) scene units

    @property
    def unchanged(self) -> bool:
        """Whether exports and training have the same axes and origin."""
        return bool((self.rotation == np.eye(3)).all()) and not np.any(self.translation)


HERE = Placement(np.eye(3), np.zeros(3))


def placement_of(camera: Camera) -> Placement:
    """The placement that maps this camera to the identity pose."""
    return Placement(np.asarray(camera.rotation, np.float64), np.asarray(camera.translation, np.float64))


def placed_points(points: FloatArray, placement: Placement) -> FloatArray:
    """Positions (3, N) in export coordinates, same type; bitwise unchanged for the identity."""
    if placement.unchanged:
        return points
    moved = placement.rotation @ points.astype(np.float64) + placement.translation[:, None]
    return moved.astype(points.dtype)


def placed_scene(scene: Scene, placement: Placement) -> Scene:
    """Gaussians in export coordinates: positions, quaternions and harmonics are transformed."""
    if placement.unchanged:
        return scene
    return scene._replace(
        position=placed_points(scene.position, placement),
        quaternion=_turned_quaternions(scene.quaternion, placement.rotation),
        harmonics=_turned_harmonics(scene.harmonics, placement.rotation),
    )


def _turned_quaternions(quaternion: FloatArray, rotation: FloatArray) -> FloatArray:
    """The quaternions (4, N), w x y z, of rotation @ R(quaternion), with unchanged norms."""
    from scipy.spatial.transform import Rotation

    a, b, c, d = Rotation.from_matrix(rotation).as_quat(scalar_first=True)
    left = np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])
    return (left @ quaternion.astype(np.float64)).astype(quaternion.dtype)


def _turned_harmonics(harmonics: FloatArray, rotation: FloatArray) -> FloatArray:
    """Rotated coefficients (K, 3, N): their colour in direction rotation @ d equals the given one's in direction d."""
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
    """A camera of the training, in export coordinates."""
    if placement.unchanged:
        return camera
    rotation = np.asarray(camera.rotation, np.float64) @ placement.rotation.T
    return camera._replace(rotation=rotation, translation=camera.translation - rotation @ placement.translation + 0.0)


def training_camera(camera: Camera, placement: Placement) -> Camera:
    """A camera in export coordinates, for example from a file, in training coordinates."""
    if placement.unchanged:
        return camera
    translation = camera.rotation @ placement.translation + camera.translation
    return camera._replace(rotation=camera.rotation @ placement.rotation, translation=translation)
