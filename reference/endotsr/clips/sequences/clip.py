"""A clip: the contents of a path in some layout, decoded on demand.

Every layout returns a `Clip`: frames that are decoded on demand, with masks, depth, calibration and poses if they
exist. `prepare` converts it into the common format. Conventions: pixel edges are at integers (the first pixel centre is
at 0.5), poses are world-to-camera in OpenCV axes, masks are True on tissue, and a depth of 0 means no depth.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray

Picture = NDArray[np.uint8]  # (H, W, 3) RGB
MILLIMETRES = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0}
ARBITRARY = "arbitrary"


def scene_factor(unit: str) -> float:
    """The factor from lengths in `unit` to scene units: millimetres, or the arbitrary unit itself."""
    return 1.0 if unit == ARBITRARY else MILLIMETRES[unit]


class Intrinsics(NamedTuple):
    """Intrinsics of one camera, pixels; pixel edges at integers."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    distortion: tuple[float, ...] = ()  # OpenCV's order k1 k2 p1 p2 [k3 [k4 k5 k6]]; empty: none

    def scaled(self, width: int, height: int) -> "Intrinsics":
        """The intrinsics of the picture resized to width x height, with aligned picture edges."""
        x, y = width / self.width, height / self.height
        return self._replace(fx=self.fx * x, cx=self.cx * x, fy=self.fy * y, cy=self.cy * y, width=width, height=height)


class StereoCalibration(NamedTuple):
    """Two cameras before rectification: x_right = rotation @ x_left + translation."""

    left: Intrinsics
    right: Intrinsics
    rotation: FloatArray  # (3, 3)
    translation: FloatArray  # (3,) millimetres


class CameraPose(NamedTuple):
    """World-to-camera, OpenCV axes: x_camera = rotation @ x_world + translation."""

    rotation: FloatArray  # (3, 3)
    translation: FloatArray  # (3,) in the unit of the clip


class PicturePair(NamedTuple):
    """The pictures at one time."""

    left: Picture
    right: Picture | None = None


class StatedDepth(NamedTuple):
    """Depth files stated by a user."""

    path: Path
    step: float  # length per stored unit, in the unit of the clip
    trusted: bool  # the user confirms that they contain lengths


@dataclass(frozen=True)
class Clip:
    """Frames of a source and everything known about them. None for anything that the source lacks."""

    layout: str
    where: Path
    names: list[str]
    pictures: Callable[[list[int]], Iterator[PicturePair]]  # of ascending frame numbers
    masks: Callable[[int], NDArray[np.bool_] | None] | None = None  # None: this frame has no mask
    proposed: bool = False  # a program made the masks, and no person has checked them
    depth: Callable[[int], NDArray[np.float32] | None] | None = None  # in `unit`
    stated_depth: StatedDepth | None = None  # source of `depth`, if the user stated it
    depth_clipped: bool = False  # to the percentiles of training, before resizing
    depth_method: str = "given"  # in words
    depth_assumed: Literal["", "scale and shift", "shape"] = ""  # properties of the depth that are not measured
    points: Callable[[int], FloatArray] | None = None  # (n, 3) world positions visible in a frame, in `unit`
    unit: str = "mm"
    intrinsics: Intrinsics | None = None
    calibration: StereoCalibration | None = None
    baseline: float | None = None  # of a rectified pair, in `unit`
    poses: list[CameraPose | None] | None = None
    rate: float | None = None  # frames per second
    times: NDArray[np.float64] | None = None  # seconds of every frame, ascending; None: evenly spaced
    notes: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Number of frames."""
        return len(self.names)

    def seconds(self, frames: list[int]) -> NDArray[np.float64]:
        """Times of these frames, seconds; their numbers if neither times nor a rate are known."""
        return np.array(frames) / (self.rate or 1.0) if self.times is None else self.times[frames]


def intrinsics_of_matrix(
    matrix: FloatArray, width: int, height: int, distortion: tuple[float, ...] = (), *, where: object
) -> Intrinsics:
    """The intrinsics of a 3x3 matrix in OpenCV's convention, with pixel centres at integers: half a pixel is added.

    Raises:  InputError for a matrix that is not finite or has skew, and as `checked_intrinsics`.
    """
    numbers = np.asarray(matrix, np.float64)
    if numbers.shape != (3, 3) or not np.isfinite(numbers).all():
        raise InputError(f"{where}: camera matrix: allowed: 3x3 finite numbers")
    if numbers[0, 1] != 0:
        raise InputError(f"{where}: camera matrix: skew {numbers[0, 1]:g}; allowed: 0 (square angles)")
    fx, fy, cx, cy = (
        float(value) for value in (numbers[0, 0], numbers[1, 1], numbers[0, 2] + 0.5, numbers[1, 2] + 0.5)
    )
    return checked_intrinsics(Intrinsics(fx, fy, cx, cy, width, height, distortion), where)


def checked_intrinsics(found: Intrinsics, where: object) -> Intrinsics:
    """The intrinsics, checked.

    Raises:  InputError for values that are not finite, a focal length that is not positive, a principal point far
             outside the picture, or another number of distortion coefficients than 0, 4, 5 or 8.
    """
    fx, fy, cx, cy, width, height, distortion = found
    if not np.isfinite([fx, fy, cx, cy, *distortion]).all():
        raise InputError(f"{where}: camera: allowed: finite numbers, got {found[:4]} and distortion {distortion}")
    if fx <= 0 or fy <= 0:
        raise InputError(f"{where}: focal length {min(fx, fy):g}: allowed: numbers > 0")
    if not -width <= cx <= 2 * width or not -height <= cy <= 2 * height:
        raise InputError(
            f"{where}: principal point ({cx:g}, {cy:g}) is far outside the {width}x{height} pixels; is the calibration"
            " of another picture size?"
        )
    if len(distortion) not in (0, 4, 5, 8):
        raise InputError(f"{where}: {len(distortion)} distortion coefficients; allowed: none, 4, 5 or 8")
    return found


def opencv_matrix(intrinsics: Intrinsics) -> FloatArray:
    """The 3x3 matrix in OpenCV's convention (pixel centres at integers)."""
    fx, fy, cx, cy, *_ = intrinsics
    return np.array([[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]])


def grey_plane(pixels: NDArray[Any], where: object) -> NDArray[Any]:
    """One channel of a grey picture with one or three equal channels. Raises InputError for a coloured picture."""
    if pixels.ndim == 3:
        if (pixels != pixels[:, :, :1]).any():
            raise InputError(f"{where}: coloured picture; one grey channel expected")
        pixels = np.ascontiguousarray(pixels[:, :, 0])
    return pixels


def colour_picture(pixels: NDArray[Any], where: object) -> Picture:
    """An 8-bit RGB picture. Raises InputError for a grey picture or one of another type."""
    if pixels.dtype != np.uint8:
        raise InputError(f"{where}: {8 * pixels.dtype.itemsize}-bit picture; images must have 8 bits per channel")
    if pixels.ndim == 2:
        raise InputError(f"{where}: grey picture; images must be RGB")
    return pixels
