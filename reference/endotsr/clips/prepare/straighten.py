"""Undistortion, rectification and resizing of a clip to the pictures of one pinhole camera.

In: a `Clip` and a scale. Out: a `Straightener`, which maps pictures, masks, depth and poses, and the intrinsics of the
new pictures. Left and right each have their own distortion.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import Intrinsics, intrinsics_of_matrix, opencv_matrix
from endotsr.clips.formats.files import shortened, visible_files
from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.opencv.stereo import Maps, rectification_maps, remapped, undistortion_maps
from endotsr.clips.prepare.lens import lens_warnings
from endotsr.clips.sequences.clip import Clip, Picture, PicturePair
from endotsr.clips.sequences.depth_files import CLIPPED, clip_depth, reduced_depth
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose, degrees_between
from endotsr.untrusted.names import plain_line

SKEWED = 0.5  # largest vertical over horizontal offset of two cameras that count as side by side


@dataclass(frozen=True)
class Straightener:
    """The maps of a clip, and the size of the new pictures."""

    intrinsics: Intrinsics  # of the new pictures, without distortion
    left: Maps | None  # None: as stored
    right: Maps | None
    turn: FloatArray  # (3, 3) x_new = turn @ x_old, camera axes of the left picture
    baseline: float | None
    notes: list[str]
    clipped: bool = False  # the depth of the clip is already clipped
    resized: bool = False  # the new pictures have another size

    def pictures(self, pair: PicturePair) -> PicturePair:
        """Both pictures in the new camera."""
        left = self._picture(pair.left, self.left)
        return PicturePair(left, None if pair.right is None else self._picture(pair.right, self.right))

    def _picture(self, picture: Picture, maps: Maps | None) -> Picture:
        return area_resize(remapped(picture, maps) if maps else picture, self.intrinsics.width, self.intrinsics.height)

    def mask(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Tissue where all covered pixels of the old mask are tissue."""
        if self.left:
            mask = remapped(mask.astype(np.uint8), self.left, nearest=True) > 0
        return area_resize((~mask).astype(np.float32), self.intrinsics.width, self.intrinsics.height) == 0

    def depth(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mean of the depths that a new pixel covers, or 0 if it covers none.

        Before resizing, depth is clipped to `CLIPPED`, as in training at a scale: an outlier must not be averaged into
        its neighbours. Depth of unchanged size is clipped by training.
        """
        if self.left:
            depth = remapped(depth, self.left, nearest=True)
        if depth.shape == (self.intrinsics.height, self.intrinsics.width):
            return depth
        plane = depth if self.clipped else clip_depth(depth, CLIPPED)
        return reduced_depth(plane, self.intrinsics.width, self.intrinsics.height)

    def pose(self, pose: CameraPose) -> CameraPose:
        """World-to-camera of the new left camera."""
        if (self.turn == np.eye(3)).all():
            return pose
        return CameraPose(self.turn @ pose.rotation, self.turn @ pose.translation)


def straightener(clip: Clip, width: int, height: int, scale: float) -> Straightener:
    """The maps of a clip with pictures of this size.

    Raises:  InputError without intrinsics, for a scale outside (0, 1], and for cameras that are not side by side.
    """
    if not 0 < scale <= 1:
        raise InputError(f"scale {scale:g}: pictures can only be reduced; use values in (0, 1]")
    new_size = round(width * scale), round(height * scale)
    if min(new_size) < 1:
        raise InputError(f"scale {scale:g} makes {new_size[0]}x{new_size[1]} pixels of {width}x{height}")
    if clip.calibration is not None:
        return _rectified(clip, new_size)
    intrinsics = clip.intrinsics
    if intrinsics is None:
        raise InputError(
            f"{clip.where}: the intrinsics are unknown; use --camera FX FY CX CY in pixels, --calibration FILE, or"
            f" --field-of-view DEGREES, the angle from the left to the right border{_calibrations_beside(clip.where)}"
        )
    if (intrinsics.width, intrinsics.height) != (width, height):
        raise InputError(
            f"{clip.where}: the intrinsics are of {intrinsics.width}x{intrinsics.height} pixels, the pictures have"
            f" {width}x{height}{_resized(intrinsics, width, height)}"
        )
    clipped = clip.depth is not None and bool(clip.depth.clipped)
    if not any(intrinsics.distortion):
        plain = intrinsics._replace(distortion=())
        return Straightener(
            plain.scaled(*new_size), None, None, np.eye(3), clip.baseline, [], clipped, new_size != (width, height)
        )
    maps = undistortion_maps(opencv_matrix(intrinsics), np.array(intrinsics.distortion), width, height)
    new = intrinsics_of_matrix(maps.matrix, width, height, where=clip.where)
    notes = [f"undistorted: distortion {', '.join(f'{k:g}' for k in intrinsics.distortion)}"]
    notes += lens_warnings(maps.matrix, np.array(intrinsics.distortion), width, height)
    resized = new_size != (width, height)
    return Straightener(new.scaled(*new_size), maps, maps, np.eye(3), clip.baseline, notes, clipped, resized)


def _resized(intrinsics: Intrinsics, width: int, height: int) -> str:
    """The end of a message on pictures of another size than the intrinsics, with the remedy."""
    factor = width / intrinsics.width
    alike = abs(height - factor * intrinsics.height) <= 1  # the same shape, up to rounding
    if not alike:
        return "; use the pictures from which the intrinsics were made: these were cropped or squeezed"
    reduced = f", and --scale {factor:.4g}" if factor < 1 else ""
    return f"; use pictures of {intrinsics.width}x{intrinsics.height}{reduced}"


def _calibrations_beside(source: Path) -> str:
    """The end of a message that lists the files with the name of a calibration beside a recording, or in its folder."""
    folder = source if source.is_dir() else source.parent
    found = [file for file in visible_files(folder) if "calib" in file.name.lower() and file.is_file()]
    return f"; by its name a calibration: {shortened([plain_line(str(file)) for file in found])}" if found else ""


def _rectified(clip: Clip, new_size: tuple[int, int]) -> Straightener:
    calibration = clip.calibration
    assert calibration is not None
    across, down = abs(calibration.translation[0]), abs(calibration.translation[1])
    if down > SKEWED * across:
        raise InputError(
            f"{clip.where}: the cameras are {across:g} apart horizontally and {down:g} vertically; use side by side"
        )
    if clip.depth is not None:
        raise InputError(f"{clip.where}: depth of pictures that are not rectified; prepare them without --depth")
    distortions = (
        np.array(calibration.left.distortion or (0.0,) * 4),
        np.array(calibration.right.distortion or (0.0,) * 4),
    )
    matrices = opencv_matrix(calibration.left), opencv_matrix(calibration.right)
    width, height = calibration.left.width, calibration.left.height
    maps = rectification_maps(matrices, distortions, calibration.rotation, calibration.translation, width, height)
    if maps.baseline <= 0:
        raise InputError(
            f"{clip.where}: the calibration states that the right camera is on the left; are the pictures, or the"
            " sections of the calibration, swapped?"
        )
    intrinsics = intrinsics_of_matrix(maps.left.matrix, width, height, where=clip.where).scaled(*new_size)
    angle = degrees_between(maps.left.rotation, np.eye(3))
    notes = [f"rectified: baseline {maps.baseline:.6g} mm, left camera turned by {angle:.3g} degrees"]
    for view, distortion in zip((maps.left, maps.right), distortions):
        notes += lens_warnings(view.matrix, distortion, width, height)
    return Straightener(intrinsics, maps.left, maps.right, maps.left.rotation, maps.baseline, notes)
