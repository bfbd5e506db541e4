"""Compact storage of the targets of a frame between its visits.

In: tissue masks and depth targets. Out: the targets of the depth loss and of the pyramid. A mask is stored with one bit
per pixel. The depth of a frame is normalised again at every visit, which is fast; the depth of a time between two
frames (B14) is stored as integers. This module computes no loss.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from endotsr.method.equations.laplacian import LEVELS, SupportMasks, support_masks
from endotsr.method.equations.pyramid import Upsampling
from endotsr.method.kernels.arrays import Array, BoolArray
from endotsr.method.losses.depth import DepthTarget

STEPS = 65535  # of the interval [0, 1]; an 8-bit step, 1 / 255, is the RMS error of a fit of 48 dB


class PackedMask(NamedTuple):
    """A mask of one bit per pixel."""

    bits: Array  # (ceil(H W / 8),) uint8
    shape: tuple[int, ...]  # (H, W)


class PackedDepth(NamedTuple):
    """A normalised prior depth as integers, within half a step of 1 / STEPS of the `DepthTarget`."""

    levels: Array  # (H, W) uint16, steps of 1 / STEPS of the largest prior of the picture
    valid: PackedMask
    count: int  # valid pixels


def packed_mask(mask: BoolArray) -> PackedMask:
    """The mask with one bit per pixel."""
    return PackedMask(np.packbits(mask), mask.shape)


def unpacked_mask(packed: PackedMask) -> BoolArray:
    """The mask, restored exactly."""
    height, width = packed.shape
    return np.unpackbits(packed.bits, count=height * width).view(np.bool_).reshape(packed.shape)


def packed_supports(mask: BoolArray, upsampling: Upsampling) -> tuple[PackedMask, ...]:
    """The valid pixels of the bands of the pyramid below a tissue mask."""
    return tuple(packed_mask(valid) for valid in support_masks(mask, LEVELS, upsampling).bands)


def unpacked_supports(packed: tuple[PackedMask, ...], mask: BoolArray, upsampling: Upsampling) -> SupportMasks:
    """The `support_masks`, restored exactly."""
    return SupportMasks(mask, tuple(unpacked_mask(valid) for valid in packed), upsampling)


def packed_depth(target: DepthTarget) -> PackedDepth:
    """A depth target as integers."""
    levels = np.rint(target.normalised * STEPS).astype(np.uint16)
    return PackedDepth(levels, packed_mask(target.valid), target.count)


def unpacked_depth(packed: PackedDepth, dtype: DTypeLike) -> DepthTarget:
    """The depth target, restored to within half a step."""
    normalised = np.multiply(packed.levels, 1 / STEPS, dtype=dtype)
    return DepthTarget(normalised, unpacked_mask(packed.valid), packed.count)
