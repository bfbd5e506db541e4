"""A view as an 8-bit picture: one panel, or several side by side under one height.

In: a rendered view and, for truth and error, the frame it shows. Out: (H, W, 3) uint8.
"""

from typing import Literal, NamedTuple

import numpy as np

from endotsr.kernels.arrays import FloatArray
from endotsr.report.figures import (
    ERROR_MAP,
    EXCLUDED,
    ByteImage,
    bytes_image,
    colour_mapped,
    depth_picture,
    depth_range,
    tissue_error,
)
from endotsr.sequences.sequence import Frame
from endotsr.splatting.render import RenderOut

Panel = Literal["render", "truth", "error", "depth", "opacity"]
NEEDS_TRUTH: tuple[Panel, ...] = ("truth", "error")
GAP = 4  # pixels between panels
ERROR_SCALE = 0.1  # display units of the brightest colour of an error


class Scale(NamedTuple):
    """What the colours of a series of pictures mean, the same in all of them."""

    near: float  # depth of the darkest colour, scene units
    far: float
    error: float = ERROR_SCALE


def scale_of(depth: FloatArray) -> Scale:
    """The colours of a series, from the depth of its first view."""
    return Scale(*depth_range(depth))


def panel(kind: Panel, out: RenderOut, scale: Scale, frame: Frame | None = None) -> ByteImage:
    """One panel.

    out      rendered view, its depth as it is to be shown
    frame    the frame at this time from this camera; needed for truth and error
    """
    if kind == "render":
        return bytes_image(out.colour)
    if kind == "depth":
        return depth_picture(out.depth, scale.near, scale.far)
    if kind == "opacity":
        return bytes_image(np.broadcast_to(out.opacity, (3, *out.opacity.shape)))
    if frame is None:
        raise ValueError(f"panel {kind!r} needs the frame")
    if kind == "truth":
        return bytes_image(frame.image)
    colours = colour_mapped(tissue_error(out.colour, frame.image, frame.mask), 0.0, scale.error, ERROR_MAP)
    colours[~frame.mask] = EXCLUDED
    return colours


def side_by_side(kinds: tuple[Panel, ...], out: RenderOut, scale: Scale, frame: Frame | None = None) -> ByteImage:
    """The panels in a row, with a white gap between them."""
    pictures = [panel(kind, out, scale, frame) for kind in kinds]
    gap = np.full((pictures[0].shape[0], GAP, 3), 255, np.uint8)
    row = [pictures[0], *(part for picture in pictures[1:] for part in (gap, picture))]
    return np.concatenate(row, axis=1)
