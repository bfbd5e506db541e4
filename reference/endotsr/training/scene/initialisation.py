"""Initialisation, equation (B12): Gaussians on back-projected training pixels.

The first training frame k_0 contributes `first_frame_points` tissue pixels with depth. Every other training frame k
contributes up to int(other_frame_points / n) such pixels that are unseen in the first frame or whose depth has changed
by more than `motion_threshold`; n is the number of frames of the clip, held-out ones included. In clips beyond 150
frames only those with odd k - k_0 contribute; with the split `every_second` there is none. Held-out frames are never
read. Pixels of different frames are compared at equal image positions, following the published rule.

In: a `Sequence`. Out: `Gaussians`. This module is independent of the optimiser.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from endotsr.clips.flow.tracks import follow
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import InitialisationConfig, ModelConfig
from endotsr.errors import InputError
from endotsr.method.equations.dictionary import frequencies
from endotsr.method.equations.matern import matern_weights
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.camera import backproject
from endotsr.training.scene.gaussians import DEFORMATION_CHANNELS, Gaussians
from endotsr.training.scene.tracked_motion import with_tracked_motion

START_OPACITY = 0.1
SQUARED_DISTANCE_FLOOR = 1e-7  # scene units squared; duplicates and single points get this
NEIGHBOURS = 3
LONG_CLIP = 150  # frames; beyond it the frames at an odd distance from the first are visited


def initialise(
    sequence: Sequence,
    config: InitialisationConfig,
    model: ModelConfig,
    rng: np.random.Generator,
    dtype: DTypeLike = np.float32,
) -> Gaussians:
    """Gaussians at the start of training; of the residuals, only tracked motion is allocated.

    returns  positions on the pixels' rays at prior depth, colour of the pixel, opacity 0.1, unit quaternion,
             isotropic scale = root mean squared distance to the three nearest points; FDM weights 0;
             canonical positions and motion coefficients of the tracks (B15) if configured

    Edges:  fewer pixels than requested -> all pixels; fewer than four points -> mean over the existing neighbours;
            one point or duplicates -> the floor of the squared distance.
    Raises: InputError if no training pixel is tissue with depth.
    Draws:  one `rng.choice` without replacement per visited frame that has more pixels than requested.
    """
    return gaussians_of(sequence, training_points(sequence, config, rng), config, model, dtype)


def gaussians_of(
    sequence: Sequence,
    points: "TrainingPoints",
    config: InitialisationConfig,
    model: ModelConfig,
    dtype: DTypeLike = np.float32,
) -> Gaussians:
    """Gaussians on points of the training frames, with the tracked motion of the points (B15) if configured."""
    gaussians = gaussians_at(points.position, points.colour, model, dtype)
    if config.motion == "none" or not model.spectral_motion:
        return gaussians
    tracks = follow(sequence, points.start, points.position)
    times = sequence.times[sequence.train_index].astype(np.float64)
    omega = frequencies(model.frequencies, model.frequency_min, model.frequency_max)
    rho = matern_weights(omega, model.correlation_length)
    return with_tracked_motion(gaussians, times, tracks.position, tracks.followed, omega, rho)


class TrainingPoints(NamedTuple):
    """Pixels of training frames, lifted by their prior depth; float64."""

    position: FloatArray  # (3, N) scene units, world axes
    colour: FloatArray  # (3, N) display units [0, 1]
    start: NDArray[np.intp]  # (N,) position of the pixel's frame in `train_index`


def training_points(sequence: Sequence, config: InitialisationConfig, rng: np.random.Generator) -> TrainingPoints:
    """The drawn pixels of all visited frames, frame by frame."""
    train = [int(k) for k in sequence.train_index]
    if not train:
        raise InputError("sequence: no training frame to initialise from")
    first, count = train[0], sequence.count
    stride = 2 if count > LONG_CLIP else 1
    seen = _usable(sequence, first)
    drawn = [(first, _draw(seen, config.first_frame_points, rng))]
    for k in train[1:]:
        if (k - first - 1) % stride == 0:
            with np.errstate(invalid="ignore"):  # inf - inf: such pixels are excluded anyway
                moved = np.abs(sequence.depth[k] - sequence.depth[first]) > config.motion_threshold
            wanted = _usable(sequence, k) & (~seen | moved)
            drawn.append((k, _draw(wanted, config.other_frame_points // count, rng)))
    if not any(pixels.size for _, pixels in drawn):
        raise InputError("sequence: no pixel of the training frames is tissue with depth > 0; check masks and depth")
    points = [_lift(sequence, k, pixels) for k, pixels in drawn]
    position, colour = (np.concatenate(parts, axis=1) for parts in zip(*points))
    start = np.repeat([train.index(k) for k, _ in drawn], [pixels.size for _, pixels in drawn])
    return TrainingPoints(position, colour, start)


def _usable(sequence: Sequence, k: int) -> NDArray[np.bool_]:
    depth = sequence.depth[k]
    return sequence.masks[k] & (depth > 0) & np.isfinite(depth)


def _draw(wanted: NDArray[np.bool_], number: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Up to `number` flat indices of True pixels, ascending."""
    pixels = np.flatnonzero(wanted)
    return pixels if pixels.size <= number else np.sort(rng.choice(pixels, number, replace=False))


def _lift(sequence: Sequence, k: int, pixels: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    row, column = np.divmod(pixels, sequence.width)
    depth = sequence.depth[k, row, column].astype(np.float64)
    colour = sequence.images[k][:, row, column] / 255.0
    return backproject(sequence.cameras[k], column.astype(np.float64), row.astype(np.float64), depth), colour


def gaussians_at(position: FloatArray, colour: FloatArray, model: ModelConfig, dtype: DTypeLike) -> Gaussians:
    """Fresh Gaussians at given world positions (3, N) with display colours (3, N) in [0, 1]."""
    count = position.shape[1]
    real: Any = np.dtype(dtype).type
    quaternion = np.zeros((4, count), real)
    quaternion[0] = 1.0
    harmonics = np.zeros(((model.harmonics_degree + 1) ** 2, 3, count), real)
    harmonics[0] = (colour - 0.5) / Y00
    half_log = 0.5 * np.log(np.maximum(squared_neighbour_distance(position), SQUARED_DISTANCE_FLOOR))
    gaussians = Gaussians(
        position=np.ascontiguousarray(position, real),
        quaternion=quaternion,
        log_scale=np.tile(half_log.astype(real), (3, 1)),
        opacity_logit=np.full(count, np.log(START_OPACITY / (1.0 - START_OPACITY)), real),
        harmonics=harmonics,
    )
    if not model.deformation:
        return gaussians
    shape = (DEFORMATION_CHANNELS, model.bases, count)
    centre = np.broadcast_to(np.linspace(0.0, 1.0, model.bases)[:, None], shape)
    return gaussians._replace(
        fdm_weight=np.zeros(shape, real),
        fdm_centre=np.ascontiguousarray(centre, real),
        fdm_width=np.full(shape, model.initial_width, real),
    )


def squared_neighbour_distance(position: FloatArray) -> FloatArray:
    """Mean squared distance (N,) of every point (3, N) to its three nearest others; 0 where there is no other."""
    from scipy.spatial import KDTree

    points = np.ascontiguousarray(position.T, np.float64)
    others = min(NEIGHBOURS, len(points) - 1)
    if others < 1:
        return np.zeros(len(points))
    # The nearest of k + 1 is the point itself or a duplicate: distance 0 in both cases.
    distance = KDTree(points).query(points, k=others + 1)[0][:, 1:]
    return (distance**2).mean(axis=1)


def activate_residuals(gaussians: Gaussians, count: int, appearance: bool, spectral_motion: bool) -> Gaussians:
    """The same Gaussians with zero residual coefficients (3, 2 count, N) for the components that are on.

    With zero coefficients the render is bitwise unchanged. Existing arrays are kept.
    """
    shape = (3, 2 * count, gaussians.count)
    dtype = gaussians.position.dtype
    colour, motion = gaussians.appearance_coefficients, gaussians.motion_coefficients
    if appearance and colour is None:
        colour = np.zeros(shape, dtype)
    if spectral_motion and motion is None:
        motion = np.zeros(shape, dtype)
    return gaussians._replace(appearance_coefficients=colour, motion_coefficients=motion)
