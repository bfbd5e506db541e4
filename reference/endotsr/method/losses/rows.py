"""Helpers of the image losses: the sum over a row, and the checks of shapes and masks.

A loss is a sum over (channel, row) of float64 row totals. Each row is summed in a fixed order, and one thread adds the
row totals, so a loss is bitwise reproducible for any number of threads.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import BoolArray
from endotsr.method.kernels.jit import jit


def _row_total(row):
    """Sum of a row in float64, in a fixed order; four running sums hide the latency of the addition."""
    first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
    whole = row.size - row.size % 4
    for i in range(0, whole, 4):
        first += row[i]
        second += row[i + 1]
        third += row[i + 2]
        fourth += row[i + 3]
    for i in range(whole, row.size):
        first += row[i]
    return (first + second) + (third + fourth)


row_total = jit(_row_total)


def check_image(name: str, image: NDArray, mask: BoolArray) -> NDArray:
    """`image` (C, H, W) as a contiguous array. Raises ValueError unless H, W match the boolean mask."""
    check_mask(mask)
    if image.ndim != 3 or image.shape[1:] != mask.shape:
        raise ValueError(f"{name} has shape {image.shape}; expected (C, {mask.shape[0]}, {mask.shape[1]})")
    return np.ascontiguousarray(image)


def check_plane(name: str, plane: NDArray, shape: tuple[int, ...]) -> NDArray:
    """`plane` (H, W) as a contiguous array. Raises ValueError for another shape."""
    if plane.shape != shape:
        raise ValueError(f"{name} has shape {plane.shape}; expected {shape}")
    return np.ascontiguousarray(plane)


def check_mask(mask: BoolArray) -> None:
    """Raise ValueError unless `mask` is a boolean (H, W) array, True = tissue; 255 and soft masks are rejected."""
    if mask.dtype != np.bool_ or mask.ndim != 2:
        raise ValueError(f"mask must be boolean (H, W), got {mask.dtype} {mask.shape}")
