"""Image motion from the reference frame to every training frame, and the flow caused by noise alone.

The pictures are first normalised by local brightness and contrast, which removes changes of light. Pixels excluded by
either mask get the same value in both. Flow is dense inverse search (OpenCV). The simulated null is the flow between
the reference frame and copies of it with fresh noise. Its size in a tile is the smallest motion that the texture of the
tile can reveal.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.effects.frames import ReducedFrames, tile_means
from endotsr.clips.effects.noise import Noise
from endotsr.clips.opencv.flow import dense_flow, warp_bilinear
from endotsr.method.kernels.arrays import BoolArray, FloatArray

LOCAL = 6.0  # Gaussian radius of the local brightness and contrast, working pixels
GREY_STEPS = 40.0  # grey levels per standard deviation of the local contrast
NULL_SEED = 20
MOST_NULL = 16  # copies of the reference frame
VISIBLE_FRAMES = 0.6  # minimum fraction of frames in which a usable tile is tissue


class FlowTracks(NamedTuple):
    """Flow from the reference frame to the m training frames, in full-size pixels."""

    flow: NDArray[np.float32]  # (m, 2, h, w) on the working grid
    valid: BoolArray  # (m, h, w) tissue in the reference and, at the end of the flow, in the frame
    tiles: FloatArray  # (m, 2, T) mean flow of a tile; NaN where it is not visible
    usable: BoolArray  # (T,) tiles visible in enough frames
    null: FloatArray  # (T,) RMS of the flow caused by noise alone
    aligned: NDArray[np.float32]  # (m, 3, h, w) the frames warped onto the reference, display units


class Match(NamedTuple):
    """Two frames, and the flow from the first to the second, on the working grid."""

    start: NDArray[np.uint8]  # (h, w) `normalised`
    end: NDArray[np.uint8]  # (h, w)
    flow: NDArray[np.float32]  # (2, h, w) working pixels; exactly 0 from a frame to itself
    seen: BoolArray  # (h, w) tissue in the first and, at the end of the flow, in the second


def matched(clip: ReducedFrames, grey: FloatArray, start: int, end: int, sigma: float) -> Match:
    """The flow between training frames number `start` and `end`. grey: luminance of the clip (m, h, w)."""
    common = clip.masks[start] & clip.masks[end]
    before, after = (normalised(grey[k], common, sigma) for k in (start, end))
    flow = np.zeros((2, *common.shape), np.float32) if start == end else dense_flow(before, after)
    seen = common & inside(flow) & (warp_bilinear(clip.masks[end].astype(np.float32), flow) > 0.999)
    return Match(before, after, flow, seen)


def make_tracks(clip: ReducedFrames, noise: Noise) -> FlowTracks:
    """Flow, its mean in tiles, its null, and the aligned frames."""
    sigma, grey = float(noise.working.mean()), clip.luminance
    flow, valid, tiles, aligned = [], [], [], []
    for k in range(clip.count):
        match = matched(clip, grey, clip.reference, k, sigma)
        flow.append(match.flow * clip.shrink)
        valid.append(match.seen)
        tiles.append(tile_means(flow[-1], match.seen)[0])
        aligned.append(warp_bilinear(clip.images[k], match.flow).astype(np.float32))
    copies = min(MOST_NULL, clip.count)
    null = noise_flow(grey[clip.reference], clip.masks[clip.reference], sigma, copies) * clip.shrink
    stacked = np.array(tiles)
    usable = _usable(stacked, null, clip.count)
    return FlowTracks(np.array(flow), np.array(valid), stacked, usable, null, np.array(aligned))


def without_frames(tracks: FlowTracks, spoiled: BoolArray) -> FlowTracks:
    """The tracks without the spoiled frames (m,). Tiles that too few of the other frames see become unusable."""
    tiles = np.where(spoiled[:, None, None], np.nan, tracks.tiles)
    return tracks._replace(tiles=tiles, usable=_usable(tiles, tracks.null, max(int((~spoiled).sum()), 1)))


def _usable(tiles: FloatArray, null: FloatArray, count: int) -> BoolArray:
    """Tiles (T,) that are visible in enough of `count` frames and have a known null."""
    return (np.isfinite(tiles[:, 0]).sum(axis=0) / count >= VISIBLE_FRAMES) & np.isfinite(null)


def inside(flow: FloatArray) -> BoolArray:
    """(h, w) True where the flow (2, h, w) ends inside the picture."""
    height, width = flow.shape[1:]
    x, y = np.arange(width) + flow[0], np.arange(height)[:, None] + flow[1]
    return (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)


def normalised(grey: FloatArray, mask: BoolArray, sigma: float) -> NDArray[np.uint8]:
    """(grey - local mean) / local deviation over tissue, as 128 + 40 grey levels per deviation; 128 elsewhere."""
    from scipy.ndimage import gaussian_filter

    weight = mask.astype(np.float32)
    total = np.maximum(gaussian_filter(weight, LOCAL), 1e-3)
    centred = (grey - gaussian_filter(grey * weight, LOCAL) / total) * weight
    variance = gaussian_filter(centred**2, LOCAL) / total
    scaled = centred / np.sqrt(variance + max(2 * sigma, 2 / 255) ** 2)
    return np.clip(np.rint(128 + GREY_STEPS * scaled), 0, 255).astype(np.uint8)


def noise_flow(grey: FloatArray, mask: BoolArray, sigma: float, copies: int) -> FloatArray:
    """RMS per tile (T,) of the mean flow to copies with fresh noise, working pixels; NaN off tissue."""
    rng = np.random.default_rng(NULL_SEED)
    start, squares = normalised(grey, mask, sigma), []
    for _ in range(copies):
        copy = grey + (2**0.5 * sigma * rng.standard_normal(grey.shape)).astype(np.float32)
        means, _ = tile_means(dense_flow(start, normalised(copy, mask, sigma)), mask)
        squares.append((means**2).sum(axis=0))
    return np.sqrt(np.mean(squares, axis=0))
