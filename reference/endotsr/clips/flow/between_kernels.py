"""The warps of `between`, compiled: the motion field, and tissue and depth moved along it.

Bitwise equal to the same steps with `warp_bilinear`, which tests/clips/flow compare: positions are float64 and
values float32, and nothing is contracted to a fused multiply-add. In: float32 planes. Out: float32 planes and masks.
Every row is a task, and no result depends on the number of threads.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.jit import jit, jit_inline
from endotsr.method.kernels.threads import parallel_for

STEPS = 3  # fixed-point steps for v_0 and v_1; for smooth flow, a fourth step changes under 0.05 px
WHOLE = 0.999  # bilinear weight above which all four neighbours are tissue, or have a prior depth


class MovedPriors(NamedTuple):
    """Tissue and prior depth of two frames, moved to a time between them."""

    seen: BoolArray  # (2, H, W) all four neighbours are tissue
    known: BoolArray  # (2, H, W) all four neighbours are tissue with a prior depth
    depth: FloatArray  # (2, H, W) scene units, bilinear


def _corners(x, y, width, height):
    """For a position: left, right, top, bottom pixel and the float32 weights of the right and bottom ones.

    A position outside the image is that of the nearest border pixel.
    """
    x, y = min(max(x, 0.0), np.float64(width - 1)), min(max(y, 0.0), np.float64(height - 1))
    left, top = np.intp(x), np.intp(y)  # truncation: positions are not negative
    left, top = min(max(left, 0), width - 1), min(max(top, 0), height - 1)  # a position that is NaN has a pixel too
    right, bottom = min(left + 1, width - 1), min(top + 1, height - 1)
    return left, right, top, bottom, np.float32(x - left), np.float32(y - top)


_corners_kernel = jit_inline(_corners)


def _mean_of_four(upper_left, upper_right, lower_left, lower_right, across, down):
    """Bilinear interpolation, in float32: first across, then down."""
    one = np.float32(1)
    upper = upper_left * (one - across) + upper_right * across
    lower = lower_left * (one - across) + lower_right * across
    return upper * (one - down) + lower * down


_mean_of_four_kernel = jit_inline(_mean_of_four)


def _step(flow, x, y):
    """(x, y) flow at a position."""
    l, r, t, b, across, down = _corners_kernel(x, y, flow.shape[2], flow.shape[1])
    moved_x = _mean_of_four_kernel(flow[0, t, l], flow[0, t, r], flow[0, b, l], flow[0, b, r], across, down)
    moved_y = _mean_of_four_kernel(flow[1, t, l], flow[1, t, r], flow[1, b, l], flow[1, b, r], across, down)
    return moved_x, moved_y


_step_kernel = jit_inline(_step)


def _field(first_row, last_row, forward, backward, a, b, field):
    """v of (18.5) in some rows; a and b are float32, a + b = 1."""
    for y in range(first_row, last_row):
        for x in range(field.shape[2]):
            ex, ey, lx, ly = forward[0, y, x], forward[1, y, x], -backward[0, y, x], -backward[1, y, x]
            for _ in range(STEPS):
                ex, ey = _step_kernel(forward, x + np.float64(-a * ex), y + np.float64(-a * ey))  # (18.2), (18.4)
                lx, ly = _step_kernel(backward, x + np.float64(b * lx), y + np.float64(b * ly))  # (18.3)
                lx, ly = -lx, -ly
            field[0, y, x], field[1, y, x] = b * ex + a * lx, b * ey + a * ly  # (18.5)


_field_kernel = jit(_field)


def _priors(first_row, last_row, tissue, depth, field, factors, seen, known, moved):
    """Tissue and depth of both frames in some rows, at x + factor v(x)."""
    height, width = moved.shape[1:]
    zero, one, whole = np.float32(0), np.float32(1), np.float32(WHOLE)
    for y in range(first_row, last_row):
        for k in range(2):
            mask, prior = tissue[k], depth[k]
            for x in range(width):
                at_x, at_y = x + np.float64(factors[k] * field[0, y, x]), y + np.float64(factors[k] * field[1, y, x])
                l, r, t, b, across, down = _corners_kernel(at_x, at_y, width, height)
                m0, m1, m2, m3 = mask[t, l], mask[t, r], mask[b, l], mask[b, r]
                d0, d1, d2, d3 = prior[t, l], prior[t, r], prior[b, l], prior[b, r]
                s0, s1, s2, s3 = (
                    (one if m0 else zero),
                    (one if m1 else zero),
                    (one if m2 else zero),
                    (one if m3 else zero),
                )
                seen[k, y, x] = _mean_of_four_kernel(s0, s1, s2, s3, across, down) > whole
                s0, s1 = (s0 if d0 > zero else zero), (s1 if d1 > zero else zero)
                s2, s3 = (s2 if d2 > zero else zero), (s3 if d3 > zero else zero)
                known[k, y, x] = _mean_of_four_kernel(s0, s1, s2, s3, across, down) > whole
                moved[k, y, x] = _mean_of_four_kernel(d0, d1, d2, d3, across, down)


_priors_kernel = jit(_priors)


def motion_field(forward: FloatArray, backward: FloatArray, fraction: float) -> FloatArray:
    """(2, H, W) float32 px: the field of `between.motion_between`, from flows (2, H, W) float32 px."""
    field = np.empty(forward.shape, np.float32)
    a, b = np.float32(fraction), np.float32(1.0 - fraction)
    parallel_for(_field_kernel, forward.shape[1], forward, backward, a, b, field)
    return field


def moved_priors(tissue: BoolArray, depth: FloatArray, field: FloatArray, factors: FloatArray) -> MovedPriors:
    """Tissue and prior depth of two frames at x + factor v(x).

    tissue   (2, H, W) bool;  depth   (2, H, W) float32 scene units, 0 = none
    field    v, (2, H, W) float32 px;  factors   (2,) float32, of each frame
    """
    out = MovedPriors(np.empty(depth.shape, bool), np.empty(depth.shape, bool), np.empty(depth.shape, np.float32))
    parallel_for(_priors_kernel, depth.shape[1], tissue, depth, field, factors, *out)
    return out
