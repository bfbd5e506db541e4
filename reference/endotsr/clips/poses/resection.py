"""The pose of a camera from points and the pixels where it sees them: consensus, then robust least squares.

In: `Matches`. Out: `Resection`. The residual is the distance in pixels; Tukey's weights leave out wrong matches and
tissue that moves on its own.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.opencv.geometry import pose_by_consensus
from endotsr.clips.poses.matches import Matches
from endotsr.clips.poses.steps import moved
from endotsr.clips.poses.views import IDENTITY
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, CameraPose, project

LEAST = 12  # matches, and matches that agree
LEAST_AGREEING = 0.3  # of the matches that agree
ROUNDS = 12  # of the least squares
TUKEY = 4.685  # 95 % efficiency
FLOOR = 0.9  # pixels: least width of the weights
ENOUGH = 1e-7  # rad, and fraction of the depth: a shorter step ends the rounds


class Resection(NamedTuple):
    """A pose, and how well the matches agree."""

    pose: CameraPose  # of the target camera relative to the source camera
    distance: FloatArray  # (M,) pixels
    weight: FloatArray  # (M,) in [0, 1]

    @property
    def agreeing(self) -> float:
        """Fraction of the matches that agree."""
        return float((self.weight > 0.1).mean())


def resection(
    matches: Matches, camera: Camera, start: CameraPose = IDENTITY, consensus: bool = True
) -> Resection | None:
    """The relative pose that explains the matches best; None if fewer than `LEAST` or `LEAST_AGREEING` of them agree.

    start       where the least squares begin
    consensus   whether the pose on which random samples agree takes the place of `start`
    """
    if matches.count < LEAST:
        return None
    pose, x = start, matches.points
    if consensus:
        found = pose_by_consensus(x, matches.target, camera, start)
        if found is not None and len(found.agree) > LEAST_AGREEING * matches.count:
            pose = CameraPose(found.rotation, found.translation)
    unit = float(np.median(x[2]))
    for _ in range(ROUNDS):
        error, distance, weight = _errors(pose, matches, camera)
        step = _step(pose, x, error, weight, camera, unit)
        pose = moved(pose, step)
        if max(np.abs(step[:3]).max(), np.abs(step[3:]).max() / unit) < ENOUGH:
            break
    _, distance, weight = _errors(pose, matches, camera)
    done = Resection(pose, distance, weight)
    agree = float((weight > 0.1).sum())
    sound = agree >= max(LEAST, LEAST_AGREEING * matches.count) and np.isfinite(pose.translation).all()
    return done if sound else None


def left_over(pose: CameraPose, matches: Matches, camera: Camera) -> FloatArray:
    """(M,) distance in pixels between the matches and the projections under a relative pose; inf behind the camera."""
    u, v, z = project(camera._replace(rotation=pose.rotation, translation=pose.translation), matches.points)
    return np.where(z > 0, np.hypot(u - matches.target[0], v - matches.target[1]), np.inf)


def _errors(pose: CameraPose, matches: Matches, camera: Camera) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Errors (2, M) in pixels, their lengths (M,), and their weights (M,)."""
    placed = camera._replace(rotation=pose.rotation, translation=pose.translation)
    u, v, z = project(placed, matches.points)
    error = np.where(z > 0, np.stack([u, v]) - matches.target, 0.0)
    distance = np.where(z > 0, np.hypot(*error), np.inf)
    width = max(FLOOR, TUKEY * 1.2 * float(np.median(distance)))  # 1.2: root mean square over median length
    ratio = np.minimum(distance / width, 1.0)
    return error, distance, (1 - ratio**2) ** 2


def _step(
    pose: CameraPose, points: FloatArray, error: FloatArray, weight: FloatArray, camera: Camera, unit: float
) -> FloatArray:
    """The Gauss-Newton step (6,): rotation vector and offset of equation (B16)."""
    x, y, z = seen = pose.rotation @ points + pose.translation[:, None]
    z = np.where(z > 0, z, 1.0)
    zero = np.zeros_like(z)
    along = np.array([[camera.fx / z, zero, -camera.fx * x / z**2], [zero, camera.fy / z, -camera.fy * y / z**2]])
    turning = np.cross(seen[None], along, axis=1)  # the derivative of equation (B16) at 0: omega x Y + offset
    jacobian = np.concatenate([turning, along * unit], axis=1)  # (2, 6, M)
    normal = np.einsum("aim,ajm,m->ij", jacobian, jacobian, weight)
    right = np.einsum("aim,am,m->i", jacobian, error, weight)
    damped = normal + np.diag(1e-9 * np.diag(normal) + 1e-12)
    step = -np.linalg.solve(damped, right)
    return np.concatenate([step[:3], step[3:] * unit])
