"""The window of the source pictures that a cropped clip shows.

A calibration is judged by the whole picture: the axis of a cropped picture is where the crop left it. In: the window
of `prepare --crop`, or the keys `crop` and `crop_of` of `sequence.toml`. Out: a `Crop`.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from endotsr.clips.formats.camera import Intrinsics
from endotsr.errors import InputError

if TYPE_CHECKING:
    from endotsr.method.splatting.camera import Camera

ROUNDING = 1e-6  # pixels by which a window of a window may seem to leave the picture


class Crop(NamedTuple):
    """A window of pictures, in their pixels. It counts for pictures of any size that show this window."""

    x: float
    y: float
    width: float
    height: float
    of_width: float  # of the pictures before the crop
    of_height: float

    def before(self, camera: "Camera | Intrinsics") -> Intrinsics:
        """The intrinsics of the pictures before the crop, from those of the cropped and possibly resized ones."""
        across, down = self.width / camera.width, self.height / camera.height
        return Intrinsics(
            camera.fx * across, camera.fy * down, self.x + camera.cx * across, self.y + camera.cy * down,
            round(self.of_width), round(self.of_height),
        )  # fmt: skip


def crop_within(window: tuple[int, ...], camera: Intrinsics | None, crop: Crop | None) -> Crop | None:
    """The window x, y, width, height of pictures that already show a crop of others; None without a camera.

    Raises:  InputError for an empty window.
    """
    if len(window) != 4 or min(window[:2]) < 0 or min(window[2:]) < 1:
        raise InputError(f"--crop {' '.join(map(str, window))}: use X Y WIDTH HEIGHT in pixels, inside a picture")
    if camera is None:
        return None
    whole = crop or Crop(0, 0, camera.width, camera.height, camera.width, camera.height)
    across, down = whole.width / camera.width, whole.height / camera.height
    x, y, width, height = window
    return whole._replace(
        x=whole.x + x * across, y=whole.y + y * down, width=width * across, height=height * down
    )  # fmt: skip


def stated_crop(crop: list[float], crop_of: list[float], where: object) -> Crop | None:
    """The window that a file states; None without one. Raises InputError for a window outside of its picture."""
    if not crop and not crop_of:
        return None
    numbers = [*crop, *crop_of]
    if len(crop) == 4 and len(crop_of) == 2 and np.isfinite(numbers).all():
        found = Crop(*numbers)
        inside = found.x + found.width <= found.of_width + ROUNDING and (
            found.y + found.height <= found.of_height + ROUNDING
        )
        if inside and min(crop[:2]) >= 0 and min(crop[2:]) > 0:
            return found
    raise InputError(
        f"{where}: camera.crop = {crop} with camera.crop_of = {crop_of} is not allowed; use x y width height of a"
        " window inside of a picture with this width and height, or neither key"
    )
