"""Flow of a rigid scene seen by a moving camera. Only the residual flow counts as tissue motion.

In: the poses and the flow of the tiles. Out: the flow of the best-fitting rigid scene, and the error of the measured
flow. The scene has one inverse depth rho per tile, fitted to all frames at once: a tile at x in the reference projects
to R_k x + rho t_k in frame k, where (R_k, t_k) maps the reference camera to camera k. The prior depth is not used:
between sparse points or at organ boundaries its error exceeds what the test tolerates. Motion that one depth explains
in every frame cannot be separated from depth.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.effects.frames import TILE, ReducedFrames, tile_means
from endotsr.clips.effects.noise import Noise
from endotsr.clips.effects.tracks import FlowTracks, normalised
from endotsr.clips.opencv.flow import dense_flow, warp_bilinear
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera

MARGIN = 8  # working pixels: the patch size of the flow, whose position is uncertain by as much near a border
ROUNDS = 5  # of the reweighted fit; weights change by a ratio of depths
NEAREST = 0.1  # smallest ratio of the depth in another frame to the depth in the reference


class Rigid(NamedTuple):
    """The best-fitting rigid scene and the error of the flow, in full-size pixels."""

    flow: FloatArray  # (m, 2, T)
    error: FloatArray  # (T,) round-trip error of the flow, RMS over the frames
    clear: BoolArray  # (T,) tiles at least `MARGIN` from excluded pixels and from the edge of the picture


def fit_rigid(clip: ReducedFrames, tracks: FlowTracks, noise: Noise) -> Rigid:
    """Fit an inverse depth to every tile, with the poses held fixed and without the prior depth."""
    height, width = clip.images.shape[2:]
    row, column = np.indices((height // TILE, width // TILE)).reshape(2, -1)
    place = (np.stack([column, row]) * TILE + 0.5 * TILE) * clip.shrink
    flow = predicted_flow(clip, place, inverse_depth(clip, place, tracks.tiles))
    return Rigid(flow, return_error(clip, tracks, noise), _clear_tiles(clip.masks[clip.reference]))


def predicted_flow(clip: ReducedFrames, place: FloatArray, inverse: FloatArray) -> FloatArray:
    """Flow (m, 2, T) of static points at image positions `place` (2, T) of the reference with inverse depth (T,)."""
    found = []
    for camera, (far, near) in zip(clip.cameras, _rays(clip, place)):
        x, y, z = far + inverse * near
        found.append(np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy]) - place)
    return np.array(found)


def inverse_depth(clip: ReducedFrames, place: FloatArray, tiles: FloatArray) -> FloatArray:
    """Inverse depth (T,) in the reference, 1 / scene units, that fits the flow of the tiles (m, 2, T) best.

    Least squares in pixels: f x - (u - c) z = 0 is linear in the inverse depth and is divided by z of the previous
    round. The result is at least 0 and at most the value at which another frame would see the point at a tenth of its
    depth.
    """
    seen = tiles + place
    inverse, largest = np.zeros(place.shape[1]), np.full(place.shape[1], np.inf)
    rays = _rays(clip, place)
    for far, near in rays:
        with np.errstate(divide="ignore", invalid="ignore"):
            largest = np.minimum(largest, np.where(near[2] < 0, (NEAREST - far[2]) / near[2], np.inf))
    for _ in range(ROUNDS):
        top, bottom = np.zeros_like(inverse), np.zeros_like(inverse)
        for camera, (far, near), (u, v) in zip(clip.cameras, rays, seen):
            z = far[2] + inverse * near[2]
            for focal, axis, offset in ((camera.fx, 0, u - camera.cx), (camera.fy, 1, v - camera.cy)):
                constant, slope = ((focal * part[axis] - offset * part[2]) / z for part in (far, near))
                known = np.isfinite(constant)
                top -= np.where(known, constant * slope, 0.0)
                bottom += np.where(known, slope**2, 0.0)
        inverse = np.clip(top / np.maximum(bottom, 1e-30), 0.0, np.maximum(largest, 0.0))
    return inverse


def return_error(clip: ReducedFrames, tracks: FlowTracks, noise: Noise) -> FloatArray:
    """|f(x) + b(x + f(x))| with the flow b back to the reference: mean over a tile, RMS over frames; (T,), pixels."""
    grey, mask, sigma = clip.luminance, clip.masks[clip.reference], float(noise.working.mean())
    squares = []
    for k in range(clip.count):
        if k == clip.reference:
            continue
        common, there = mask & clip.masks[k], tracks.flow[k] / np.float32(clip.shrink)
        start, end = normalised(grey[k], common, sigma), normalised(grey[clip.reference], common, sigma)
        back = warp_bilinear(dense_flow(start, end), there)
        squares.append(tile_means(np.hypot(*(there + back)), tracks.valid[k])[0] ** 2)
    known = np.isfinite(squares)
    total = np.where(known, squares, 0.0).sum(axis=0)
    return clip.shrink * np.sqrt(total / np.maximum(known.sum(axis=0), 1))


def _rays(clip: ReducedFrames, place: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """R_k x and t_k of every frame, (3, T) and (3, 1): a point of inverse depth rho lies along R_k x + rho t_k."""
    start = clip.cameras[clip.reference]
    x = np.stack([(place[0] - start.cx) / start.fx, (place[1] - start.cy) / start.fy, np.ones(place.shape[1])])
    return [(turn @ x, shift[:, None]) for turn, shift in (_from_to(start, other) for other in clip.cameras)]


def _from_to(start: Camera, other: Camera) -> tuple[FloatArray, FloatArray]:
    """Rotation and translation from one camera to another."""
    turn = other.rotation @ start.rotation.T
    return turn, other.translation - turn @ start.translation


def _clear_tiles(mask: BoolArray) -> BoolArray:
    from scipy.ndimage import minimum_filter

    inner = minimum_filter(mask, size=2 * MARGIN + 1, mode="constant", cval=False)
    return np.nan_to_num(tile_means(inner.astype(np.float64), np.ones_like(mask))[0]) == 1.0
