"""The room that works with OpenCV: PNG files, Canny edges, flow, warps, regions, resizing. See also `pictures`,
`geometry` and `stereo`.

Inputs and outputs are NumPy arrays in this project's conventions (RGB order, planar flow). OpenCV's own conventions
(BGR, interleaved flow, one-dimensional arrays that differ between versions 4 and 5) do not leave this room. `library`
imports `cv2` on first use: commands that read no picture start without it. Golden vectors depend on this room only
through the Canny edges, an input of the smoothness loss.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.library import cv2_library as _cv2
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import Array
from endotsr.untrusted.files import read_bytes
from endotsr.untrusted.png import LARGEST_FILE, pixels_only

CANNY_LOW, CANNY_HIGH = 20, 200  # ruling: thresholds of the released smoothness term, on 8-bit depth
LARGEST_DISC = 12  # px; in a trial without a record, a dilation took a third of the time of a distance transform there


def decode_png(data: bytes, name: object) -> Array:
    """Pixels of a PNG in memory; `name` is used in messages only. See `read_png`."""
    return decoded(pixels_only(data, name), name, "cannot be decoded as a PNG picture")


def decoded(data: bytes, name: object, failure: str) -> Array:
    """Pixels of a picture in memory whose bytes were checked: (H, W) grey or (H, W, 3) RGB, in the stored type.

    failure   message for a picture that OpenCV cannot decode

    Raises:  InputError naming the picture.
    """
    cv2 = _cv2()
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise InputError(f"{name}: cannot be decoded: {str(error).strip().splitlines()[-1]}") from None
    if pixels is None:
        raise InputError(f"{name}: {failure}")
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[:, :, 0]
    if pixels.ndim == 3:
        pixels = opaque(pixels, name)[:, :, ::-1]  # from BGR
    return np.ascontiguousarray(pixels)


def opaque(pixels: Array, name: object) -> Array:
    """The three colour channels of a picture (H, W, 3) or (H, W, 4). Raises InputError if a pixel is transparent."""
    if pixels.shape[2] == 4 and pixels.dtype.kind == "u" and pixels[:, :, 3].min() < np.iinfo(pixels.dtype).max:
        raise InputError(
            f"{name}: has transparent pixels, and what they hide is not shown; allowed: pictures without"
            " transparency (a mask that is stored as transparency is stored as black and white)"
        )
    return pixels[:, :, :3]


def read_png(path: Path) -> Array:
    """Pixels of a PNG file.

    returns  (H, W) grey or (H, W, 3) RGB, uint8 or uint16 as stored

    Raises:  InputError naming the file if it is missing, no regular file, not a PNG, truncated, damaged, too large, or
             not opaque. The chunks and the number of compressed pixels are checked first, because OpenCV decodes a
             truncated file into a half-grey picture without an error.
    """
    return decode_png(read_bytes(path, LARGEST_FILE), path)


def write_png(path: Path, pixels: Array) -> None:
    """Write (H, W) grey or (H, W, 3) RGB pixels, uint8 or uint16. `read_png` returns the same array.

    Raises:  ValueError for another shape or dtype; InputError if the file cannot be written.
    """
    pixels = np.asarray(pixels)
    if pixels.dtype not in (np.uint8, np.uint16) or not (pixels.ndim == 2 or pixels.shape[2:] == (3,)):
        raise ValueError(f"{path}: PNG needs (H, W) or (H, W, 3) of uint8 or uint16, not {pixels.shape} {pixels.dtype}")
    write_encoded(path, pixels, ".png", ())


def write_encoded(path: Path, pixels: Array, ending: str, options: tuple[int, ...]) -> None:
    """Write grey or RGB pixels in the format of an ending. Raises InputError if the file cannot be written."""
    ordered = np.ascontiguousarray(pixels[:, :, ::-1] if pixels.ndim == 3 else pixels)
    done, encoded = _cv2().imencode(ending, ordered, options)
    if not done:
        raise InputError(f"{path}: the picture cannot be encoded as {ending[1:].upper()}")
    try:
        Path(path).write_bytes(encoded.tobytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None


def canny_edges(depth: Array) -> NDArray[np.bool_]:
    """Edges of a rendered depth image, for the smoothness loss (B9). They are held fixed: no gradient passes.

    depth    (H, W) scene units; clipped to [0, 255] and truncated to 8 bits (a depth of 300 becomes 255, not 44); NaN
             counts as 0
    returns  (H, W) bool, True on an edge; Sobel 3x3, |gx| + |gy|, thresholds 20 and 200
    """
    eight_bit = np.clip(np.nan_to_num(depth, nan=0.0, posinf=255.0, neginf=0.0), 0.0, 255.0).astype(np.uint8)
    return _cv2().Canny(np.ascontiguousarray(eight_bit), CANNY_LOW, CANNY_HIGH) > 0


def dense_flow(source: Array, target: Array) -> NDArray[np.float32]:
    """Dense optical flow from one picture to another by dense inverse search (DIS, medium preset).

    source, target  (H, W) uint8, or (3, H, W) uint8 planar RGB, converted to grey by the channel mean
    returns         (2, H, W) float32 pixels: source[y, x] is found at target[y + flow[1], x + flow[0]]

    Edges:   pictures too small for the coarsest level (a side under 16 pixels) give zero flow.
    Raises:  ValueError for arrays that are not two uint8 pictures of one size.
    """
    cv2 = _cv2()
    if source.shape != target.shape or source.dtype != np.uint8 or target.dtype != np.uint8:
        raise ValueError(f"dense_flow: two uint8 pictures of one size expected, got {source.shape} and {target.shape}")
    if min(source.shape[-2:]) < 16:
        return np.zeros((2, *source.shape[-2:]), np.float32)

    def prepared(picture: Array) -> Array:
        grey = picture if picture.ndim == 2 else picture.mean(axis=0).round().astype(np.uint8)
        return np.ascontiguousarray(grey)

    search = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow = search.calc(prepared(source), prepared(target), None)
    return np.ascontiguousarray(flow.transpose(2, 0, 1), np.float32)


def warp_cubic(image: Array, flow: Array) -> NDArray[np.float32]:
    """As `warp_bilinear`, with bicubic interpolation, which keeps more of the fine detail of pictures.

    image    (H, W) or (C, H, W) float32
    flow     (2, H, W) pixels, x first
    returns  float32 of the same shape; values may overshoot the range of the image

    OpenCV 4 rounds positions to 1/32 pixel, and OpenCV 5 does not. The kernel is that of Keys with a = -3/4, which does
    not reproduce a linear slope exactly.
    """
    cv2 = _cv2()
    height, width = image.shape[-2:]
    x = (np.arange(width, dtype=np.float32)[None, :] + flow[0]).astype(np.float32)
    y = (np.arange(height, dtype=np.float32)[:, None] + flow[1]).astype(np.float32)
    planes = image.reshape(-1, height, width)
    found = [cv2.remap(np.ascontiguousarray(p), x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE) for p in planes]
    return np.stack(found).reshape(image.shape)


def warp_bilinear(image: Array, flow: Array) -> Array:
    """image[..., y + flow[1], x + flow[0]] by bilinear interpolation. Outside the image, the nearest border value.

    image    (..., H, W) float
    flow     (2, H, W) pixels, x first
    returns  (..., H, W), dtype of the image

    Plain NumPy, because the remap of OpenCV 4 rounds positions to 1/32 pixel.
    """
    height, width = image.shape[-2:]
    return sample_bilinear(image, np.arange(width)[None, :] + flow[0], np.arange(height)[:, None] + flow[1])


def gaussian_blur(plane: Array, deviation: float) -> NDArray[np.float32]:
    """A float32 plane (H, W) convolved with a Gaussian of this standard deviation, px, cut at four of them.

    At the border the plane is mirrored about the centres of the outermost pixels, which are not repeated.
    """
    return _cv2().GaussianBlur(plane, (0, 0), deviation)


def warp_mask(mask: Array, flow: Array, place: tuple[slice, slice]) -> NDArray[np.float32]:
    """A soft mask (H, W) at y + flow[1], x + flow[0], bilinear; beyond the border, the nearest value.

    OpenCV 4 rounds positions to 1/32 pixel, and OpenCV 5 does not.

    flow     (2, h, w) px of the pixels of `place`
    place    rows and columns, h and w of them
    Returns: (h, w) float32.
    """
    height, width = mask.shape
    x = (np.arange(width, dtype=np.float32)[None, place[1]] + flow[0]).astype(np.float32, copy=False)
    y = (np.arange(height, dtype=np.float32)[place[0], None] + flow[1]).astype(np.float32, copy=False)
    cv2 = _cv2()
    return cv2.remap(np.ascontiguousarray(mask), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def grown(mask: NDArray[np.bool_], pixels: float) -> NDArray[np.bool_]:
    """The mask (H, W) and all pixels at most `pixels` px (Euclidean, between centres) from it; itself for 0."""
    if pixels <= 0 or not mask.any():
        return mask.copy()
    cv2 = _cv2()
    if pixels <= LARGEST_DISC:  # the same pixels as below, in less time
        across = np.arange(-int(pixels), int(pixels) + 1)
        disc = (across[:, None] ** 2 + across**2 <= pixels**2).astype(np.uint8)
        return cv2.dilate(mask.astype(np.uint8), disc) > 0
    distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return distance <= pixels


def nearest_pixels(missing: NDArray[np.bool_]) -> NDArray[np.intp]:
    """(H, W) flat index of the nearest pixel that is not missing; its own, if a pixel is not missing itself.

    Distances are those of OpenCV's mask of 5x5 pixels, within 2 % of the Euclidean ones. The pixel that is found can
    therefore be up to 4 % farther than the nearest one.

    Edges:   at least one pixel must not be missing.
    """
    cv2 = _cv2()
    kind = {"distanceType": cv2.DIST_L2, "maskSize": 5, "labelType": cv2.DIST_LABEL_PIXEL}
    labels = cv2.distanceTransformWithLabels(missing.astype(np.uint8), **kind)[1]
    places = np.zeros(labels.max() + 1, np.intp)
    known = np.flatnonzero(~missing)
    places[labels.ravel()[known]] = known
    return places[labels]


def outlines(mask: NDArray[np.bool_], tolerance: float) -> list[tuple[NDArray[np.float64], bool]]:
    """Outlines of the regions of a mask (H, W) as polygons (n, 2) in x and y, px, and whether each is that of a hole.

    tolerance   px between an outline and its polygon

    The centre of the first pixel is at (0.5, 0.5). OpenCV follows the centres of the outermost pixels; the mask is
    therefore enlarged, so that the outline passes within a quarter of a pixel of the edge between two pixels. The
    polygon is within `tolerance` of that outline.
    """
    cv2, factor = _cv2(), 2
    large = np.kron(mask, np.ones((factor, factor), bool)).astype(np.uint8)
    found, tree = cv2.findContours(large, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    parents = [] if tree is None else [int(entry[3]) for entry in tree.reshape(-1, 4)]
    polygons = [cv2.approxPolyDP(line, tolerance * factor, True).reshape(-1, 2) for line in found]
    return [((points + 0.5) / factor, parent >= 0) for points, parent in zip(polygons, parents)]


def sample_bilinear(image: Array, x: Array, y: Array) -> Array:
    """image[..., y, x] by bilinear interpolation. Outside the image, the nearest border value.

    image    (..., H, W) float
    x, y     columns and rows, both of shape S; 0 = centre of the first pixel
    returns  (..., S), dtype of the image
    """
    height, width = image.shape[-2:]
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    across, down = (x - left).astype(image.dtype), (y - top).astype(image.dtype)
    upper = image[..., top, left] * (1 - across) + image[..., top, right] * across
    lower = image[..., bottom, left] * (1 - across) + image[..., bottom, right] * across
    return upper * (1 - down) + lower * down


def stretched(image: Array, across: int, down: int) -> Array:
    """A picture with `across` times the width and `down` times the height, bilinear, with aligned picture edges."""
    size = image.shape[1] * across, image.shape[0] * down
    cv2 = _cv2()
    return cv2.resize(np.ascontiguousarray(image), size, interpolation=cv2.INTER_LINEAR)


def area_resize(image: Array, width: int, height: int) -> Array:
    """Shrink (H, W) or (H, W, C) to height x width. Every new pixel is the mean over the old area it covers.

    uint8 input is rounded to uint8; float32 and float64 keep their type.
    Raises:  ValueError when asked to enlarge.
    """
    if width > image.shape[1] or height > image.shape[0]:
        raise ValueError(f"area_resize shrinks only: {image.shape[1]}x{image.shape[0]} to {width}x{height}")
    if (height, width) == image.shape[:2]:
        return image
    cv2 = _cv2()
    return cv2.resize(np.ascontiguousarray(image), (width, height), interpolation=cv2.INTER_AREA)
