"""Dense optical flow, and pictures and masks warped along it.

A flow is planar, (2, H, W) pixels, x first.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.library import cv2_library
from endotsr.method.kernels.arrays import Array


def dense_flow(source: Array, target: Array) -> NDArray[np.float32]:
    """Dense optical flow from one picture to another by dense inverse search (DIS, medium preset).

    source, target  (H, W) uint8, or (3, H, W) uint8 planar RGB, converted to grey by the channel mean
    returns         (2, H, W) float32 pixels: source[y, x] is found at target[y + flow[1], x + flow[0]]

    Edges:   pictures too small for the coarsest level (a side under 16 pixels) give zero flow.
    Raises:  ValueError for arrays that are not two uint8 pictures of one size.
    """
    cv2 = cv2_library()
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


def warp_bilinear(image: Array, flow: Array) -> Array:
    """image[..., y + flow[1], x + flow[0]] by bilinear interpolation. Outside the image, the nearest border value.

    image    (..., H, W) float
    flow     (2, H, W) pixels, x first
    returns  (..., H, W), dtype of the image

    Plain NumPy, because the remap of OpenCV 4 rounds positions to 1/32 pixel.
    """
    height, width = image.shape[-2:]
    return sample_bilinear(image, np.arange(width)[None, :] + flow[0], np.arange(height)[:, None] + flow[1])


def warp_cubic(image: Array, flow: Array) -> NDArray[np.float32]:
    """As `warp_bilinear`, with bicubic interpolation, which keeps more of the fine detail of pictures.

    image    (H, W) or (C, H, W) float32
    flow     (2, H, W) pixels, x first
    returns  float32 of the same shape; values may overshoot the range of the image

    OpenCV 4 rounds positions to 1/32 pixel, and OpenCV 5 does not. The kernel is that of Keys with a = -3/4, which does
    not reproduce a linear slope exactly.
    """
    cv2 = cv2_library()
    height, width = image.shape[-2:]
    x = (np.arange(width, dtype=np.float32)[None, :] + flow[0]).astype(np.float32)
    y = (np.arange(height, dtype=np.float32)[:, None] + flow[1]).astype(np.float32)
    planes = image.reshape(-1, height, width)
    found = [cv2.remap(np.ascontiguousarray(p), x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE) for p in planes]
    return np.stack(found).reshape(image.shape)


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
    cv2 = cv2_library()
    return cv2.remap(np.ascontiguousarray(mask), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


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
