"""LPIPS (M3): perceptual distance of two images through the convolutional part of AlexNet, version 0.1, in NumPy.

Five feature maps of each image are divided by their norm over channels. Their squared differences are weighted by a
learned non-negative vector, summed over channels and averaged over pixels; the distance is the sum over the five maps.
The weights are not part of the package. Without them the value is None, with a reason.

Weights file: an .npz with `conv1..5_weight` (out, in, k, k), `conv1..5_bias` (out,), `lin1..5_weight` (out,),
`shift` (3,) and `scale` (3,); the last two normalise RGB in [-1, 1].
"""

import math
import os
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.arrays import RefusedArray, open_npz

InputRange = Literal["zero_one", "minus_one_one"]

ENVIRONMENT = "ENDOTSR_LPIPS"
FILE_NAME = "lpips_alex.npz"
CHANNELS = (3, 64, 192, 384, 256, 256)  # in, then out of the five convolutions
KERNELS = (11, 5, 3, 3, 3)
STRIDES = (4, 1, 1, 1, 1)
PADDINGS = (2, 2, 1, 1, 1)
POOL_BEFORE = (False, True, True, False, False)  # 3 x 3 maximum, stride 2
TINY = 1e-10  # added to the channel norm
LARGEST_FILE = 1 << 28  # bytes; the AlexNet weights have 10 MB
SMALLEST_SIDE = 31  # pixels; the fifth map of such an image has one feature per side


class LpipsWeights(NamedTuple):
    """AlexNet's five convolutions and the five weight vectors of the distance, float32."""

    kernels: tuple[FloatArray, ...]  # five of (out, in, k, k)
    biases: tuple[FloatArray, ...]  # five of (out,)
    heads: tuple[FloatArray, ...]  # five of (out,), >= 0
    shift: FloatArray  # (3,)
    scale: FloatArray  # (3,)


def default_weights_path() -> Path:
    """The weights file used if neither an argument nor the environment names one."""
    from platformdirs import user_data_dir

    return Path(user_data_dir("endotsr", appauthor=False)) / FILE_NAME


def lpips_file(path: str | os.PathLike | None = None) -> Path | None:
    """The file of the weights: `path`, else that in ENDOTSR_LPIPS, else `default_weights_path()` if it exists."""
    named = path if path is not None else os.environ.get(ENVIRONMENT) or None
    if named is not None:
        return Path(named)
    fallback = default_weights_path()
    return fallback if fallback.exists() else None


def load_lpips_weights(path: str | os.PathLike | None = None) -> LpipsWeights | None:
    """Weights from the file of `lpips_file`, None without one.

    Raises InputError naming file and key if a named file is missing, or a file is unusable.
    `lpips_obstacle(None, ...)` lists the searched locations.
    """
    file = lpips_file(path)
    return None if file is None else _read_weights(file)


def lpips_obstacle(weights: LpipsWeights | None, height: int, width: int) -> str | None:
    """The reason why LPIPS of height x width images cannot be computed; None if it can."""
    if weights is None:
        return f"no LPIPS weights: no file was given, {ENVIRONMENT} is not set, {default_weights_path()} does not exist"
    if min(height, width) < SMALLEST_SIDE:
        return (
            f"images of {width} x {height} are too small for LPIPS: at least {SMALLEST_SIDE} x {SMALLEST_SIDE} pixels"
        )
    return None


def lpips(
    a: FloatArray, b: FloatArray, weights: LpipsWeights | None, input_range: InputRange = "zero_one"
) -> float | None:
    """LPIPS (M3) of two images; symmetric, 0 for equal images.

    a, b         (3, H, W)  RGB in [0, 1]; NaN gives NaN
    input_range  "zero_one": unchanged input; "minus_one_one": input scaled to [-1, 1], the range for which the weights
                 were trained. The two values are not comparable.
    returns      the distance, or None if `lpips_obstacle` gives a reason
    Raises:      ValueError for shapes that do not fit or an unknown input_range.
    Oracle:      published pair of example images, 0.722 and 0.138 ("minus_one_one").
    Source:      Zhang et al. 2018, the `lpips` package, version 0.1, AlexNet.
    """
    if a.shape != b.shape or a.ndim != 3 or a.shape[0] != 3:
        raise ValueError(f"LPIPS needs two images (3, H, W), got {a.shape} and {b.shape}")
    if input_range not in ("zero_one", "minus_one_one"):
        raise ValueError(f"input_range {input_range!r} is not known; use zero_one or minus_one_one")
    if weights is None or lpips_obstacle(weights, *a.shape[1:]) is not None:
        return None
    return math.fsum(layer_distances(a, b, weights, input_range))


def layer_distances(a: FloatArray, b: FloatArray, weights: LpipsWeights, input_range: InputRange) -> list[float]:
    """The five terms of the sum, first layer first."""
    one, other = (feature_maps(image, weights, input_range) for image in (a, b))
    return map_distances(one, other, weights)


def feature_maps(image: FloatArray, weights: LpipsWeights, input_range: InputRange) -> list[FloatArray]:
    """The five feature maps (out, H_l, W_l) of a picture (3, H, W), divided by their norm over channels."""
    return [_unit_length(found) for found in _features(_normalised(image, weights, input_range), weights)]


def map_distances(a: list[FloatArray], b: list[FloatArray], weights: LpipsWeights) -> list[float]:
    """The five terms of the sum, from the `feature_maps` of two pictures."""
    return [
        float(np.tensordot(head, (one - other) ** 2, 1).mean(dtype=np.float64))
        for one, other, head in zip(a, b, weights.heads, strict=True)
    ]


def _normalised(image: FloatArray, weights: LpipsWeights, input_range: InputRange) -> FloatArray:
    image = np.asarray(image, np.float32)
    if input_range == "minus_one_one":
        image = 2 * image - 1
    return (image - weights.shift[:, None, None]) / weights.scale[:, None, None]


def _features(image: FloatArray, weights: LpipsWeights) -> list[FloatArray]:
    """The five rectified feature maps (out, H_l, W_l)."""
    found = []
    for layer in range(5):
        if POOL_BEFORE[layer]:
            image = pooled(image)
        image = _convolve(image, weights.kernels[layer], STRIDES[layer], PADDINGS[layer])
        image = np.maximum(image + weights.biases[layer][:, None, None], 0)
        found.append(image)
    return found


def _convolve(image: FloatArray, kernel: FloatArray, stride: int, padding: int) -> FloatArray:
    """Correlation with zero padding, as one matrix product."""
    padded = np.pad(image, ((0, 0), (padding, padding), (padding, padding)))
    size = kernel.shape[-1]
    patches = np.lib.stride_tricks.sliding_window_view(padded, (size, size), axis=(1, 2))[:, ::stride, ::stride]
    rows, columns = patches.shape[1:3]
    matrix = patches.transpose(0, 3, 4, 1, 2).reshape(-1, rows * columns)  # (in k k, pixels)
    return (kernel.reshape(len(kernel), -1) @ matrix).reshape(len(kernel), rows, columns)


def pooled(image: FloatArray) -> FloatArray:
    """3 x 3 maximum pooling with stride 2: rows first, then columns."""
    for _ in range(2):
        count = (image.shape[1] - 3) // 2 + 1
        first, second, third = (image[:, k : k + 2 * count - 1 : 2] for k in range(3))
        image = np.maximum(np.maximum(first, second), third).swapaxes(1, 2)
    return image


def _unit_length(features: FloatArray) -> FloatArray:
    return features / (np.sqrt((features**2).sum(axis=0)) + np.float32(TINY))


def _read_weights(path: Path) -> LpipsWeights:
    try:
        with open_npz(path, LARGEST_FILE, compressed=True) as file:
            arrays = {name: file.read(name) for name in file.names}
    except RefusedArray as error:
        raise InputError(f"{path}: LPIPS weights cannot be read: {error}") from None
    kernels, biases, heads = [], [], []
    for layer, (before, after, size) in enumerate(zip(CHANNELS[:-1], CHANNELS[1:], KERNELS), start=1):
        kernels.append(_entry(path, arrays, f"conv{layer}_weight", (after, before, size, size)))
        biases.append(_entry(path, arrays, f"conv{layer}_bias", (after,)))
        heads.append(_entry(path, arrays, f"lin{layer}_weight", (after,)))
    shift, scale = (_entry(path, arrays, key, (3,)) for key in ("shift", "scale"))
    return LpipsWeights(tuple(kernels), tuple(biases), tuple(heads), shift, scale)


def _entry(path: Path, arrays: dict[str, NDArray], key: str, shape: tuple[int, ...]) -> FloatArray:
    if key not in arrays:
        raise InputError(
            f"{path}: LPIPS weights: key {key} is missing; the file has {', '.join(sorted(arrays)) or 'no keys'}"
        )
    value = arrays[key]
    if value.shape != shape or not np.issubdtype(value.dtype, np.floating):
        raise InputError(f"{path}: LPIPS weights: {key} is {value.dtype} {value.shape}; expected floating {shape}")
    if not np.isfinite(value).all():
        raise InputError(f"{path}: LPIPS weights: {key} has values that are not finite")
    return np.ascontiguousarray(value, np.float32)
