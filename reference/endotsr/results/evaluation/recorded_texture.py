"""A render between two training frames, with the texture that they record and the model lacks.

With the render R at a time, and the renders R_k of the model at the training times before and after it,

    D_k(x) = I_k(x) - R_k(x) on tissue, 0 elsewhere           w_k = flow from R to R_k
    J(x) = R(x) + sum_k c_k v_k(x) D_k(x + w_k(x)) / sum_k c_k v_k(x)

where c_k are the weights of the two neighbours (metrics, *Baselines*), and v_k(x) is 1 where the four pixels of the
bilinear kernel at x + w_k(x) are tissue of frame k, else 0. Where no v_k is 1, J = R. The flow is computed between
renders: there is one at the wanted time, and no loss fits them to an instrument that the masks exclude. No excluded
colour is read here; whether the training read one depends on its preset.

In: a sequence, and the renders of a model as a function of the frame number. Out: the picture J. Specification:
metrics, *Recorded texture*.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.baselines import Neighbours, RenderFrame, neighbours, unit_image
from endotsr.results.evaluation.tissue_baselines import WHOLE


def with_recorded_texture(sequence: Sequence, index: int, render: RenderFrame) -> FloatArray:
    """The render of a frame that is not trained on, with the texture of its neighbours among the training frames.

    render   frame number -> (3, H, W) display units
    returns  (3, H, W) float32 in [0, 1]

    Edges:   one neighbour: its texture alone; an image side below 16 px: no flow.
    Raises:  InputError if there is no training frame
    """
    return textured(sequence, neighbours(sequence, index), render(index), render)


def around(sequence: Sequence, time: float) -> Neighbours:
    """The training frames at or before a time and after it, as `neighbours` of a frame; `time` in [0, 1].

    Edges:   at the time of a training frame, the fraction is 0 and this frame the earlier one; before the first and
             from the last one on, both are that frame.
    """
    train = np.asarray(sequence.train_index)
    times = np.asarray(sequence.times)[train]
    after = int(np.searchsorted(times, time, side="right"))
    if after in (0, len(train)):
        only = int(train[min(after, len(train) - 1)])
        return Neighbours(only, only, 0.0)
    before = after - 1
    return Neighbours(int(train[before]), int(train[after]), (time - times[before]) / (times[after] - times[before]))


def textured(sequence: Sequence, near: Neighbours, picture: FloatArray, render: RenderFrame) -> FloatArray:
    """A render (3, H, W) at a time and camera of the recording, with the texture of two training frames.

    near     the training frames around that time
    render   as in `with_recorded_texture`; called for the two frames alone
    """
    shown = np.clip(picture, 0, 1).astype(np.float32)
    total, weights = np.zeros_like(shown), np.zeros(shown.shape[1:], np.float32)
    for index, weight in ((near.before, 1.0 - near.fraction), (near.after, near.fraction)):
        texture, usable = _moved_texture(sequence, index, np.clip(render(index), 0, 1).astype(np.float32), shown)
        total += np.float32(weight) * np.where(usable, texture, np.float32(0))
        weights += np.float32(weight) * usable
    return np.clip(shown + total / np.where(weights > 0, weights, np.float32(1)), 0, 1)


def _moved_texture(
    sequence: Sequence, index: int, own: FloatArray, shown: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """D_k (3, H, W) at the position where the picture `shown` has it, and v_k (H, W); `own` is R_k."""
    from endotsr.clips.opencv.flow import dense_flow, warp_bilinear, warp_cubic

    tissue = sequence.masks[index]
    texture = np.where(tissue, unit_image(sequence, index) - own, np.float32(0))
    flow = dense_flow(_bytes(shown), _bytes(own))
    return warp_cubic(texture, flow), warp_bilinear(tissue.astype(np.float32), flow) > WHOLE


def _bytes(picture: FloatArray) -> NDArray[np.uint8]:
    return (picture * np.float32(255)).round().astype(np.uint8)
