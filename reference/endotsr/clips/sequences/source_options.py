"""Statements of a user about a source, for missing metadata. Used by `endotsr prepare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from endotsr.clips.sequences.pairing import Pairing
from endotsr.config import SequenceConfig


@dataclass(frozen=True)
class SourceOptions:
    """Statements about a source; the defaults state nothing."""

    layout: str = "auto"
    stereo: Literal["auto", "none", "side_by_side", "stacked", "half_side_by_side", "half_stacked"] = "auto"
    camera: tuple[float, ...] | None = None  # fx fy cx cy, pixel edges at integers
    distortion: tuple[float, ...] = ()
    calibration: Path | None = None  # a file in one of `calibration_formats.FORMATS`
    right: Path | None = None  # right view: a video, or a folder of pictures
    baseline: float | None = None  # of a rectified pair, in `unit`
    trajectory: Path | None = None  # TUM: time or frame, position, quaternion x y z w
    direction: Literal["camera_to_world", "world_to_camera"] = "camera_to_world"
    axes: Literal["opencv", "opengl", "llff"] | None = None  # of the camera; None: those of the layout
    trajectory_unit: Literal["um", "mm", "cm", "m", "arbitrary"] | None = None  # None: the unit of the layout
    masks: Path | None = None
    excluded_value: Literal["white", "black", "nonzero"] = "white"
    pairing: Pairing = "auto"  # of the files of `masks` and `depth` with the frames
    depth: Path | None = None
    depth_unit: Literal["um", "mm", "cm", "m", "arbitrary"] = "mm"
    depth_scale: float = 1.0
    trust_depth: bool = False  # the files of `depth` contain lengths, despite any evidence to the contrary
    rate: float | None = None  # frames per second; the pictures then count as evenly spaced
    orientation: Literal["turned", "stored"] | None = None  # for a video that states a rotation
    points: Literal["interpolated", "sparse", "none"] = "interpolated"  # depth from points of a reconstruction
    model: str = ""  # of several COLMAP models; "": the largest
    settings: SequenceConfig | None = None  # of a training, which choose the masks of the source and their polarity
