"""Frames at a smaller size: for `sequence.scale`, and for the coarse start (specification B17).

A picture is averaged over areas. A pixel is tissue if all pixels it covers are. A depth is the mean of the known depths
it covers. In: the arrays of all frames, or a `Sequence`. Out: the same at a smaller size.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.depth_files import reduced_depth
from endotsr.clips.sequences.frame_store import FrameStore
from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera, scale_camera

LEAST_SIDE = 16  # pixels; the three-level pyramid needs this many


def too_small(width: int, height: int, made: str = "") -> str:
    """Why a training needs larger pictures; "" if these are large enough. `made`: how they came to this size."""
    if min(width, height) >= LEAST_SIDE:
        return ""
    return f"{made or f'images of {width}x{height} pixels'}; use at least {LEAST_SIDE} on each side"


def trained_size(width: int, height: int, scale: float, where: object) -> tuple[int, int]:
    """Width and height at `sequence.scale`. Raises InputError for a scale outside (0, 1], and for small pictures."""
    if scale > 1:
        raise InputError(f"{where}: scale {scale:g}: images can only be reduced; use values in (0, 1]")
    small = round(width * scale), round(height * scale)
    made = "" if scale == 1 else f"scale {scale:g} makes {small[0]}x{small[1]} pixels of {width}x{height}"
    if found := too_small(*small, made):
        raise InputError(f"{where}: {found}")
    return small


def smaller_frames(
    images: NDArray[np.uint8],
    masks: NDArray[np.bool_],
    depth: NDArray[np.float32],
    width: int,
    height: int,
    memory: float,
    where: object,
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], NDArray[np.float32]]:
    """Pictures (n, 3, H, W), masks and depth (n, H, W) at a smaller size; `memory` and `where` as in `FrameStore`."""
    from endotsr.clips.opencv.filters import area_resize

    n = len(images)
    store = FrameStore(n, width, height, memory, where)
    small, tissue = store.array((n, 3, height, width), np.uint8), store.array((n, height, width), bool)
    prior = store.array((n, height, width), np.float32)
    for i in range(n):
        small[i] = area_resize(images[i].transpose(1, 2, 0), width, height).transpose(2, 0, 1)
        tissue[i] = area_resize((~masks[i]).astype(np.float32), width, height) == 0
        prior[i] = reduced_depth(depth[i], width, height)
    return small, tissue, prior


def smaller_cameras(cameras: list[Camera], width: int, height: int) -> list[Camera]:
    """The cameras for smaller pictures, with aligned picture edges. A shared object remains shared."""
    scaled = {id(camera): scale_camera(camera, width, height) for camera in cameras}
    return [scaled[id(camera)] for camera in cameras]


def smaller(sequence: Sequence, width: int, height: int, memory: float, where: object) -> Sequence:
    """The same frames, times and split at a smaller size; `memory` and `where` as in `FrameStore`."""
    images, masks, depth = smaller_frames(sequence.images, sequence.masks, sequence.depth, width, height, memory, where)
    cameras = smaller_cameras(sequence.cameras, width, height)  # (20.6)
    return replace(sequence, images=images, masks=masks, depth=depth, cameras=cameras)


def halved(sequence: Sequence, memory: float) -> Sequence:
    """The same frames, times and split with floor(W/2) x floor(H/2) pixels; `memory` as in `FrameStore`."""
    return smaller(sequence, sequence.width // 2, sequence.height // 2, memory, "half size")


def resized_nearest(plane: NDArray, width: int, height: int, where: object) -> NDArray:
    """A plane (H, W) at another size by nearest-neighbour sampling, which invents no intermediate values.

    Raises:  InputError for another aspect ratio.
    """
    rows, columns = plane.shape
    if (rows, columns) == (height, width):
        return plane
    if abs(columns * height - rows * width) > max(columns, width, rows, height):  # more than rounding
        raise InputError(f"{where}: {columns}x{rows} pixels, the pictures have {width}x{height}: another aspect ratio")
    row = ((np.arange(height) + 0.5) * rows / height).astype(np.intp)
    column = ((np.arange(width) + 0.5) * columns / width).astype(np.intp)
    return plane[row][:, column]
