"""Edges, blur and resizing of a picture."""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.library import cv2_library
from endotsr.method.kernels.arrays import Array

CANNY_LOW, CANNY_HIGH = 20, 200  # ruling: thresholds of the released smoothness term, on 8-bit depth


def canny_edges(depth: Array) -> NDArray[np.bool_]:
    """Edges of a rendered depth image, for the smoothness loss (B9). They are held fixed: no gradient passes.

    depth    (H, W) scene units; clipped to [0, 255] and truncated to 8 bits (a depth of 300 becomes 255, not 44); NaN
             counts as 0
    returns  (H, W) bool, True on an edge; Sobel 3x3, |gx| + |gy|, thresholds 20 and 200
    """
    eight_bit = np.clip(np.nan_to_num(depth, nan=0.0, posinf=255.0, neginf=0.0), 0.0, 255.0).astype(np.uint8)
    return cv2_library().Canny(np.ascontiguousarray(eight_bit), CANNY_LOW, CANNY_HIGH) > 0


def gaussian_blur(plane: Array, deviation: float) -> NDArray[np.float32]:
    """A float32 plane (H, W) convolved with a Gaussian of this standard deviation, px, cut at four of them.

    At the border the plane is mirrored about the centres of the outermost pixels, which are not repeated.
    """
    return cv2_library().GaussianBlur(plane, (0, 0), deviation)


def area_resize(image: Array, width: int, height: int) -> Array:
    """Shrink (H, W) or (H, W, C) to height x width. Every new pixel is the mean over the old area it covers.

    uint8 input is rounded to uint8; float32 and float64 keep their type.
    Raises:  ValueError when asked to enlarge.
    """
    if width > image.shape[1] or height > image.shape[0]:
        raise ValueError(f"area_resize shrinks only: {image.shape[1]}x{image.shape[0]} to {width}x{height}")
    if (height, width) == image.shape[:2]:
        return image
    cv2 = cv2_library()
    return cv2.resize(np.ascontiguousarray(image), (width, height), interpolation=cv2.INTER_AREA)


def stretched(image: Array, across: int, down: int) -> Array:
    """A picture with `across` times the width and `down` times the height, bilinear, with aligned picture edges."""
    size = image.shape[1] * across, image.shape[0] * down
    cv2 = cv2_library()
    return cv2.resize(np.ascontiguousarray(image), size, interpolation=cv2.INTER_LINEAR)
