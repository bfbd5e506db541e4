"""Normalised depth loss (B8): both depth images are divided by their largest value and compared over tissue.

The loss is therefore independent of the scale of the prior depth. The largest rendered depth is part of the loss, so
the gradient of the normalisation reaches the pixel with that depth.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.losses.rows import check_mask, check_plane, row_total

FEWEST_VALID = 10  # pixels with a prior; a frame with fewer has no depth loss


class DepthTarget(NamedTuple):
    """The part that depends on the frame only and may be cached between iterations."""

    normalised: FloatArray  # (H, W)  prior / largest prior of the image, 0 where there is none
    valid: BoolArray  # (H, W)  tissue with a finite prior > 0
    count: int  # valid pixels


class DepthSaved(NamedTuple):
    """Render, maximum and sum for the reverse pass."""

    rendered_depth: FloatArray  # (H, W)
    target: DepthTarget
    largest: float  # largest finite rendered depth, 0 = the loss is off
    signed_sum: float  # sum over valid pixels of sign(residual) x rendered depth


def depth_target(prior_depth: FloatArray, mask: BoolArray) -> DepthTarget:
    """Normalise the prior depth of a frame.

    prior_depth  (H, W)  scene units; 0, negative, NaN and Inf all mean "no depth"
    mask         (H, W)  bool, True = tissue
    The largest prior is the maximum over the whole image, instruments included, as in SurgicalGS.
    """
    check_mask(mask)
    prior_depth = check_plane("prior_depth", prior_depth, mask.shape)
    known = np.isfinite(prior_depth) & (prior_depth > 0)
    largest = np.max(prior_depth, where=known, initial=0)
    normalised = np.zeros_like(prior_depth)
    np.divide(prior_depth, largest, out=normalised, where=known)
    valid = known & mask
    return DepthTarget(normalised, valid, int(np.count_nonzero(valid)))


def normalised_depth_forward(rendered_depth: FloatArray, target: DepthTarget) -> tuple[float, DepthSaved]:
    """Normalised depth loss (B8): mean over valid pixels of |rendered / max rendered - prior / max prior|.

    rendered_depth  (H, W)  scene units; the maximum is over the whole image
    target          of `depth_target`
    returns         (loss, dimensionless, summed in float64; saved)

    Reverse: `normalised_depth_reverse`.
    Edges:   fewer than 10 valid pixels, or a render without positive depth: loss 0, gradient 0.
             Non-finite values are excluded from the maximum.
    Raises:  ValueError if the shapes disagree.
    Oracle:  `endotsr.definition.depth`.
    Source:  SurgicalGS's depth loss.
    """
    rendered_depth = check_plane("rendered_depth", rendered_depth, target.valid.shape)
    largest = _largest_finite(rendered_depth) if target.count >= FEWEST_VALID else 0.0
    if largest <= 0:
        return 0.0, DepthSaved(rendered_depth, target, 0.0, 0.0)
    normalised = target.normalised.astype(rendered_depth.dtype, copy=False)
    peak = rendered_depth.dtype.type(largest)
    total, signed_sum = _residual_kernel(rendered_depth, normalised, target.valid, peak)
    return total / target.count, DepthSaved(rendered_depth, target, largest, signed_sum)


def normalised_depth_reverse(d_loss: float, saved: DepthSaved) -> FloatArray:
    """d_rendered_depth (H, W).

    With r the residual, m the largest rendered depth and n the number of valid pixels:  sign(r) / (n m) at valid pixels
    (0 at r = 0), and  -sum(sign(r) rendered) / (n m^2)  at the pixel of depth m, divided equally between ties.
    """
    depth, target = saved.rendered_depth, saved.target
    d_depth = np.zeros_like(depth)
    if saved.largest > 0:
        real = depth.dtype.type
        normalised = target.normalised.astype(depth.dtype, copy=False)
        peak = real(saved.largest)
        ties = int(np.count_nonzero(depth == peak))
        step = float(d_loss) / (target.count * saved.largest)
        d_largest = -step * saved.signed_sum / saved.largest
        _residual_reverse_kernel(depth, normalised, target.valid, peak, real(step), real(d_largest / ties), d_depth)
    return d_depth


def _largest_finite(depth: FloatArray) -> float:
    largest = depth.max()
    if not np.isfinite(largest):
        largest = np.max(depth, where=np.isfinite(depth), initial=0)
    return float(largest)


def _residual(depth, normalised, valid, peak):
    """Sum of |residual| and of sign(residual) x depth over valid pixels."""
    height, width = depth.shape
    zero = depth.dtype.type(0)
    total, signed_sum = 0.0, 0.0
    size, signed = np.empty(width, depth.dtype), np.empty(width, depth.dtype)
    for y in range(height):
        row, wanted, use = depth[y], normalised[y], valid[y]
        for i in range(width):
            residual = row[i] / peak - wanted[i]
            with_sign = row[i] if residual > zero else (-row[i] if residual < zero else zero)
            size[i] = abs(residual) if use[i] else zero
            signed[i] = with_sign if use[i] else zero
        total += row_total(size)
        signed_sum += row_total(signed)
    return total, signed_sum


def _residual_reverse(depth, normalised, valid, peak, step, d_peak, d_depth):
    height, width = depth.shape
    zero = depth.dtype.type(0)
    for y in range(height):
        row, wanted, use, out = depth[y], normalised[y], valid[y], d_depth[y]
        for i in range(width):
            residual = row[i] / peak - wanted[i]
            slope = step if residual > zero else (-step if residual < zero else zero)
            out[i] = (slope if use[i] else zero) + (d_peak if row[i] == peak else zero)


_residual_kernel = jit(_residual)
_residual_reverse_kernel = jit(_residual_reverse)
