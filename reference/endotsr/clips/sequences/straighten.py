"""Undistortion, rectification and resizing of a recording to the pictures of one pinhole camera.

In: a `Recording` and a scale. Out: a `Straightener`, which maps pictures, masks, depth and poses, and the lens of the
new pictures. Left and right each have their own distortion.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv import area_resize
from endotsr.clips.opencv.stereo import Maps, rectification_maps, remapped, undistortion_maps
from endotsr.clips.sequences.depth_files import CLIPPED, clip_depth, reduced_depth
from endotsr.clips.sequences.recording import (
    CameraPose,
    Lens,
    Picture,
    PicturePair,
    Recording,
    lens_of_matrix,
    opencv_matrix,
)
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import degrees_between

SKEWED = 0.5  # largest vertical over horizontal offset of two cameras that count as side by side


@dataclass(frozen=True)
class Straightener:
    """The maps of a recording, and the size of the new pictures."""

    lens: Lens  # of the new pictures, without distortion
    left: Maps | None  # None: as stored
    right: Maps | None
    turn: FloatArray  # (3, 3) x_new = turn @ x_old, camera axes of the left picture
    baseline: float | None
    notes: list[str]
    clipped: bool = False  # the depth of the recording is already clipped

    def pictures(self, pair: PicturePair) -> PicturePair:
        """Both pictures in the new camera."""
        left = self._picture(pair.left, self.left)
        return PicturePair(left, None if pair.right is None else self._picture(pair.right, self.right))

    def _picture(self, picture: Picture, maps: Maps | None) -> Picture:
        return area_resize(remapped(picture, maps) if maps else picture, self.lens.width, self.lens.height)

    def mask(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Tissue where all covered pixels of the old mask are tissue."""
        if self.left:
            mask = remapped(mask.astype(np.uint8), self.left, nearest=True) > 0
        return area_resize((~mask).astype(np.float32), self.lens.width, self.lens.height) == 0

    def depth(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mean of the depths that a new pixel covers, or 0 if it covers none.

        Before resizing, depth is clipped to `CLIPPED`, as in training at a scale: an outlier must not be averaged into
        its neighbours. Depth of unchanged size is clipped by training.
        """
        if self.left:
            depth = remapped(depth, self.left, nearest=True)
        if depth.shape == (self.lens.height, self.lens.width):
            return depth
        plane = depth if self.clipped else clip_depth(depth, CLIPPED)
        return reduced_depth(plane, self.lens.width, self.lens.height)

    def pose(self, pose: CameraPose) -> CameraPose:
        """World-to-camera of the new left camera."""
        if (self.turn == np.eye(3)).all():
            return pose
        return CameraPose(self.turn @ pose.rotation, self.turn @ pose.translation)


def straightener(recording: Recording, width: int, height: int, scale: float) -> Straightener:
    """The maps of a recording with pictures of this size.

    Raises:  InputError without intrinsics, for a scale outside (0, 1], and for cameras that are not side by side.
    """
    if not 0 < scale <= 1:
        raise InputError(f"scale {scale:g}: pictures can only be reduced; allowed: values in (0, 1]")
    new_size = round(width * scale), round(height * scale)
    if min(new_size) < 1:
        raise InputError(f"scale {scale:g} makes {new_size[0]}x{new_size[1]} pixels of {width}x{height}")
    if recording.rig is not None:
        return _rectified(recording, new_size)
    lens = recording.lens
    if lens is None:
        raise InputError(
            f"{recording.where}: the intrinsics are unknown; allowed: --camera FX FY CX CY in pixels, or"
            " --calibration FILE"
        )
    if (lens.width, lens.height) != (width, height):
        raise InputError(
            f"{recording.where}: the intrinsics are of {lens.width}x{lens.height} pixels, the pictures have"
            f" {width}x{height}"
        )
    if not any(lens.distortion):
        plain = lens._replace(distortion=())
        return Straightener(
            plain.scaled(*new_size), None, None, np.eye(3), recording.baseline, [], recording.depth_clipped
        )
    maps = undistortion_maps(opencv_matrix(lens), np.array(lens.distortion), width, height)
    new = lens_of_matrix(maps.matrix, width, height, where=recording.where)
    note = f"undistorted: distortion {', '.join(f'{k:g}' for k in lens.distortion)}"
    return Straightener(
        new.scaled(*new_size), maps, maps, np.eye(3), recording.baseline, [note], recording.depth_clipped
    )


def _rectified(recording: Recording, new_size: tuple[int, int]) -> Straightener:
    rig = recording.rig
    assert rig is not None
    across, down = abs(rig.translation[0]), abs(rig.translation[1])
    if down > SKEWED * across:
        raise InputError(
            f"{recording.where}: the cameras are {across:g} apart horizontally and {down:g} vertically;"
            " allowed: side by side"
        )
    if recording.depth is not None:
        raise InputError(f"{recording.where}: depth of pictures that are not rectified; allowed: without --depth")
    distortions = np.array(rig.left.distortion or (0.0,) * 4), np.array(rig.right.distortion or (0.0,) * 4)
    matrices = opencv_matrix(rig.left), opencv_matrix(rig.right)
    width, height = rig.left.width, rig.left.height
    maps = rectification_maps(matrices, distortions, rig.rotation, rig.translation, width, height)
    if maps.baseline <= 0:
        raise InputError(
            f"{recording.where}: the calibration states that the right camera is on the left; are the pictures, or the"
            " sections of the calibration, swapped?"
        )
    lens = lens_of_matrix(maps.left.matrix, width, height, where=recording.where).scaled(*new_size)
    angle = degrees_between(maps.left.rotation, np.eye(3))
    note = f"rectified: baseline {maps.baseline:.6g} mm, left camera turned by {angle:.3g} degrees"
    return Straightener(lens, maps.left, maps.right, maps.left.rotation, maps.baseline, [note])
