"""The frames of a clip as the registration uses them: pictures, tissue, depth and intrinsics."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.opencv.regions import grown_by_square, shrunk_by_square
from endotsr.method.kernels.arrays import BoolArray
from endotsr.method.splatting.camera import Camera, CameraPose, scale_camera

WIDEST = 320  # columns of the pictures whose flow is computed
BRIGHT, SATURATED, DARK = 200, 253, 12  # grey levels: a highlight has all channels over, or one at; a dark pixel, none
HALO = 2  # pixels around a highlight
MARGIN = 3  # pixels of tissue that a usable pixel has on every side


IDENTITY = CameraPose(np.eye(3), np.zeros(3))


class Views(NamedTuple):
    """n frames of H x W pixels with one set of intrinsics."""

    images: NDArray[np.uint8]  # (n, 3, H, W) display RGB
    tissue: BoolArray  # (n, H, W)
    depth: NDArray[np.float32]  # (n, H, W) scene units; 0, negative or not finite = no depth
    camera: Camera  # intrinsics; its pose is not used

    @property
    def count(self) -> int:
        """Number of frames n."""
        return len(self.images)

    def frame(self, number: int) -> "ViewFrame":
        """One frame."""
        return ViewFrame(self.images[number], self.tissue[number], self.depth[number])


def compose(after: CameraPose, before: CameraPose) -> CameraPose:
    """The pose that applies `before`, then `after`."""
    return CameraPose(after.rotation @ before.rotation, after.rotation @ before.translation + after.translation)


def inverse(pose: CameraPose) -> CameraPose:
    """The opposite pose."""
    return CameraPose(pose.rotation.T, -pose.rotation.T @ pose.translation)


def between(poses: list[CameraPose], source: int, target: int) -> CameraPose:
    """The pose of the target camera relative to the source camera."""
    return compose(poses[target], inverse(poses[source]))


def known_depth(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """The depth, with 0 where it is negative or not finite."""
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def usable_pixels(image: NDArray[np.uint8], tissue: BoolArray) -> BoolArray:
    """Tissue that shows texture: without highlights and dark pixels, and without a margin. (3, H, W) to (H, W)."""
    largest, smallest = image.max(axis=0), image.min(axis=0)
    highlight = grown_by_square((smallest > BRIGHT) | (largest >= SATURATED), HALO)
    return shrunk_by_square(tissue & ~highlight & (largest >= DARK), MARGIN)


class ViewFrame(NamedTuple):
    """One frame of H x W pixels."""

    image: NDArray[np.uint8]  # (3, H, W)
    tissue: BoolArray  # (H, W)
    depth: NDArray[np.float32]  # (H, W)

    def reduced(self, side: int) -> "ViewFrame":
        """The frame averaged over squares of pixels; rows and columns that fill no square are cut off.

        A square is tissue if all its pixels are, and has the depth of one of its central pixels.
        """
        if side == 1:
            return self
        rows, columns = (size // side for size in self.tissue.shape)
        height, width = rows * side, columns * side
        picture = np.ascontiguousarray(self.image[:, :height, :width].transpose(1, 2, 0))
        image = np.ascontiguousarray(area_resize(picture, columns, rows).transpose(2, 0, 1))
        tissue = np.asarray(self.tissue[:height, :width].reshape(rows, side, columns, side).all(axis=(1, 3)))
        return ViewFrame(image, tissue, self.depth[side // 2 : height : side, side // 2 : width : side])


def side_of(width: int, widest: int = WIDEST) -> int:
    """Side of the squares that reduce a picture to at most `widest` columns."""
    return -(-width // widest)


def reduced_camera(camera: Camera, side: int) -> Camera:
    """The camera of pictures reduced by `ViewFrame.reduced`."""
    rows, columns = camera.height // side, camera.width // side
    return scale_camera(camera._replace(width=columns * side, height=rows * side), columns, rows)


def small_views(views: Views) -> Views:
    """The frames reduced to at most `WIDEST` columns; the same frames if they are narrower."""
    side = side_of(views.camera.width)
    if side == 1:
        return views
    frames = [views.frame(k).reduced(side) for k in range(views.count)]
    images, tissue, depth = (np.stack(planes) for planes in zip(*frames))
    return Views(images, tissue, depth, reduced_camera(views.camera, side))
