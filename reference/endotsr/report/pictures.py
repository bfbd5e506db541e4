"""Rendered planes as whole numbers for PNG files."""

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.arrays import FloatArray

DEPTH_LEVELS = 65535
DEPTH_HEADROOM = 1.5  # over the largest prior depth, since rendered depth may be a little larger


def rgb_bytes(colour: FloatArray) -> NDArray[np.uint8]:
    """(3, H, W) in display units, clipped to [0, 1] and rounded, as (H, W, 3)."""
    return np.rint(np.clip(np.nan_to_num(colour), 0, 1) * 255).astype(np.uint8).transpose(1, 2, 0)


def grey_bytes(plane: FloatArray) -> NDArray[np.uint8]:
    """(H, W) in [0, 1] as 0 .. 255."""
    return np.rint(np.clip(np.nan_to_num(plane), 0, 1) * 255).astype(np.uint8)


def depth_step(largest_depth: float, depth: FloatArray) -> float:
    """Scene units of one step of a 16-bit depth picture: a power of two that leaves headroom, one for all views."""
    largest = max(largest_depth, float(np.nan_to_num(depth).max()), 1e-6) * DEPTH_HEADROOM
    return float(2.0 ** np.ceil(np.log2(largest / DEPTH_LEVELS)))


def depth_bytes(depth: FloatArray, step: float) -> NDArray[np.uint16]:
    """(H, W) scene units as whole steps, clipped to 16 bits; 0 = no depth."""
    return np.clip(np.rint(np.nan_to_num(depth) / step), 0, DEPTH_LEVELS).astype(np.uint16)
