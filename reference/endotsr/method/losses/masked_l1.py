"""Masked L1 between the render and the observed frame (B6): the mean absolute difference over tissue.

In: planar images (C, H, W) and the tissue mask. Out: a scalar and its derivative with respect to the render. The
difference is selected, not multiplied, by the mask: values under an instrument, NaN included, have no effect.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.losses.rows import check_image, row_total


class MaskedL1Saved(NamedTuple):
    """The inputs of the loss; the reverse pass recomputes the sign of the difference."""

    rendered: FloatArray  # (C, H, W)
    observed: FloatArray  # (C, H, W)
    mask: BoolArray  # (H, W)
    count: int  # C x tissue pixels


def masked_l1_forward(rendered: FloatArray, observed: FloatArray, mask: BoolArray) -> tuple[float, MaskedL1Saved]:
    """Masked L1 loss (B6): sum over channels and tissue pixels of |rendered - observed| / (C x tissue pixels).

    rendered  (C, H, W)  display units, not clamped
    observed  (C, H, W)  display units [0, 1]
    mask      (H, W)     bool, True = tissue
    returns   (loss, saved); the loss is a float summed in float64

    Reverse: `masked_l1_reverse`.
    Edges:   no tissue: loss 0, gradient 0. Values where the mask is False have no effect (NaN, Inf allowed).
    Raises:  ValueError if the shapes disagree or the mask is not boolean.
    Oracle:  `endotsr.definition.masked_l1`; numpy mean of the selected differences.
    """
    rendered = check_image("rendered", rendered, mask)
    observed = check_image("observed", observed, mask).astype(rendered.dtype, copy=False)
    if observed.shape != rendered.shape:
        raise ValueError(f"observed has shape {observed.shape}; expected {rendered.shape}")
    mask = np.ascontiguousarray(mask)
    saved = MaskedL1Saved(rendered, observed, mask, rendered.shape[0] * int(np.count_nonzero(mask)))
    if saved.count == 0:
        return 0.0, saved
    totals = np.empty(rendered.shape[0] * rendered.shape[1])
    parallel_for(_absolute_difference_kernel, totals.size, rendered, observed, mask, totals)
    return float(totals.sum()) / saved.count, saved


def masked_l1_reverse(d_loss: float, saved: MaskedL1Saved) -> FloatArray:
    """d_rendered (C, H, W): d_loss x sign(rendered - observed) / count on tissue, 0 elsewhere and at equality."""
    if saved.count == 0:
        return np.zeros_like(saved.rendered)
    d_rendered = np.empty_like(saved.rendered)
    step = saved.rendered.dtype.type(float(d_loss) / saved.count)
    rows = d_rendered.shape[0] * d_rendered.shape[1]
    parallel_for(_sign_kernel, rows, saved.rendered, saved.observed, saved.mask, step, d_rendered)
    return d_rendered


def _absolute_difference(first, stop, rendered, observed, mask, totals):
    height, width = mask.shape
    zero = rendered.dtype.type(0)
    line = np.empty(width, rendered.dtype)
    for index in range(first, stop):
        channel, y = index // height, index % height
        seen, wanted, tissue = rendered[channel, y], observed[channel, y], mask[y]
        for i in range(width):
            line[i] = abs(seen[i] - wanted[i]) if tissue[i] else zero
        totals[index] = row_total(line)


def _sign(first, stop, rendered, observed, mask, step, d_rendered):
    height, width = mask.shape
    zero = rendered.dtype.type(0)
    for index in range(first, stop):
        channel, y = index // height, index % height
        seen, wanted, tissue = rendered[channel, y], observed[channel, y], mask[y]
        out = d_rendered[channel, y]
        for i in range(width):
            difference = seen[i] - wanted[i]
            slope = step if difference > zero else (-step if difference < zero else zero)
            out[i] = slope if tissue[i] else zero


_absolute_difference_kernel = jit(_absolute_difference)
_sign_kernel = jit(_sign)
