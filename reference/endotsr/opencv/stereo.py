"""Straightened and rectified pictures, and stereo matching, with OpenCV's conventions kept inside.

Matrices here are OpenCV's own: pixel centres lie at integers. Translations are passed as columns, because OpenCV 5
refuses the one-dimensional vectors that OpenCV 4 accepted.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.arrays import Array, FloatArray
from endotsr.opencv.library import cv2_library

FIXED_POINT = 16.0  # OpenCV's disparities are in sixteenths of a pixel


class Maps(NamedTuple):
    """For every pixel of the new picture its place in the old one, and the new camera."""

    x: NDArray[np.float32]  # (H, W) pixels
    y: NDArray[np.float32]
    matrix: FloatArray  # (3, 3) of the new camera
    rotation: FloatArray  # (3, 3) x_new = rotation @ x_old, camera axes


class RectifiedMaps(NamedTuple):
    """The maps of both cameras, and the distance between them."""

    left: Maps
    right: Maps
    baseline: float  # in the unit of the translation; negative: the right camera stands on the left


def rectification_maps(
    matrices: tuple[FloatArray, FloatArray],
    distortions: tuple[FloatArray, FloatArray],
    rotation: FloatArray,
    translation: FloatArray,
    width: int,
    height: int,
) -> RectifiedMaps:
    """Maps that make rows of the two pictures correspond; each camera has its own distortion.

    rotation, translation   x_right = rotation @ x_left + translation
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
    """Maps that straighten the picture of one camera; the new picture holds only pixels that the old one has."""
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
    """A picture (H, W) or (H, W, 3) in the new camera: bicubic, or the nearest pixel; 0 outside the old picture."""
    cv2 = cv2_library()
    method = cv2.INTER_NEAREST if nearest else cv2.INTER_CUBIC
    return cv2.remap(np.ascontiguousarray(picture), maps.x, maps.y, method, borderMode=cv2.BORDER_CONSTANT)


class Matching(NamedTuple):
    """Disparities of the left picture, pixels; and what is known of them."""

    disparity: NDArray[np.float32]  # (H, W) of the left picture, smoothed; not a number where unknown
    raw: NDArray[np.float32]  # (H, W) as matched
    confidence: NDArray[np.float32]  # (H, W) in [0, 1]
    disagreement: NDArray[np.float32]  # (H, W) pixels between the disparities of left and right; infinite where none


def match_pair(left: Array, right: Array, lowest: int, count: int, block: int = 5, smooth: bool = True) -> Matching:
    """Semi-global matching in both directions, and edge-preserving smoothing (weighted least squares).

    left, right    (H, W, 3) RGB uint8, rectified
    lowest, count  searched disparities lowest .. lowest + count - 1; `count` is a multiple of 16
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
    """Fixed-point disparities as pixels, not a number where nothing was matched (below the lowest)."""
    found = fixed.astype(np.float32) / FIXED_POINT
    found[found < lowest] = np.nan
    return found


def left_right_disagreement(left: Array, right: Array) -> NDArray[np.float32]:
    """|d_left(x) - d_right(x - d_left(x))| in pixels; infinite where either is unknown or leaves the picture."""
    height, width = left.shape
    columns = np.arange(width)[None, :] - np.where(np.isfinite(left), left, 0)
    there = np.rint(columns).astype(np.intp)
    inside = np.isfinite(left) & (there >= 0) & (there < width)
    rows = np.broadcast_to(np.arange(height)[:, None], left.shape)
    seen = right[rows, np.clip(there, 0, width - 1)]
    with np.errstate(invalid="ignore"):
        apart = np.abs(left - seen)
    return np.where(inside & np.isfinite(apart), apart, np.inf).astype(np.float32)
