"""The moving Gaussians at key times, quantised for the viewer page.

In: a scene and its cameras. Out: 20 bytes per Gaussian and key time (position and log-scale 16 bits, rotation, colour
and opacity 8 bits), stored as differences between successive key times and compressed. The viewer interpolates between
key times. The colour of a Gaussian is evaluated in the direction of the observed camera, with exposure; the page has no
view-dependent colour.
"""

import zlib
from typing import NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.record import nearest_frame
from endotsr.method.equations.exposure import exposure_forward
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, camera_centre
from endotsr.method.splatting.covariance import LOG_SCALE_LIMIT
from endotsr.method.splatting.harmonics import harmonics_forward
from endotsr.results.export.scene import MovingScene
from endotsr.training.scene.parameters import exposure_at

LEVELS_16, LEVELS_8 = 65535, 255
ROTATION_LEVELS = 127  # largest level of a quaternion component, either sign
OPACITY_STEP = 1 / 255  # Gaussians with a lower opacity are left out: below the default alpha_cutoff
POSITION, LOG_SCALE, COLOUR = slice(0, 3), slice(3, 6), slice(6, 9)  # rows that are quantised within their range
COMPRESSION = 6  # level of zlib


class TrajectoryHeader(TypedDict):
    """What a page needs to unpack the paths of the points."""

    count: int
    times: list[float]
    low: list[float]
    high: list[float]


class Trajectories(NamedTuple):
    """N Gaussians at K key times, quantised."""

    times: FloatArray  # (K,) normalised, ascending
    words: NDArray[np.uint16]  # (6, K, N) position x y z, log-scale
    bytes: NDArray[np.uint8]  # (8, K, N) quaternion w x y z (two's complement), red, green, blue, opacity
    low: FloatArray  # (9,) position, log-scale and colour of level 0
    high: FloatArray  # (9,) the same for the largest level


def key_times(scene: MovingScene, most: int) -> FloatArray:
    """Key times: the frames' times and 1, or `most` evenly spaced ones if these are more.

    Spectral motion alone has `most` evenly spaced ones; a static scene has one, if neither an exposure of its frames
    nor the direction of a moving camera changes its colours.
    """
    times = np.unique(np.append(np.asarray(scene.record.times, np.float64), 1.0))
    gaussians, frames = scene.model.gaussians, scene.model.frames
    if gaussians.fdm_weight is None and gaussians.appearance_coefficients is None:
        if gaussians.motion_coefficients is not None:
            return np.linspace(0, 1, most)
        turning = not scene.record.static_camera and scene.model.config.model.harmonics_degree > 0
        if not turning and (frames is None or frames.exposure_log_gain is None):
            return times[:1]
    return times if times.size <= most else np.linspace(0, 1, most)


def trajectories(scene: MovingScene, times: FloatArray) -> Trajectories:
    """The visible Gaussians at the key times."""
    cameras, known = scene.cameras, scene.record.times
    opacity = 1 / (1 + np.exp(-scene.model.gaussians.opacity_logit.astype(np.float64)))
    seen = opacity >= OPACITY_STEP
    values = np.empty((9, times.size, np.count_nonzero(seen)), np.float32)
    rotation = np.empty((4, *values.shape[1:]), np.float32)
    for k, time in enumerate(times):
        camera = cameras[nearest_frame(known, float(time))]
        values[:, k], rotation[:, k] = _at_time(scene, float(time), camera, seen)
    ends = (values.min(axis=(1, 2)), values.max(axis=(1, 2))) if values.size else np.zeros((2, 9))  # none is visible
    low, high = (end.astype(np.float64) for end in ends)
    high = np.where(high > low, high, low + 1)
    levels = np.array([LEVELS_16] * 6 + [LEVELS_8] * 3)[:, None, None]
    rounded = np.rint((values - low[:, None, None]) / (high - low)[:, None, None] * levels)
    shown = np.broadcast_to(np.rint(opacity[seen] * LEVELS_8), (1, *values.shape[1:]))
    rest = np.concatenate([rotation_levels(rotation), rounded[COLOUR], shown]).astype(np.int16).astype(np.uint8)
    return Trajectories(times, rounded[:6].astype(np.uint16), rest, low, high)


def _at_time(scene: MovingScene, time: float, camera: Camera, seen: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Position, log-scale and colour (9, N), and unit quaternion (4, N), of the Gaussians with `seen`.

    As in (B2), a log-scale is clipped, and a quaternion of zeros is no rotation.
    """
    deformed, degree = scene.at(time), scene.model.config.model.harmonics_degree
    centre = camera_centre(camera)
    colour = harmonics_forward(deformed.harmonics, deformed.residual, deformed.position, centre, degree)[0]
    exposure = exposure_at(scene.model.frames, time)
    if exposure is not None:
        colour = exposure_forward(colour[:, None], exposure.log_gain, exposure.bias)[0][:, 0]
    log_scale = np.clip(deformed.log_scale, -LOG_SCALE_LIMIT, LOG_SCALE_LIMIT)
    values = np.concatenate([deformed.position, log_scale, colour])
    return values[:, seen], unit(deformed.quaternion)[:, seen]


def unit(quaternion: FloatArray) -> FloatArray:
    """Unit quaternions (4, N); that of zeros is 1, 0, 0, 0."""
    largest = np.abs(quaternion).max(axis=0, initial=0)
    scaled = np.where(largest > 0, quaternion / np.where(largest > 0, largest, 1), np.eye(4, 1))
    return scaled / np.linalg.norm(scaled, axis=0)


def rotation_levels(rotation: FloatArray) -> FloatArray:
    """Quaternions as integers up to ROTATION_LEVELS, with continuous signs: q and -q are the same rotation."""
    largest = np.abs(rotation).max(axis=0)
    levels = np.rint(rotation / np.where(largest > 0, largest, 1) * ROTATION_LEVELS)
    for k in range(1, levels.shape[1]):
        levels[:, k] *= np.where((levels[:, k] * levels[:, k - 1]).sum(axis=0) < 0, -1, 1)
    return levels


def packed(found: Trajectories) -> bytes:
    """The trajectories as compressed bytes: for each row the low bytes and, of words, the high bytes, (K, N) each.

    Each key time is stored as the difference to the previous one, modulo 256 or 65536; static values are zero.
    """
    planes = []
    for row in found.words:
        steps = np.diff(row, axis=0, prepend=np.zeros_like(row[:1]))
        planes += [(steps & 255).astype(np.uint8).tobytes(), (steps >> 8).astype(np.uint8).tobytes()]
    planes += [np.diff(row, axis=0, prepend=np.zeros_like(row[:1])).tobytes() for row in found.bytes]
    return zlib.compress(b"".join(planes), COMPRESSION)


def header(found: Trajectories) -> TrajectoryHeader:
    """The input of the page for unpacking the numbers."""
    return {
        "count": found.words.shape[2],
        "times": found.times.tolist(),
        "low": found.low.tolist(),
        "high": found.high.tolist(),
    }
