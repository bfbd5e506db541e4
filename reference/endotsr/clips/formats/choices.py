"""The words that options about a source allow, for the commands and for the readers. Imports nothing heavy."""

from typing import Literal

Stereo = Literal["none", "side_by_side", "stacked", "half_side_by_side", "half_stacked"]  # of two views in one picture
StatedStereo = Literal["auto", Stereo]
Direction = Literal["camera_to_world", "world_to_camera"]  # of a pose
Axes = Literal["opencv", "opengl", "llff"]  # of a camera
Unit = Literal["um", "mm", "cm", "m", "arbitrary"]
ExcludedValue = Literal["white", "black", "nonzero"]  # of masks
Pairing = Literal["auto", "number", "source", "order"]  # of files of another program with frames
Align = Literal["auto", "frame", "sequence"]  # of a relative depth
DepthOfPoints = Literal["interpolated", "sparse", "none"]  # of a reconstruction
Orientation = Literal["turned", "stored"]  # of a video that states a rotation
Gaps = Literal["refuse", "drop", "fill"]  # frames without mask or pose where others have one
Border = Literal["auto", "exclude", "keep"]  # outside of the field of view, dark in all frames
PictureKind = Literal["png", "jpg"]  # of a prepared clip
Other = Literal["nerfstudio", "colmap"]  # programs for which a prepared clip has further files
