"""Image-space baselines: predictions of a held-out frame without a model.

Every evaluation reports six predictions, each from training frames only: the four below, and two that read tissue
alone (`tissue_baselines`).

temporal_mean      per-pixel mean over the training frames in which the pixel is tissue; 0 if it never is
nearest_frame      copy of the training frame nearest in time; of two, the earlier
two_neighbours     the training frames before and after, blended linearly in time; on the 7:1 split of evenly spaced
                   frames this is their mean, inside a held-out block it is a blend of the two border frames
flow_interpolation dense optical flow (DIS, medium) in both directions between the same two frames, each warped to
                   the target time and blended with the same weights

Excluded pixels: of these four, only the temporal mean uses the masks of the training frames; without them it would
average a passing instrument into the tissue. The other three use all training pixels, including the instrument, which
a reconstruction may not read. The metric sets the excluded pixels of the *test* frame to zero.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray

RenderFrame = Callable[[int], FloatArray]
MakeRenderer = Callable[[Sequence], RenderFrame]


class Neighbours(NamedTuple):
    """The training frames around a time. Before the first or after the last one, both are the same frame."""

    before: int  # frame index
    after: int  # frame index
    fraction: float  # position of the time between them, 0 = before, 1 = after

    @property
    def nearest(self) -> int:
        """The frame nearest in time; of two, the earlier."""
        return self.after if self.fraction > 0.5 + 1e-9 else self.before  # times i / n have rounding errors


def neighbours(sequence: Sequence, index: int) -> Neighbours:
    """The training frames before and after frame `index`, which is excluded, and the time fraction.

    Edges    with one neighbour, both are this frame and the fraction is 0; equal times: fraction 0.5
    Raises   InputError if there is no other training frame
    """
    train = np.asarray(sequence.train_index)
    earlier, later = train[train < index], train[train > index]
    if not earlier.size and not later.size:
        raise InputError(f"frame {index}: no training frame to predict it from")
    if not earlier.size or not later.size:
        only = int(later.min() if later.size else earlier.max())
        return Neighbours(only, only, 0.0)
    before, after = int(earlier.max()), int(later.min())
    start, end = float(sequence.times[before]), float(sequence.times[after])
    fraction = (float(sequence.times[index]) - start) / (end - start) if end > start else 0.5
    return Neighbours(before, after, fraction)


def unit(picture: NDArray[np.uint8]) -> FloatArray:
    """A picture as float32 in display units [0, 1]."""
    return picture.astype(np.float32) / np.float32(255)


def unit_image(sequence: Sequence, index: int) -> FloatArray:
    """Frame `index` as float32, (3, H, W), display units [0, 1], no mask applied."""
    return unit(sequence.images[index])


def temporal_mean(sequence: Sequence) -> FloatArray:
    """Mean of the training frames, each pixel over the frames in which it is tissue; 0 if it never is.

    returns   (3, H, W) float32, display units [0, 1]: the same prediction for every frame. The sums are integers, so
              the result does not depend on the order of the frames
    """
    total = np.zeros(sequence.images.shape[1:], np.int64)
    seen = np.zeros(sequence.images.shape[2:], np.int64)
    for i in sequence.train_index:
        total += np.where(sequence.masks[i], sequence.images[i], np.uint8(0))
        seen += sequence.masks[i]
    return (total / (255.0 * np.maximum(seen, 1))).astype(np.float32)


def nearest_frame(sequence: Sequence, index: int) -> FloatArray:
    """Copy of the training frame nearest in time; of two, the earlier. (3, H, W) float32 in [0, 1]."""
    return unit_image(sequence, neighbours(sequence, index).nearest)


def two_neighbours(sequence: Sequence, index: int) -> FloatArray:
    """(1 - s) before + s after with the time fraction s. (3, H, W) float32 in [0, 1]."""
    near = neighbours(sequence, index)
    return _blend(unit_image(sequence, near.before), unit_image(sequence, near.after), near.fraction)


def flow_interpolation(sequence: Sequence, index: int) -> FloatArray:
    """Both neighbours warped along the optical flow to the target time, then blended as in `two_neighbours`.

    With flows f (before -> after) and g (after -> before) and time fraction s, the prediction at pixel p is
    (1 - s) before(p - s f(p)) + s after(p - (1 - s) g(p)), bilinear, with repeated border pixels.

    returns   (3, H, W) float32, display units [0, 1]
    Edges     one neighbour: its copy; an image side below 16 px: the blend without flow
    """
    from endotsr.clips.opencv.flow import dense_flow, warp_bilinear

    near = neighbours(sequence, index)
    before, after = unit_image(sequence, near.before), unit_image(sequence, near.after)
    if near.before == near.after:
        return before
    a, b = sequence.images[near.before], sequence.images[near.after]
    moved_before = warp_bilinear(before, dense_flow(a, b) * np.float32(-near.fraction))
    moved_after = warp_bilinear(after, dense_flow(b, a) * np.float32(near.fraction - 1.0))
    return _blend(moved_before, moved_after, near.fraction)


def _blend(before: FloatArray, after: FloatArray, fraction: float) -> FloatArray:
    weight = before.dtype.type(fraction)
    return (before.dtype.type(1) - weight) * before + weight * after


def _temporal_mean_once(sequence: Sequence) -> RenderFrame:
    image = temporal_mean(sequence)
    return lambda index: image


BASELINES: dict[str, tuple[str, MakeRenderer]] = {
    "temporal_mean": ("Temporal mean of the training frames", _temporal_mean_once),
    "nearest_frame": ("Copy of the nearest training frame", lambda s: lambda i: nearest_frame(s, i)),
    "two_neighbours": ("Blend of the two neighbouring training frames", lambda s: lambda i: two_neighbours(s, i)),
    "flow_interpolation": ("Optical-flow interpolation (DIS)", lambda s: lambda i: flow_interpolation(s, i)),
}
"""Key in metrics.json -> (label, function sequence -> function frame number -> image)."""
