"""A view as an 8-bit picture: one panel, or several in a row.

In: a rendered view and, for truth and error, the recorded frame. Out: (H, W, 3) uint8.
"""

from typing import Literal, NamedTuple

import numpy as np

from endotsr.clips.sequences.sequence import Frame
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.render import RenderOut
from endotsr.results.report.figures import (
    ERROR_MAP,
    EXCLUDED,
    ByteImage,
    bytes_image,
    colour_mapped,
    depth_picture,
    depth_range,
    tissue_error,
)

Panel = Literal["render", "truth", "error", "depth", "opacity"]
NEEDS_TRUTH: tuple[Panel, ...] = ("truth", "error")
GAP = 4  # pixels between panels
ERROR_SCALE = 0.1  # error of the brightest colour, display units


class Scale(NamedTuple):
    """The colour scale of a series of pictures."""

    near: float  # depth of the darkest colour, scene units
    far: float  # depth of the brightest colour
    error: float = ERROR_SCALE  # error of the brightest colour


def scale_of(depth: FloatArray) -> Scale:
    """The colour scale of a series, from the depth of its first view."""
    return Scale(*depth_range(depth))


def panel(kind: Panel, out: RenderOut, scale: Scale, frame: Frame | None = None) -> ByteImage:
    """One panel.

    out      rendered view; its depth is shown unchanged
    frame    the recorded frame of this time and camera; required for truth and error
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
