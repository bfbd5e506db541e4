"""Validation of the numbers of a checkpoint, which may be damaged, edited or forged.

In: the arrays read from the file. Out: nothing, or ValueError with the name of the array and the allowed values. A
state of a training passes if its numbers are finite.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from endotsr.training.fitting.adam import AdamState
from endotsr.training.scene.density_control import DensityStatistics
from endotsr.training.scene.gaussians import DEFORMATION_CHANNELS, Gaussians, arrays
from endotsr.training.scene.parameters import CHANNELS, FrameParameters, trained

PRECISIONS = ("float32", "float64")
HARMONICS = (1, 4, 9, 16)  # (degree + 1)^2
# The axes before the last: a number is a length, a letter is one unknown length common to all its axes.
SHAPES: dict[str, tuple[int | str, ...]] = {
    "position": (3,),
    "quaternion": (4,),
    "log_scale": (3,),
    "opacity_logit": (),
    "harmonics": ("K", 3),
    "fdm_weight": (DEFORMATION_CHANNELS, "B"),
    "fdm_centre": (DEFORMATION_CHANNELS, "B"),
    "fdm_width": (DEFORMATION_CHANNELS, "B"),
    "appearance_coefficients": (3, "2F"),
    "motion_coefficients": (3, "2F"),
    "exposure_log_gain": (CHANNELS,),
    "exposure_bias": (CHANNELS,),
    "pose_rotation": (3,),
    "pose_translation": (3,),
}

TOGETHER = (
    ("fdm_weight", "fdm_centre", "fdm_width"),
    ("exposure_log_gain", "exposure_bias"),
    ("pose_rotation", "pose_translation"),
)


def check_shapes(gaussians: Gaussians, adam: AdamState, frames: FrameParameters | None = None) -> None:
    """Check axes, precision and lengths. Raises ValueError.

    Every array has the axes of `SHAPES` and one column per Gaussian or training frame; its moments have its shape. All
    have one precision. The arrays of a line of `TOGETHER` are all present or all absent.
    """
    named = arrays(gaussians) | trained(frames)
    lengths: dict[str, int] = {}
    for name, array in named.items():
        _check_axes(name, array, lengths)
        if array.dtype != gaussians.position.dtype or array.dtype.name not in PRECISIONS:
            raise ValueError(f"{name}: {array.dtype}; use {' or '.join(PRECISIONS)}, the same in every array")
    for together in TOGETHER:
        if 0 < len(named.keys() & set(together)) < len(together):
            raise ValueError(f"{', '.join(together)}: some are missing; use all {len(together)} or none")
    if lengths["K"] not in HARMONICS or lengths.get("2F", 0) % 2:
        raise ValueError(f"harmonics: {lengths['K']} coefficients, 2F = {lengths.get('2F')}; use 1, 4, 9, 16; even")
    if frames is not None and (frames.times.ndim != 1 or frames.times.dtype != np.float64):
        raise ValueError(f"times: {frames.times.dtype} {frames.times.shape}; use float64 (n,)")
    check_lengths(gaussians, adam, frames)
    if adam.first.keys() != named.keys():
        raise ValueError(f"first: moments of {', '.join(adam.first)}; use those of {', '.join(named)}")


def _check_axes(name: str, array: NDArray, lengths: dict[str, int]) -> None:
    """Compare the axes with `SHAPES`; `lengths` records the length of each letter."""
    expected = SHAPES[name]
    if array.ndim != len(expected) + 1:
        raise ValueError(f"{name}: {array.ndim} axes; use {len(expected) + 1}")
    for length, wanted in zip(array.shape, expected):
        if length != (lengths.setdefault(wanted, length) if isinstance(wanted, str) else wanted):
            raise ValueError(f"{name}: {array.shape}; use ({', '.join(map(str, expected))}, count)")


def check_lengths(gaussians: Gaussians, adam: AdamState, frames: FrameParameters | None = None) -> None:
    """Raise ValueError unless every array and moment has one column per Gaussian or training frame."""
    for what, named, count in (
        ("Gaussians", arrays(gaussians), gaussians.count),
        ("training frames", trained(frames), 0 if frames is None else frames.times.size),
    ):
        for name, array in named.items():
            moments = {f"first {name}": adam.first.get(name), f"second {name}": adam.second.get(name)}
            for label, found in ({name: array} | moments).items():
                if found is not None and found.shape != (*array.shape[:-1], count):
                    raise ValueError(f"{label}: {found.shape} for {count} {what}")
                if found is not None and found.dtype != array.dtype:
                    raise ValueError(f"{label}: {found.dtype}; use {array.dtype}")


def check_numbers(
    gaussians: Gaussians, adam: AdamState, statistics: DensityStatistics, frames: FrameParameters | None = None
) -> None:
    """Check the values of arrays that have passed `check_shapes`. Raises ValueError with array and index.

    All are finite; second moments and statistics are nonnegative, and the times of the training frames ascend within
    [0, 1]. A log-scale of any size is one of a training: it is clipped where it is used (B2).
    """
    for label, array, low, high in _limits(gaussians, adam, statistics, frames):
        good = (array >= low) & (array <= high)  # NaN is in no range
        if not good.all():
            index = tuple(int(i) for i in np.argwhere(~good)[0])
            limits = "finite numbers" if high > 1e30 and low else f"finite numbers from {low:g} to {high:.4g}"
            raise ValueError(f"{label}[{', '.join(map(str, index))}] is {array[index]}; use {limits}")
    if frames is not None and (np.diff(frames.times) <= 0).any():
        raise ValueError("times: they do not ascend; use the ascending times of the training frames")


def _limits(
    gaussians: Gaussians, adam: AdamState, statistics: DensityStatistics, frames: FrameParameters | None
) -> Iterator[tuple[str, NDArray, float, float]]:
    """Name, array, and the range of its values; every range excludes infinity."""
    largest = float(np.finfo(gaussians.position.dtype).max)
    for name, array in (arrays(gaussians) | trained(frames)).items():
        yield name, array, -largest, largest
        yield f"first {name}", adam.first[name], -largest, largest
        yield f"second {name}", adam.second[name], 0.0, largest
    yield "gradient_sum", statistics.gradient_sum, 0.0, float(np.finfo(np.float64).max)
    yield "visits", statistics.visits, 0, np.iinfo(np.int64).max
    if frames is not None:
        yield "times", frames.times, 0.0, 1.0
