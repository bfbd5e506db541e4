"""Kernels of the projection, forward and reverse: the formulas of one Gaussian, applied to all in groups (`groups`).

A Gaussian behind the near plane is computed with z = 1, and in reverse any that is not drawn with z = 1 and
determinant 1. The results of all that are not drawn are set to zero.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.groups import GROUP, column, keep_where, write_group
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.vectors import local_array
from endotsr.method.splatting.projection_formulas import project_one, project_one_reverse

PROJECTED = 8  # results: mean 2, covariance 3, determinant, depth, whether it is drawn
WITHOUT_POSE, WITH_POSE = 15, 27  # gradients of position 3, scale 3, rotation 9; and of the pose 9 + 3
RESULTS, GRADIENTS = PROJECTED * GROUP, WITH_POSE * GROUP

_U64 = np.uint64  # unsigned: no index wraps around


class ScreenGrads(NamedTuple):
    """Gradients of the loss with respect to the projected Gaussians."""

    d_mean2d: FloatArray  # (2, N)
    d_footprint: FloatArray  # (3, N) with respect to A, m, r
    d_depth: FloatArray  # (N,)


def _project(first, stop, position, rotation, scale, lens, pose, rules, out, visible):
    """`out` (7, N): mean, covariance, determinant, depth; zero where not visible."""
    results = local_array(RESULTS, position)
    one, zero = position.dtype.type(1), position.dtype.type(0)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(count):
            i = start + item
            drawn, projected = project_one(
                column(position, 3, i), column(rotation, 9, i), column(scale, 3, i), lens, pose, rules
            )
            keep_where(drawn, results, item, projected + (one,))
        write_group(results, start, count, out)
        for item in range(count):
            visible[_U64(start + item)] = results[_U64((PROJECTED - 1) * GROUP + item)] > zero


def _project_reverse(first, stop, position, rotation, scale, lens, pose, rules, visible, determinant, d_screen, d_out):
    """`d_out` (15, N): gradients of position, scale, rotation; (27, N): also the terms of the pose gradient."""
    d_mean2d, d_footprint, d_depth = d_screen
    results = local_array(GRADIENTS, position)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(count):
            i = _U64(start + item)
            gradients = project_one_reverse(
                column(position, 3, i), column(rotation, 9, i), column(scale, 3, i), lens, pose, rules,
                visible[i], determinant[i], column(d_mean2d, 2, i), column(d_footprint, 3, i), d_depth[i],
            )  # fmt: skip
            keep_where(visible[i], results, item, gradients)
        write_group(results, start, count, d_out)


project_kernel, project_reverse_kernel = jit(_project), jit(_project_reverse)
