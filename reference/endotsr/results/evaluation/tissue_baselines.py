"""Interpolation that obeys the masks: predictions of a held-out frame from tissue pixels of training frames alone.

The baselines `two_neighbours` and `flow_interpolation` read every pixel of the neighbouring frames, those of
instruments included, and paste them into the picture. The two predictions of this module read what a reconstruction
reads:

blend_tissue   at a pixel, the neighbours in which it is tissue, blended with the weights of `two_neighbours`, which are
               normalised to the neighbours that are left; where neither is, the training frame nearest in time in which
               the pixel is tissue
flow_tissue    flow in both directions between the neighbours, computed on filled pictures; each neighbour is warped to
               the target time with its mask, and counts where all four pixels of the bilinear kernel are tissue; then
               as `blend_tissue`

A filled picture has, in its excluded pixels, the training frame nearest in time to it in which the pixel is tissue; 0
where no training frame is. Of two equally near frames, the earlier is taken. Specification: metrics, *Baselines*.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.flow.tissue_colours import by_nearness, fill_from
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.results.evaluation.baselines import MakeRenderer, neighbours, unit, unit_image

WHOLE = 0.999  # bilinear weight of tissue above which all four pixels are tissue, as in `between`


def nearest_tissue(sequence: Sequence, time: float) -> NDArray[np.uint8]:
    """At every pixel, the training frame nearest in time in which it is tissue; 0 where none is. (3, H, W) uint8."""
    height, width = sequence.masks.shape[1:]
    colours = np.zeros((3, height * width), np.uint8)
    fill_from(sequence, by_nearness(sequence, time), colours, np.arange(height * width))
    return colours.reshape(3, height, width)


def filled_picture(sequence: Sequence, index: int) -> NDArray[np.uint8]:
    """Training picture `index` (3, H, W) with its excluded pixels taken from `nearest_tissue` at its own time.

    The frame itself is the nearest one, so that its tissue stays as it is.
    """
    return nearest_tissue(sequence, float(sequence.times[index]))


def blend_tissue(sequence: Sequence, index: int) -> FloatArray:
    """Both neighbours blended in time where they are tissue, else the nearest tissue. (3, H, W) float32 in [0, 1].

    Raises   InputError if there is no other training frame
    """
    near = neighbours(sequence, index)
    pair = np.stack([unit_image(sequence, near.before), unit_image(sequence, near.after)])
    usable = np.stack([sequence.masks[near.before], sequence.masks[near.after]])
    return _blended(pair, usable, near.fraction, _rest(sequence, index))


def flow_tissue(sequence: Sequence, index: int) -> FloatArray:
    """Both neighbours warped along the flow between filled pictures, blended where their tissue arrives.

    returns   (3, H, W) float32, display units [0, 1]
    Edges     one neighbour, or an image side below 16 px: as `blend_tissue`
    Raises    InputError if there is no other training frame
    """
    from endotsr.clips.opencv.flow import dense_flow, warp_bilinear

    near = neighbours(sequence, index)
    if near.before == near.after:
        return blend_tissue(sequence, index)
    a, b = filled_picture(sequence, near.before), filled_picture(sequence, near.after)
    places = (dense_flow(a, b) * np.float32(-near.fraction), dense_flow(b, a) * np.float32(near.fraction - 1.0))
    # The filled pictures are warped: in the given ones, a bilinear weight below 1 - WHOLE would read an excluded pixel.
    pair = np.stack([warp_bilinear(unit(picture), place) for picture, place in zip((a, b), places)])
    masks = (sequence.masks[k].astype(np.float32) for k in (near.before, near.after))
    tissue = [warp_bilinear(mask, place) for mask, place in zip(masks, places)]
    return _blended(pair, np.stack(tissue) > WHOLE, near.fraction, _rest(sequence, index))


def _rest(sequence: Sequence, index: int) -> FloatArray:
    """`nearest_tissue` at the time of a frame, (3, H, W) float32 in [0, 1]."""
    return unit(nearest_tissue(sequence, float(sequence.times[index])))


def _blended(pair: FloatArray, usable: BoolArray, fraction: float, rest: FloatArray) -> FloatArray:
    """The usable pictures (2, 3, H, W) with weights 1 - s and s, normalised to those that are usable; else `rest`."""
    weights = np.array([1.0 - fraction, fraction], np.float32)[:, None, None] * usable
    total = weights.sum(axis=0)
    only = usable.any(axis=0) & (total == 0)  # usable, but at the very time of the other frame
    weights, total = np.where(only, usable, weights), np.where(only, usable.sum(axis=0), total)
    blended = (weights[:, None] * pair).sum(axis=0) / np.where(total > 0, total, np.float32(1))
    return np.where(total > 0, blended, rest).astype(np.float32)


TISSUE_BASELINES: dict[str, tuple[str, MakeRenderer]] = {
    "two_neighbours_tissue": (
        "Blend of the two neighbouring training frames, tissue only",
        lambda s: lambda i: blend_tissue(s, i),
    ),
    "flow_interpolation_tissue": (
        "Optical-flow interpolation (DIS), tissue only",
        lambda s: lambda i: flow_tissue(s, i),
    ),
}
"""Key in metrics.json -> (label, function sequence -> function frame number -> image)."""
