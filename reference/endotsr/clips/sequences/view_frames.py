"""Frames of a clip as the estimation of poses takes them: one on demand, or all in memory."""

import numpy as np

from endotsr.clips.poses.views import ViewFrame, Views
from endotsr.clips.sequences.clip import Clip, Picture
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera


def view_frame(clip: Clip, k: int) -> ViewFrame:
    """Picture, tissue and depth of one frame; all tissue without a mask, 0 without depth.

    Raises:  InputError for a file that cannot be read, or of another size.
    """
    return with_planes(clip, k, next(clip.pictures([k])).left)


def with_planes(clip: Clip, k: int, picture: Picture) -> ViewFrame:
    """As `view_frame`, with the picture given."""
    size = picture.shape[:2]
    tissue, depth = clip.masks(k) if clip.masks else None, clip.depth(k) if clip.depth else None
    for what, plane in (("mask", tissue), ("depth", depth)):
        if plane is not None and plane.shape != size:
            raise InputError(
                f"{clip.where}: frame {clip.names[k]}: the {what} has {plane.shape[1]}x{plane.shape[0]} pixels, the"
                f" picture {size[1]}x{size[0]}"
            )
    return frame_of(picture, tissue, depth)


def frame_of(picture: Picture, tissue: BoolArray | None = None, depth: FloatArray | None = None) -> ViewFrame:
    """A frame from its picture (H, W, 3), tissue and depth (H, W); all tissue without a mask, 0 without depth."""
    size, planes = picture.shape[:2], np.ascontiguousarray(picture.transpose(2, 0, 1))
    mask = np.ones(size, bool) if tissue is None else tissue
    return ViewFrame(planes, mask, np.zeros(size, np.float32) if depth is None else depth.astype(np.float32))


def views_of(clip: Clip, camera: Camera) -> Views:
    """All frames of a clip. Raises InputError as `view_frame`."""
    frames = [view_frame(clip, k) for k in range(clip.count)]
    images, tissue, depth = (np.stack(planes) for planes in zip(*frames))
    return Views(images, tissue, depth, camera)
