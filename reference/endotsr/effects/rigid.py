"""Flow that a rigid scene shows to a moving camera, so that only the rest counts as motion of the tissue.

In: the poses and the flow of the tiles. Out: the flow of the rigid scene that fits best, and how wrong the flow itself
is. The scene has one inverse depth rho for every tile, fitted to all frames at once: the place x of the tile in the
reference is seen in frame k at the projection of R_k x + rho t_k, (R_k, t_k) from the reference camera to camera k.
Depth of the sequence is not used: between sparse points, or at the edge of an organ, it is wrong by more than a test
may allow. Motion that a change of depth explains in every frame cannot be told from it.
"""

from typing import NamedTuple

import numpy as np

from endotsr.effects.clip import TILE, Clip, tile_means
from endotsr.effects.noise import Noise
from endotsr.effects.tracks import FlowTracks, normalised
from endotsr.kernels.arrays import BoolArray, FloatArray
from endotsr.opencv import dense_flow, warp_bilinear
from endotsr.splatting.camera import Camera

MARGIN = 8  # working pixels: side of the patches of the flow, whose place is uncertain by as much beside a border
ROUNDS = 5  # of the reweighted fit; the weights change by the ratio of two depths
NEAREST = 0.1  # least depth in another frame over that in the reference


class Rigid(NamedTuple):
    """The rigid scene that fits the flow, and the error of the flow. Pixels of the full size."""

    flow: FloatArray  # (m, 2, T)
    error: FloatArray  # (T,) root mean square over the frames of the distance that flow to a frame and back misses by
    clear: BoolArray  # (T,) tiles at least `MARGIN` from excluded pixels and from the edge of the picture


def fit_rigid(clip: Clip, tracks: FlowTracks, noise: Noise) -> Rigid:
    """Fit an inverse depth to every tile; the poses stay as they are. Needs no depth."""
    height, width = clip.images.shape[2:]
    row, column = np.indices((height // TILE, width // TILE)).reshape(2, -1)
    place = (np.stack([column, row]) * TILE + 0.5 * TILE) * clip.shrink
    flow = predicted_flow(clip, place, inverse_depth(clip, place, tracks.tiles))
    return Rigid(flow, return_error(clip, tracks, noise), _clear_tiles(clip.masks[clip.reference]))


def predicted_flow(clip: Clip, place: FloatArray, inverse: FloatArray) -> FloatArray:
    """Flow (m, 2, T) of resting points at image positions `place` (2, T) of the reference, inverse depth (T,)."""
    found = []
    for camera, (far, near) in zip(clip.cameras, _rays(clip, place)):
        x, y, z = far + inverse * near
        found.append(np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy]) - place)
    return np.array(found)


def inverse_depth(clip: Clip, place: FloatArray, tiles: FloatArray) -> FloatArray:
    """Inverse depth (T,) in the reference, over scene units, that fits the flow of the tiles (m, 2, T) best.

    Least squares in pixels: f x - (u - c) z = 0 is linear in it, and is divided by z of the round before. It is at
    least 0, and at most that of a point which another frame sees at a tenth of its depth.
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


def return_error(clip: Clip, tracks: FlowTracks, noise: Noise) -> FloatArray:
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


def _rays(clip: Clip, place: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """R_k x and t_k of every frame, (3, T) and (3, 1): a point of inverse depth rho lies along R_k x + rho t_k."""
    start = clip.cameras[clip.reference]
    x = np.stack([(place[0] - start.cx) / start.fx, (place[1] - start.cy) / start.fy, np.ones(place.shape[1])])
    return [(turn @ x, shift[:, None]) for turn, shift in (_from_to(start, other) for other in clip.cameras)]


def _from_to(start: Camera, other: Camera) -> tuple[FloatArray, FloatArray]:
    """Rotation and translation from the axes of one camera to those of another."""
    turn = other.rotation @ start.rotation.T
    return turn, other.translation - turn @ start.translation


def _clear_tiles(mask: BoolArray) -> BoolArray:
    from scipy.ndimage import minimum_filter

    inner = minimum_filter(mask, size=2 * MARGIN + 1, mode="constant", cval=False)
    return np.nan_to_num(tile_means(inner.astype(np.float64), np.ones_like(mask))[0]) == 1.0
