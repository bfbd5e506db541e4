"""Smoothness terms (B9): smooth depth on tissue away from edges, small total variation under the instruments.

    L = S(D) + f TV((1 - M) D) + f TV((1 - M) I)

S    sum over horizontal and vertical pairs of (D_a - D_b)^2 v_a v_b / (sum v + 1e-6), v = tissue and no edge
TV   sum over horizontal and vertical pairs of |x_a - x_b| / (C H W)

(1 - M) x stands for a selection, x where excluded and 0 on tissue, whatever x is there. Pairs across the mask border
are included: (1 - M) x is 0 on tissue, so the border is a step to zero with a gradient.
Edges are a boolean input: the edge detector is not differentiated. Depth is not normalised.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.losses.rows import check_image, check_plane, row_total

FEW_PIXELS = 1e-6  # added to sum v; S stays finite without valid pixels


class SmoothnessSaved(NamedTuple):
    """The inputs of the loss; the reverse pass recomputes the differences of the pairs."""

    rendered_depth: FloatArray  # (H, W)
    rendered: FloatArray  # (C, H, W)
    mask: BoolArray  # (H, W)
    smooth: BoolArray  # (H, W)  v: tissue and no edge
    total_variation_factor: float


class SmoothnessGrads(NamedTuple):
    """Derivatives of the loss with respect to its two differentiable inputs."""

    d_rendered: FloatArray  # (C, H, W)
    d_rendered_depth: FloatArray  # (H, W)


def smoothness_forward(
    rendered_depth: FloatArray,
    rendered: FloatArray,
    mask: BoolArray,
    edges: BoolArray,
    total_variation_factor: float,
) -> tuple[float, SmoothnessSaved]:
    """Smoothness loss (B9), squared steps of the depth and two total variations; see the module docstring.

    rendered_depth          (H, W)     scene units, as rendered
    rendered                (C, H, W)  display units, not clamped
    mask                    (H, W)     bool, True = tissue
    edges                   (H, W)     bool, True = an edge of the depth image, which is not smoothed
    total_variation_factor  f, 30 in SurgicalGS; 0 omits the two TV terms
    returns                 (loss, saved); summed in float64

    Reverse: `smoothness_reverse`; subgradient 0 where a TV pair is equal.
    Edges:   all tissue: TV is 0; no tissue: S is 0; one pixel: no pairs, 0.
    Raises:  ValueError if the shapes disagree or the mask is not boolean.
    Oracle:  `endotsr.definition.smoothness`; skimage's total variation is isotropic and not comparable.
    Source:  SurgicalGS's depth smoothness and masked total variation.
    """
    rendered = check_image("rendered", rendered, mask)
    depth = check_plane("rendered_depth", rendered_depth, mask.shape)
    smooth = mask & ~check_plane("edges", edges, mask.shape)
    mask = np.ascontiguousarray(mask)
    # if every pixel is tissue, the total variation and its gradient are exactly 0
    factor = 0.0 if mask.all() else float(total_variation_factor)
    saved = SmoothnessSaved(depth, rendered, mask, smooth, factor)
    loss = _squared_steps_kernel(depth, smooth) * _smooth_weight(smooth)
    if saved.total_variation_factor != 0:
        loss += saved.total_variation_factor * (_total_variation(depth[None], mask) + _total_variation(rendered, mask))
    return loss, saved


def smoothness_reverse(d_loss: float, saved: SmoothnessSaved) -> SmoothnessGrads:
    """Derivatives with respect to the rendered depth (both terms) and the rendered image (TV only)."""
    depth, rendered, factor = saved.rendered_depth, saved.rendered, saved.total_variation_factor
    new = np.empty_like if factor != 0 else np.zeros_like  # total variation writes every pixel
    d_depth, d_rendered = new(depth), new(rendered)
    if factor != 0:
        d_variation = float(d_loss) * factor
        for image, d_image in ((depth[None], d_depth[None]), (rendered, d_rendered)):
            weight = image.dtype.type(d_variation / image.size)
            parallel_for(_variation_reverse_kernel, image.shape[0] * image.shape[1], image, saved.mask, weight, d_image)
    twice = depth.dtype.type(2 * float(d_loss) * _smooth_weight(saved.smooth))
    _squared_steps_reverse_kernel(depth, saved.smooth, twice, d_depth)
    return SmoothnessGrads(d_rendered, d_depth)


def _smooth_weight(smooth: BoolArray) -> float:
    return 1.0 / (np.count_nonzero(smooth) + FEW_PIXELS)


def _total_variation(image: FloatArray, mask: BoolArray) -> float:
    """TV((1 - M) image), in the units of the image."""
    totals = np.empty(image.shape[0] * image.shape[1])
    parallel_for(_variation_kernel, totals.size, image, mask, totals)
    return float(totals.sum()) / image.size


def _variation(first, stop, image, mask, totals):
    """Sum of |step| to the right and downwards, per (channel, row)."""
    height, width = mask.shape
    scratch = np.empty((3, width), image.dtype)
    line, other, steps = scratch[0], scratch[1], scratch[2]
    for index in range(first, stop):
        channel, y = index // height, index % height
        _outside_tissue(image[channel, y], mask[y], line)
        steps[width - 1] = image.dtype.type(0)
        for i in range(width - 1):
            steps[i] = abs(line[i + 1] - line[i])
        if y + 1 < height:
            _outside_tissue(image[channel, y + 1], mask[y + 1], other)
            for i in range(width):
                steps[i] += abs(other[i] - line[i])
        totals[index] = row_total(steps)


def _variation_reverse(first, stop, image, mask, weight, d_image):
    """weight x (signs of the steps ending here - signs of the steps starting here) off tissue, 0 on tissue."""
    height, width = mask.shape
    zero = image.dtype.type(0)
    rows = np.empty((3, width + 2), image.dtype)  # one extra sample at each end
    above, line, below = rows[0], rows[1], rows[2]
    for index in range(first, stop):
        channel, y = index // height, index % height
        for k in range(3):
            near = min(max(y + k - 1, 0), height - 1)  # beyond the border: the pixel itself, a step of 0
            _outside_tissue(image[channel, near], mask[near], rows[k, 1:])
        line[0], line[width + 1] = line[1], line[width]
        out, tissue = d_image[channel, y], mask[y]
        for i in range(width):
            own = line[i + 1]
            slope = _sign(own - line[i]) + _sign(own - line[i + 2])
            slope += _sign(own - above[i + 1]) + _sign(own - below[i + 1])
            change = weight * slope
            out[i] = zero if tissue[i] else change


def _outside_tissue(row, tissue, out):
    for i in range(row.size):
        value = row[i]  # loaded unconditionally: the loop becomes one select per lane
        out[i] = row.dtype.type(0) if tissue[i] else value


def _sign(value):
    """-1, 0 or 1 in the type of `value`."""
    one, zero = type(value)(1), type(value)(0)
    return one if value > zero else (-one if value < zero else zero)


def _squared_steps(depth, smooth):
    """Sum over pairs of smooth neighbours of their squared difference."""
    height, width = depth.shape
    zero = depth.dtype.type(0)
    steps = np.zeros(width, depth.dtype)
    total = 0.0
    for y in range(height):
        row, use = depth[y], smooth[y]
        for i in range(width - 1):
            step = row[i + 1] - row[i]
            squared = step * step
            steps[i] = squared if use[i] & use[i + 1] else zero
        steps[width - 1] = zero
        if y + 1 < height:
            below, use_below = depth[y + 1], smooth[y + 1]
            for i in range(width):
                step = below[i] - row[i]
                squared = step * step
                steps[i] += squared if use[i] & use_below[i] else zero
        total += row_total(steps)
    return total


def _squared_steps_reverse(depth, smooth, twice, d_depth):
    """Adds twice x (sum over smooth neighbours of own depth - neighbour's depth)."""
    height, width = depth.shape
    zero = depth.dtype.type(0)
    for y in range(height):
        row, use, out = depth[y], smooth[y], d_depth[y]
        for i in range(width - 1):
            change = twice * (row[i] - row[i + 1])
            out[i] += change if use[i] & use[i + 1] else zero
        for i in range(width - 1):
            change = twice * (row[i + 1] - row[i])
            out[i + 1] += change if use[i] & use[i + 1] else zero
        for neighbour in range(y - 1, y + 2, 2):
            if 0 <= neighbour < height:
                other, use_other = depth[neighbour], smooth[neighbour]
                for i in range(width):
                    change = twice * (row[i] - other[i])
                    out[i] += change if use[i] & use_other[i] else zero


_outside_tissue, _sign = jit(_outside_tissue), jit(_sign)
_squared_steps_kernel = jit(_squared_steps)
_squared_steps_reverse_kernel = jit(_squared_steps_reverse)
_variation_kernel = jit(_variation)
_variation_reverse_kernel = jit(_variation_reverse)
