"""Depth of one frame from a file: PNG of 8 or 16 bits, TIFF, .npy, .npz, .mat or .pfm. OpenEXR is refused by name."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.depth_stacks import array_of, plane_of_stack
from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.formats.plain_arrays import read_npy, read_pfm
from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.opencv.pictures import TIFF_ENDINGS, no_data, read_picture, read_points
from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.clip import grey_plane
from endotsr.clips.sequences.sampling import sparse_step
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.untrusted.names import choice

CLIPPED = SequenceConfig().depth_percentiles  # depth is clipped to these before resizing
ANOTHER_SCALE = 64.0  # times the usual median depth; 8 bits stretched to 16 give 256
LEAST_DEPTH_FRACTION = 0.05  # of a frame; the median of fewer pixels may be an outlier
FILES = Inventory(
    "a depth file, by its ending",
    used={
        ".png": "8 or 16 bits, one channel",
        ".tif .tiff": "integers or real numbers; of points x y z, the third",
        ".npy .npz .mat": "the array with the shape of a picture",
        ".pfm": "real numbers, the bottom row first",
    },
    refused={
        ".exr": "OpenEXR is not read; convert it with the Python package OpenEXR:"
        ' numpy.save("a.npy", OpenEXR.File("a.exr").channels()["Z"].pixels); the channel may also be V, Y or R'
    },
)
DEPTH_ENDINGS = (".png", ".npy", ".npz", ".mat", ".pfm", *TIFF_ENDINGS, ".exr")  # listed in a folder of depth
DEPTH_LEVELS = 65535 // 8  # for the usual largest depth of a frame; eight times more still fits into 16 bits


def read_plane(path: Path) -> NDArray:
    """The values (H, W) of a file as stored; z of a TIFF of points x y z. Axes of length 1 are dropped.

    Raises:  InputError naming the file and the reason.
    """
    plane = plane_of_stack(path)
    if plane is not None:
        return plane
    ending = Path(path).suffix.lower()
    if (why := FILES.reason(FILES.refused, ending)) is not None:
        raise InputError(f"{path}: {why}")
    if ending not in DEPTH_ENDINGS:
        raise InputError(f"{path}: no depth by its name; use a name that ends in {choice(FILES.listed)}")
    points = read_points(path)
    if points is not None:
        return np.ascontiguousarray(points[:, :, 2])
    readers = {".npy": read_npy, ".npz": array_of, ".mat": array_of, ".pfm": read_pfm}
    array = readers.get(ending, read_picture)(path)
    plane = np.squeeze(array) if ending in readers else grey_plane(array, path)
    hole = no_data(path)
    if hole is not None:
        plane = np.where(plane == hole, 0, plane)
    if plane.ndim != 2:
        raise InputError(f"{path}: array of shape {array.shape}; use one plane (height, width)")
    return plane


def depth_plane(raw: NDArray, scale: float, where: object) -> NDArray[np.float32]:
    """Depth (H, W) in scene units, from stored values times `scale`. Invalid values (0, negative, not finite) become 0.

    Raises:  InputError if no value of a floating-point file is finite, if there are unlike negative values and none is
             positive, or if a value exceeds the range of float32.
    """
    if raw.dtype.kind == "f" and raw.size and not np.isfinite(raw).any():
        raise InputError(f"{where}: no value is finite; use lengths, and 0 where there is no depth")
    if raw.dtype.kind in "fi" and not (raw > 0).any() and np.unique(raw[raw < 0]).size > 1:
        raise InputError(f"{where}: all values are negative; use positive lengths, and 0 where there is no depth")
    with np.errstate(over="ignore"):
        depth = raw.astype(np.float64) * scale
    depth[~np.isfinite(depth) | (depth <= 0)] = 0.0
    if depth.size and depth.max() > np.finfo(np.float32).max:
        raise InputError(f"{where}: depth {depth.max():g} is too large; use lengths below 3.4e38, and 0")
    return depth.astype(np.float32)


def clip_depth(depth: NDArray, percentiles: tuple[float, float]) -> NDArray[np.float32]:
    """Depth (H, W) clipped to two percentiles of its non-zero values, as float32. 0 (no depth) stays 0."""
    result = depth.astype(np.float32)
    valid = result > 0
    if valid.any():
        low, high = np.percentile(result[valid], percentiles)
        result[valid] = np.clip(result[valid], low, high)
    return result


def reduced_depth(depth: NDArray[np.float32], width: int, height: int) -> NDArray[np.float32]:
    """Depth (H, W) at a smaller size: the mean of the depths that a new pixel covers, or 0 if it covers none."""
    fraction = area_resize((depth > 0).astype(np.float32), width, height)
    found = np.zeros(fraction.shape, np.float32)
    return np.divide(area_resize(depth, width, height), fraction, out=found, where=fraction > 0)


def check_depth_scale(depth: NDArray[np.float32], files: list[Path], types: list[np.dtype], unit: str) -> None:
    """Refuse a depth picture that is stretched to 16 bits among pictures with lengths in 8 bits.

    Mixed bit depths are valid and occur in published sequences: one large value makes a picture 16-bit.
    """
    for i, ratio in far_off(depth, ANOTHER_SCALE) if len(set(types)) > 1 else []:
        if np.count_nonzero(depth[i]) >= LEAST_DEPTH_FRACTION * depth[i].size:
            bits = 8 * types[i].itemsize
            other = next(j for j, kind in enumerate(types) if kind != types[i])
            raise InputError(
                f"{files[i]}: {bits}-bit picture, its median depth is {ratio:.3g} times the usual one, while"
                f" {files[other].name} has {8 * types[other].itemsize} bits; use {unit} in every picture"
            )


def far_off(depth: NDArray[np.float32], factor: float) -> list[tuple[int, float]]:
    """Frames whose median depth differs from the usual one by more than `factor`, each with its ratio."""
    step = sparse_step(depth.shape[1])
    sparse = depth[:, ::step, ::step]
    medians = {i: float(np.median(frame[frame > 0])) for i, frame in enumerate(sparse) if (frame > 0).any()}
    usual = float(np.median(list(medians.values()) or [1.0]))
    ratios = [(i, median / usual) for i, median in medians.items()]
    return [(i, ratio) for i, ratio in ratios if not 1 / factor <= ratio <= factor]


def step_of_depth(largest: float) -> float:
    """The step of 16-bit depth: the smallest 1, 2 or 5 times a power of ten for which eight times `largest` fits."""
    least = largest / DEPTH_LEVELS
    power = 10.0 ** np.floor(np.log10(least))
    return float(f"{next(factor for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9)) * power:.1g}")


def write_levels(path: Path, depth: NDArray[np.float32], step: float) -> int:
    """Write depth in 16-bit steps, at least 1 where there is depth. Returns the number of pixels clipped at 65535."""
    levels = np.rint(depth / step)
    write_png(path, np.where(depth > 0, np.clip(levels, 1, 65535), 0).astype(np.uint16))
    return int(np.count_nonzero(levels > 65535))
