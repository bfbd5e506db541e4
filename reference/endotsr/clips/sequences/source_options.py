"""Statements of a user about a source, for missing metadata. Used by `endotsr prepare`."""

from dataclasses import dataclass
from pathlib import Path

from endotsr.clips.formats.choices import (
    Axes,
    DepthOfPoints,
    Direction,
    ExcludedValue,
    Orientation,
    Pairing,
    StatedStereo,
    Unit,
)
from endotsr.config import SequenceConfig


@dataclass(frozen=True)
class SourceOptions:
    """Statements about a source; the defaults state nothing."""

    layout: str = "auto"
    stereo: StatedStereo = "auto"
    camera: tuple[float, ...] | None = None  # fx fy cx cy, pixel edges at integers
    field_of_view: float | None = None  # horizontal, degrees, in place of `camera`
    distortion: tuple[float, ...] = ()
    calibration: Path | None = None  # a file in one of `calibration_formats.FORMATS`
    right: Path | None = None  # right view: a video, or a folder of pictures
    baseline: float | None = None  # of a rectified pair, in `unit`
    trajectory: Path | None = None  # TUM: time or frame, position, quaternion x y z w
    direction: Direction = "camera_to_world"
    axes: Axes | None = None  # of the camera; None: those of the layout
    trajectory_unit: Unit | None = None  # None: the unit of the layout
    masks: Path | None = None
    excluded_value: ExcludedValue = "white"
    pairing: Pairing = "auto"  # of the files of `masks` and `depth` with the frames
    depth: Path | None = None
    depth_unit: Unit = "mm"
    depth_scale: float = 1.0
    trust_depth: bool = False  # the files of `depth` contain lengths, despite any evidence to the contrary
    rate: float | None = None  # frames per second; the pictures then count as evenly spaced
    orientation: Orientation | None = None  # for a video that states a rotation
    points: DepthOfPoints = "interpolated"  # depth from points of a reconstruction
    model: str = ""  # of several COLMAP models; "": the largest
    settings: SequenceConfig | None = None  # of a training, which choose the masks of the source and their polarity
