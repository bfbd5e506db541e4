"""Pictures of a run as 8-bit RGB arrays: render / truth / error with a 4x inset, colour-mapped depth, encoders.

Colour maps are perceptually uniform (error: magma, depth: viridis). Excluded pixels are neutral grey; values that are
not finite are magenta, to distinguish them from dark pixels. matplotlib and Pillow are imported on first use.
"""

import base64
import io
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray

ByteImage = NDArray[np.uint8]  # (H, W, 3), RGB

ERROR_MAP = "magma"
DEPTH_MAP = "viridis"
EXCLUDED = (96, 96, 102)
NOT_FINITE = (255, 0, 255)
SELDOM_SEEN = {0: (0, 220, 255), 1: (255, 196, 0)}  # number of training frames that show a pixel -> colour
INSET_FACTOR = 4
GAP = 6  # pixels between the pictures of one frame
ERROR_SCALES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # few values: similar runs get the same scale


class Triptych(NamedTuple):
    """Three pictures of one frame and the window to enlarge."""

    render: ByteImage  # (H, W, 3)
    truth: ByteImage  # (H, W, 3)
    error: ByteImage  # (H, W, 3), colour map from 0 to `scale`
    row: int  # top edge of the window, pixels
    column: int  # left edge of the window
    height: int  # a quarter of H, at least 1
    width: int  # a quarter of W, at least 1
    scale: float  # error of the brightest colour, display units [0, 1]

    def window(self, image: ByteImage) -> ByteImage:
        """The part of `image` in the window, at its original size."""
        return image[self.row : self.row + self.height, self.column : self.column + self.width]


def bytes_image(image: FloatArray) -> ByteImage:
    """(3, H, W) in display units -> (H, W, 3) uint8, clipped and rounded; values that are not finite are magenta."""
    rounded = np.rint(np.clip(np.nan_to_num(image, nan=0.0), 0, 1) * 255).astype(np.uint8)
    out = np.ascontiguousarray(rounded.transpose(1, 2, 0))
    out[~np.isfinite(image).all(axis=0)] = NOT_FINITE
    return out


def tissue_error(render: FloatArray, truth: FloatArray, mask: NDArray[np.bool_]) -> FloatArray:
    """Absolute error of the clipped render, averaged over the channels, (H, W); 0 outside the mask.

    render, truth   (3, H, W) display units [0, 1];  mask (H, W), True = tissue.  NaN in the render stays NaN.
    """
    return np.where(mask, np.abs(np.clip(render, 0, 1) - truth).mean(axis=0), 0.0)


def error_scale(errors: list[FloatArray]) -> float:
    """The smallest ERROR_SCALES value at or above the 99th percentile of all non-zero errors of one or more frames."""
    found = [e[np.isfinite(e) & (e > 0)] for e in errors]
    values = np.concatenate([np.zeros(1), *found])
    level = float(np.percentile(values[1:], 99)) if values.size > 1 else 0.0
    return next((step for step in ERROR_SCALES if step >= level), ERROR_SCALES[-1])


def worst_window(error: FloatArray, height: int, width: int) -> tuple[int, int]:
    """Top-left corner (row, column) of the height x width window with the largest error sum; ties: top, then left.

    A value that is not finite counts more than any window of errors <= 1.
    """
    finite = np.nan_to_num(error.astype(np.float64), nan=error.size, posinf=error.size)
    table = np.pad(finite.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    sums = table[height:, width:] - table[:-height, width:] - table[height:, :-width] + table[:-height, :-width]
    row, column = np.unravel_index(int(np.argmax(sums)), sums.shape)
    return int(row), int(column)


def triptych(render: FloatArray, truth: FloatArray, mask: NDArray[np.bool_], scale: float | None = None) -> Triptych:
    """Render, truth and error map of one frame, with the window of the largest tissue error.

    render, truth   (3, H, W) display units [0, 1];  mask (H, W), True = tissue
    scale           error of the brightest colour; None = `error_scale` of this frame
    """
    error = tissue_error(render, truth, mask)
    scale = error_scale([error]) if scale is None else scale
    height, width = (max(1, side // INSET_FACTOR) for side in error.shape)
    row, column = worst_window(error, height, width)
    colours = colour_mapped(error, 0.0, scale, ERROR_MAP)
    colours[~mask] = EXCLUDED
    return Triptych(bytes_image(render), bytes_image(truth), colours, row, column, height, width, scale)


def triptych_picture(panels: Triptych) -> ByteImage:
    """One picture: the three images with the window framed, and the window enlarged 4x below each."""
    columns = []
    for image in (panels.render, panels.truth, panels.error):
        enlarged = panels.window(image).repeat(INSET_FACTOR, axis=0).repeat(INSET_FACTOR, axis=1)
        inset = np.full_like(image, 255)
        inset[: enlarged.shape[0], : enlarged.shape[1]] = enlarged[: image.shape[0], : image.shape[1]]
        bar = np.full((GAP, image.shape[1], 3), 255, np.uint8)
        columns += [np.concatenate([framed(image, panels), bar, inset])]
    side = np.full((columns[0].shape[0], GAP, 3), 255, np.uint8)
    return np.concatenate([columns[0], side, columns[1], side, columns[2]], axis=1)


def framed(image: ByteImage, panels: Triptych) -> ByteImage:
    """A copy of `image` with a white and black border around the window."""
    out = image.copy()
    thick = max(1, image.shape[1] // 320)
    for grow, colour in ((2 * thick, 0), (thick, 255)):
        y0, x0 = max(panels.row - grow, 0), max(panels.column - grow, 0)
        y1, x1 = panels.row + panels.height + grow, panels.column + panels.width + grow
        out[y0:y1, x0:x1] = colour
    y, x = panels.row, panels.column
    out[y : y + panels.height, x : x + panels.width] = panels.window(image)
    return out


def depth_range(depth: FloatArray, mask: NDArray[np.bool_] | None = None) -> tuple[float, float]:
    """1st and 99th percentile of the positive finite depths in the mask; (0, 1) if there are none."""
    known = np.isfinite(depth) & (depth > 0)
    values = depth[known if mask is None else known & mask]
    if values.size == 0:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(values, (1, 99)))
    return low, high if high > low else low + 1.0


def depth_picture(depth: FloatArray, low: float, high: float, mask: NDArray[np.bool_] | None = None) -> ByteImage:
    """Depth (H, W), colour-mapped from `low` (near, dark) to `high` (far, bright); grey if excluded or <= 0."""
    colours = colour_mapped(depth, low, high, DEPTH_MAP)
    absent = depth <= 0
    colours[absent if mask is None else absent | ~mask] = EXCLUDED
    return colours


def seen_picture(truth: FloatArray, mask: NDArray[np.bool_], seen: NDArray[np.int32] | None) -> ByteImage:
    """The truth, darkened, with the tissue pixels of `SELDOM_SEEN` in their colours; grey where excluded.

    seen   (H, W) number of training frames in which a pixel is tissue; None: no pixel is marked
    """
    colours = bytes_image(truth) // 3
    for times, colour in SELDOM_SEEN.items() if seen is not None else ():
        colours[mask & (seen == times)] = colour
    colours[~mask] = EXCLUDED
    return colours


def colour_mapped(values: FloatArray, low: float, high: float, name: str) -> ByteImage:
    """(H, W) -> (H, W, 3): colour map `name` from low to high, clipped; values that are not finite are magenta."""
    finite = np.isfinite(values)
    level = np.clip((np.where(finite, values, low) - low) / (high - low), 0, 1)
    colours = colour_table(name)[np.rint(level * 255).astype(np.intp)]
    colours[~finite] = NOT_FINITE
    return colours


def colour_table(name: str) -> ByteImage:
    """The 256 colours of a matplotlib map, (256, 3) uint8."""
    from matplotlib import colormaps

    return np.rint(colormaps[name](np.arange(256))[:, :3] * 255).astype(np.uint8)


def encode(image: ByteImage, kind: str = "png") -> bytes:
    """An (H, W, 3) image, or (H, W, 4) with opacity, as the bytes of a file.

    kind   `png` (lossless) or `webp` (quality 90)
    """
    from PIL import Image

    buffer = io.BytesIO()
    options = {"png": {}, "webp": {"quality": 90, "method": 3}}[kind]
    Image.fromarray(image).save(buffer, format=kind, **options)
    return buffer.getvalue()


def data_uri(content: bytes, kind: str) -> str:
    """The bytes of an image file as a data URI."""
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
