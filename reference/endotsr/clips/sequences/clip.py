"""A clip: what the files of one recording hold, with one meaning for every layout.

`layouts.describe(path)` returns a `Clip` for every layout. Reader, `check`, hashes, `prepare`, `masks` and `depth` take
it. Frames are decoded on demand. Conventions: those of `camera`; masks are True on tissue; a depth of 0 means no depth;
times are seconds.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import ARBITRARY, Intrinsics, StereoCalibration
from endotsr.clips.opencv.other_kinds import remedy
from endotsr.clips.sequences.checks.kinds import Finding
from endotsr.clips.sequences.crop import Crop
from endotsr.clips.sequences.mask_values import MaskLevels
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, CameraPose

Picture = NDArray[np.uint8]  # (H, W, 3) RGB
Numbers = list[int] | range  # of frames
Assumed = Literal["", "scale and shift", "shape"]  # properties of the depth that are not measured
STILL = 1e-9  # ruling: a camera moves if an entry of its pose varies by more
REST = CameraPose(np.eye(3), np.zeros(3))


class PicturePair(NamedTuple):
    """The pictures at one time."""

    left: Picture
    right: Picture | None = None


@dataclass(frozen=True)
class Masks:
    """The masks of a clip. `masks(i)` is (H, W), True on tissue; None: frame i has no mask."""

    read: Callable[[int], NDArray[np.bool_] | None]
    files: list[Path] = field(default_factory=list)  # one per frame; empty: masks of some frames only, or edited ones
    excluded_value: str = "white"  # of the files; `white` or `black`
    stated_in: str = ""  # the file that states this value; "": a setting or an option does
    proposed: bool = False  # a program made the masks, and no person has checked them
    origin: str = ""  # where the excluded pixels come from, in words; "": not stated
    paired: str = ""  # how files of another program belong to the frames, where this deserves a note
    levels: Callable[[], MaskLevels] | None = None  # what the numbers of the files mean; None: the reader knows

    def __call__(self, i: int) -> NDArray[np.bool_] | None:
        return self.read(i)


@dataclass(frozen=True)
class Depth:
    """The depth of a clip. `depth(i)` is (H, W) in the unit of the clip, 0 = none; None: frame i has no depth."""

    read: Callable[[int], NDArray[np.float32] | None]
    files: list[Path] = field(default_factory=list)  # as in `Masks`
    scale: float = 1.0  # length per stored value, in the unit of the clip
    unit: str = "mm"  # of the stored values times their scale
    clipped: tuple[float, ...] = ()  # percentiles to which the depth was clipped before resizing
    method: str = "given"  # in words
    assumed: Assumed = ""
    stated: Path | None = None  # files that a user stated
    trusted: bool = False  # the user confirms that they contain lengths
    paired: str = ""  # as in `Masks`

    def __call__(self, i: int) -> NDArray[np.float32] | None:
        return self.read(i)


@dataclass(frozen=True)
class Clip:
    """Frames of a source and everything known about them. None for anything that the source lacks."""

    layout: str
    where: Path
    names: list[str]
    pictures: Callable[[list[int]], Iterator[PicturePair]]  # of ascending frame numbers
    source_names: list[str] | None = None  # of the frames of a prepared clip in its recording
    images: list[Path] = field(default_factory=list)  # one file per frame; empty: frames of a video
    right: list[Path] = field(default_factory=list)  # right pictures of a stereo pair, likewise
    masks: Masks | None = None
    depth: Depth | None = None
    points: Callable[[int], FloatArray] | None = None  # (n, 3) world positions visible in a frame, in `unit`
    unit: str = "mm"
    intrinsics: Intrinsics | None = None
    calibration: StereoCalibration | None = None
    crop: Crop | None = None  # the window of the source pictures that the clip shows; None: all of them
    baseline: float | None = None  # of a rectified pair, in `unit`
    poses: list[CameraPose | None] | None = None  # None: the camera rests at `rest`
    rest: CameraPose = REST
    pose_origin: str = "given"  # where the poses come from, in words
    interpolated: tuple[int, ...] = ()  # frames whose pose was interpolated between others
    rate: float | None = None  # frames per second
    times: NDArray[np.float64] | None = None  # seconds of every frame, ascending; None: evenly spaced
    notes: list[str] = field(default_factory=list)
    stated_in: Path | None = None  # the file that states the camera
    size_said: str = "the first image has"  # source of the size in `intrinsics`, for messages
    faults: list[Finding] = field(default_factory=list)  # missing or unusable parts
    pose_faults: dict[int, str] = field(default_factory=dict)  # why a frame has no pose
    read_here: tuple[str, ...] = ()  # further names in the folder that were read, in lower case
    inside: Mapping[Path, tuple[str, ...]] = field(default_factory=dict)  # folders that were read, see `unread`
    not_read: tuple[str, ...] = ()  # notes on entries of the folder that are not read; set for training

    @property
    def count(self) -> int:
        """Number of frames."""
        return len(self.names)

    @property
    def arbitrary(self) -> bool:
        """Whether the unit of the lengths is unknown."""
        return self.unit == ARBITRARY

    @property
    def unit_in_words(self) -> str:
        """The unit of all lengths, with their assumptions; it accompanies every reported length."""
        assumed = f", {self.depth.assumed} of the depth assumed" if self.depth and self.depth.assumed else ""
        return f"arbitrary unit{assumed}" if self.arbitrary else self.unit

    def times_of(self, frames: Numbers) -> NDArray[np.float64]:
        """Times of these frames, seconds; their numbers if neither times nor a rate are known."""
        return np.array(frames) / (self.rate or 1.0) if self.times is None else self.times[list(frames)]

    def duration(self, frames: Numbers) -> float:
        """Seconds from time 0 to time 1 of these frames, n / (n - 1) (s_{n-1} - s_0); 0 for one frame or no rate."""
        if not self.rate or len(frames) < 2:
            return 0.0
        first, last = frames[0], frames[-1]
        elapsed = (last - first) / self.rate if self.times is None else self.times[last] - self.times[first]
        return float(elapsed) * len(frames) / (len(frames) - 1)

    def cameras(self, frames: Numbers) -> list[Camera]:
        """One camera per frame; the same object for all frames of a static camera.

        Raises:  InputError for a frame without a pose, or without intrinsics.
        """
        if self.intrinsics is None:
            raise InputError(next(iter(self.pose_faults.values()), f"{self.where}: the intrinsics are unknown"))
        poses: list[CameraPose] = []
        for i in frames:
            pose = self.rest if self.poses is None else self.poses[i]
            if pose is None:
                raise InputError(self.pose_faults.get(i, f"{self.where}: frame {self.names[i]} has no pose"))
            poses.append(pose)
        cameras = [Camera(*pose, *self.intrinsics[:6]) for pose in poses]
        return cameras[:1] * len(frames) if rests(poses) else cameras


def rests(poses: list[CameraPose]) -> bool:
    """Whether no entry of the poses varies by more than `STILL`."""
    rows = np.array([[*pose.rotation.ravel(), *pose.translation] for pose in poses])
    return bool((np.ptp(rows, axis=0) <= STILL).all())


def grey_plane(pixels: NDArray[Any], where: object) -> NDArray[Any]:
    """One channel of a grey picture with one or three equal channels. Raises InputError for a coloured picture."""
    if pixels.ndim == 3:
        if (pixels != pixels[:, :, :1]).any():
            raise InputError(f"{where}: coloured picture; one grey channel expected")
        pixels = np.ascontiguousarray(pixels[:, :, 0])
    return pixels


def colour_picture(pixels: NDArray[Any], where: object) -> Picture:
    """An 8-bit RGB picture. Raises InputError for a grey picture or one of another type."""
    if pixels.dtype != np.uint8 or pixels.ndim == 2:
        raise InputError(f"{where}: {remedy(pixels)}")
    return pixels
