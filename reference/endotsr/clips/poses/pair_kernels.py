"""Kernels of the direct bundle adjustment: robust scale and normal equations of every pair of frames.

A pair is a task and writes to its own cells, so results do not depend on the number of threads. The residual is that of
equation (B19); its derivative by the six numbers of equation (B16) at zero is [Y x g, g], with the slope g at the point
Y in target axes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.splatting.registration import move_point, register_point

TUKEY, MAD = 4.685, 1.4826  # 95 % efficiency; standard deviation over median absolute deviation
SUMS = 30  # 21 entries of the upper triangle, 6 of the right side, cost, sum of the weights, points seen
RIGHT, COST, WEIGHT, SEEN = 21, 27, 28, 29


class PyramidLevel(NamedTuple):
    """All frames at one size h x w. Points of frame i are the columns first[i] ... first[i + 1] - 1."""

    pictures: NDArray[np.float32]  # (n, h, w) local standard deviations
    usable: BoolArray  # (n, h, w)
    first: NDArray[np.intp]  # (n + 1,)
    points: FloatArray  # (3, P) in the axes of their camera, scene units
    values: FloatArray  # (P,) of the picture at the points
    lens: FloatArray  # (4,) fx, fy, cx, cy at this size


def _residual(level, target, pose, k):
    """Whether the target frame shows point k on usable pixels; its residual, slope and place in target axes."""
    x, y, z = move_point(pose[:, :3], pose[:, 3], level.points[0, k], level.points[1, k], level.points[2, k])
    seen, value, g0, g1, g2 = register_point(x, y, z, level.lens, level.pictures[target])
    if seen:
        column = int(level.lens[0] * x / z + level.lens[2])
        row = int(level.lens[1] * y / z + level.lens[3])
        seen = level.usable[target, row, column]
    return seen, value - level.values[k], g0, g1, g2, x, y, z


_residual = jit(_residual)


def _scale(first, stop, level, pairs, poses, floor, scale, seen):
    """Robust standard deviation of the residuals of a pair, and the number of its points that are seen."""
    for pair in range(first, stop):
        source, target = pairs[pair, 0], pairs[pair, 1]
        begin, end = level.first[source], level.first[source + 1]
        found = np.empty(end - begin)
        count = 0
        for k in range(begin, end):
            here = _residual(level, target, poses[pair], k)
            if here[0]:
                found[count] = abs(here[1])
                count += 1
        seen[pair] = count
        scale[pair] = max(floor, MAD * np.median(found[:count])) if count else floor


def _sums(first, stop, level, pairs, poses, scale, out):
    """Normal equations of a pair, with Tukey's weights; a point that is not seen costs as much as an outlier."""
    for pair in range(first, stop):
        source, target = pairs[pair, 0], pairs[pair, 1]
        width = TUKEY * scale[pair]
        total = np.zeros(SUMS)
        row = np.empty(6)
        for k in range(level.first[source], level.first[source + 1]):
            seen, r, g0, g1, g2, x, y, z = _residual(level, target, poses[pair], k)
            ratio = abs(r) / width
            if not seen or ratio >= 1:
                total[COST] += TUKEY**2 / 6
                total[SEEN] += seen
                continue
            rest = 1 - ratio**2
            weight = rest**2
            total[COST] += TUKEY**2 / 6 * (1 - rest**3)
            total[WEIGHT] += weight
            total[SEEN] += 1
            row[0], row[1], row[2] = y * g2 - z * g1, z * g0 - x * g2, x * g1 - y * g0  # (22.5)
            row[3], row[4], row[5] = g0, g1, g2
            weight /= scale[pair] ** 2
            entry = 0
            for a in range(6):
                for b in range(a, 6):
                    total[entry] += weight * row[a] * row[b]
                    entry += 1
                total[RIGHT + a] += weight * row[a] * r
        out[pair] = total


scale_kernel, sums_kernel = jit(_scale), jit(_sums)
