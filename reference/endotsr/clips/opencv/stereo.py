"""Undistortion, rectification and stereo matching.

Matrices here follow OpenCV, with pixel centres at integers. Translations are passed as columns: OpenCV 5 refuses the
one-dimensional vectors that OpenCV 4 accepts.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.library import cv2_library
from endotsr.method.kernels.arrays import Array, FloatArray

FIXED_POINT = 16.0  # OpenCV stores disparities in sixteenths of a pixel


class Maps(NamedTuple):
    """The position in the old picture of every pixel of the new one, and the new camera."""

    x: NDArray[np.float32]  # (H, W) pixels
    y: NDArray[np.float32]
    matrix: FloatArray  # (3, 3) intrinsics of the new camera
    rotation: FloatArray  # (3, 3) x_new = rotation @ x_old, camera axes


class RectifiedMaps(NamedTuple):
    """The maps of both cameras, and the distance between them."""

    left: Maps
    right: Maps
    baseline: float  # in the unit of the translation; negative: the right camera is on the left


def rectification_maps(
    matrices: tuple[FloatArray, FloatArray],
    distortions: tuple[FloatArray, FloatArray],
    rotation: FloatArray,
    translation: FloatArray,
    width: int,
    height: int,
) -> RectifiedMaps:
    """Maps that align the rows of the two pictures; each camera has its own distortion.

    rotation, translation   x_right = rotation @ x_left + translation

    Edges:   cameras that are farther apart vertically than horizontally: OpenCV aligns columns, and the baseline is 0.
    """
    cv2 = cv2_library()
    lefts, rights = (np.ascontiguousarray(values, np.float64).reshape(-1, 1) for values in distortions)
    found = cv2.stereoRectify(
        matrices[0], lefts, matrices[1], rights, (width, height), rotation, translation.reshape(3, 1),
        flags=cv2.CALIB_ZERO_DISPARITY, alpha=0,
    )  # fmt: skip
    turns, projections = found[:2], found[2:4]
    both = [
        _maps(matrix, distortion, turn, projection[:, :3], width, height)
        for matrix, distortion, turn, projection in zip(matrices, (lefts, rights), turns, projections)
    ]
    return RectifiedMaps(both[0], both[1], float(-projections[1][0, 3] / projections[1][0, 0]))


def undistortion_maps(matrix: FloatArray, distortion: FloatArray, width: int, height: int) -> Maps:
    """Maps that undistort the picture of one camera. The new one shows the old one alone, to a fraction of a pixel."""
    cv2 = cv2_library()
    column = np.ascontiguousarray(distortion, np.float64).reshape(-1, 1)
    new, _ = cv2.getOptimalNewCameraMatrix(matrix, column, (width, height), 0)
    return _maps(matrix, column, np.eye(3), new, width, height)


def _maps(
    matrix: FloatArray, distortion: FloatArray, turn: FloatArray, new: FloatArray, width: int, height: int
) -> Maps:
    cv2 = cv2_library()
    x, y = cv2.initUndistortRectifyMap(matrix, distortion, turn, new, (width, height), cv2.CV_32FC1)
    return Maps(x, y, np.array(new), np.array(turn))


def remapped(picture: Array, maps: Maps, nearest: bool = False) -> Array:
    """A picture (H, W) or (H, W, 3) in the new camera, bicubic or nearest pixel; 0 outside the old picture."""
    cv2 = cv2_library()
    method = cv2.INTER_NEAREST if nearest else cv2.INTER_CUBIC
    return cv2.remap(np.ascontiguousarray(picture), maps.x, maps.y, method, borderMode=cv2.BORDER_CONSTANT)


class Matching(NamedTuple):
    """Disparities of the left picture, pixels, and measures of their quality."""

    disparity: NDArray[np.float32]  # (H, W) smoothed, if that was asked for; NaN where unknown
    raw: NDArray[np.float32]  # (H, W) before smoothing
    confidence: NDArray[np.float32]  # (H, W) in [0, 1]
    disagreement: NDArray[np.float32]  # (H, W) px between left and right disparity; infinite where unknown


def match_pair(left: Array, right: Array, lowest: int, count: int, block: int = 5, smooth: bool = True) -> Matching:
    """Semi-global matching in both directions, then edge-preserving smoothing (weighted least squares) if `smooth`.

    left, right    (H, W, 3) RGB uint8, rectified
    lowest, count  disparities lowest .. lowest + count - 1 are searched; `count` is a multiple of 16
    """
    cv2 = cv2_library()
    greys = [np.ascontiguousarray(picture[:, :, ::-1]) for picture in (left, right)]
    matcher = cv2.StereoSGBM_create(
        minDisparity=lowest, numDisparities=count, blockSize=block, P1=8 * 3 * block**2, P2=32 * 3 * block**2,
        disp12MaxDiff=1, uniquenessRatio=5, speckleWindowSize=100, speckleRange=2, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )  # fmt: skip
    other = cv2.ximgproc.createRightMatcher(matcher)
    ours, theirs = matcher.compute(*greys), other.compute(*greys[::-1])
    raw = _pixels(ours, lowest)
    disagreement = left_right_disagreement(raw, -_pixels(theirs, -(lowest + count - 1)))
    if not smooth:
        return Matching(raw, raw, np.isfinite(raw).astype(np.float32), disagreement)
    wls = cv2.ximgproc.createDisparityWLSFilter(matcher)
    wls.setLambda(8000.0)
    wls.setSigmaColor(1.5)
    filtered = wls.filter(ours, greys[0], disparity_map_right=theirs)
    confidence = np.asarray(wls.getConfidenceMap(), np.float32) / np.float32(255)
    return Matching(_pixels(filtered, lowest), raw, confidence.astype(np.float32), disagreement)


def _pixels(fixed: Array, lowest: int) -> NDArray[np.float32]:
    """Fixed-point disparities in pixels; NaN for unmatched pixels, whose value is below the lowest."""
    found = fixed.astype(np.float32) / FIXED_POINT
    found[found < lowest] = np.nan
    return found


def left_right_disagreement(left: Array, right: Array) -> NDArray[np.float32]:
    """|d_left(x) - d_right(x - d_left(x))|, px; infinite where either is unknown or outside the picture.

    The right disparity is that of the nearest column.
    """
    height, width = left.shape
    columns = np.arange(width)[None, :] - np.where(np.isfinite(left), left, 0)
    there = np.rint(columns).astype(np.intp)
    inside = np.isfinite(left) & (there >= 0) & (there < width)
    rows = np.broadcast_to(np.arange(height)[:, None], left.shape)
    seen = right[rows, np.clip(there, 0, width - 1)]
    with np.errstate(invalid="ignore"):
        apart = np.abs(left - seen)
    return np.where(inside & np.isfinite(apart), apart, np.inf).astype(np.float32)
