"""Depth of a rectified stereo pair: semi-global matching, left-right check, smoothing, metric scale.

    z = f B / d          f, B: focal length (px) and baseline; d: disparity (px)

In: left and right pictures, the intrinsics and the baseline. Out: depth (H, W) with unfilled holes (0). A
pixel has depth if left and right agree, the match is confident and the depth is within range.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.opencv.stereo import match_pair
from endotsr.clips.sequences.clip import Picture
from endotsr.errors import InputError
from endotsr.untrusted.sections import Fraction, Positive, Section

MULTIPLE = 16  # of the number of searched disparities, required by OpenCV
MOST = 512  # searched disparities; more indicate a wrong calibration


class StereoSettings(Section, frozen=True, kw_only=True):
    """Settings of depth from stereo pairs."""

    nearest: Positive = 20.0
    """nearest searched depth, in the unit of the sequence"""
    farthest: Positive = 300.0
    """farthest searched depth"""
    block: Literal[3, 5, 7, 9, 11] = 5
    """side of the matched blocks, px"""
    smooth: bool = True
    """edge-preserving smoothing by weighted least squares"""
    agreement: Positive = 1.0
    """largest difference between left and right disparity, px"""
    confidence: Fraction = 0.5
    """smallest confidence of the smoothing, 0 to 1"""
    temporal: bool = False
    """median over three frames along the optical flow"""


def disparity_range(settings: StereoSettings, intrinsics: Intrinsics, baseline: float) -> tuple[int, int]:
    """Lowest disparity and number of disparities, a multiple of 16, for the searched depths.

    Raises:  InputError for depths that are not ascending, or a range beyond `MOST` or the width of the pictures.
    """
    if not 0 < settings.nearest < settings.farthest < np.inf:
        raise InputError(f"nearest {settings.nearest:g}, farthest {settings.farthest:g}: use two ascending numbers > 0")
    lowest = int(np.floor(intrinsics.fx * baseline / settings.farthest))
    highest = int(np.ceil(intrinsics.fx * baseline / settings.nearest))
    count = -(-(highest - lowest + 1) // MULTIPLE) * MULTIPLE
    if count > min(MOST, intrinsics.width):
        raise InputError(
            f"depths from {settings.nearest:g} to {settings.farthest:g} at baseline {baseline:g} are disparities from"
            f" {lowest} to {highest} px in pictures {intrinsics.width} px wide; use a larger --nearest, or the"
            " right baseline and unit"
        )
    return lowest, count


def stereo_depth(
    left: Picture, right: Picture, intrinsics: Intrinsics, baseline: float, settings: StereoSettings
) -> NDArray[np.float32]:
    """Depth (H, W) of the left picture, 0 = none.

    intrinsics       of both rectified pictures
    baseline   in the unit of the resulting depth

    Edges:   pixels whose match is outside the right picture have no depth.
    """
    lowest, count = disparity_range(settings, intrinsics, baseline)
    # OpenCV does not match a strip as wide as the search, at the left of the left and the right of the right picture.
    padding = lowest + count
    pad = ((0, 0), (padding, padding), (0, 0))
    match = match_pair(
        np.pad(left, pad, "edge"), np.pad(right, pad, "edge"), lowest, count, settings.block, settings.smooth
    )
    disparity, confidence, apart = (
        plane[:, padding:-padding] for plane in (match.disparity, match.confidence, match.disagreement)
    )
    column = np.arange(intrinsics.width)[None, :]
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = intrinsics.fx * baseline / disparity
        good = (apart <= settings.agreement) & (confidence >= settings.confidence) & (disparity > 0)
        good &= (depth >= settings.nearest) & (depth <= settings.farthest) & (column - disparity >= 0)
    return np.where(good, depth, 0).astype(np.float32)


def temporal_median(depths: list[NDArray[np.float32]], pictures: list[Picture], middle: int) -> NDArray[np.float32]:
    """The median depth of neighbouring frames, each warped along the optical flow to frame `middle`.

    depths    (H, W) each, 0 = none
    pictures  the left pictures of the same frames
    returns   (H, W) where the frame itself has depth; 0 elsewhere: holes are not filled

    A neighbouring frame counts where all four bilinear samples have depth.
    """
    from endotsr.clips.opencv.flow import dense_flow, warp_bilinear

    found = [np.where(depths[middle] > 0, depths[middle], np.nan)]
    for k, (depth, picture) in enumerate(zip(depths, pictures)):
        if k != middle:
            flow = dense_flow(
                np.ascontiguousarray(pictures[middle].transpose(2, 0, 1)),
                np.ascontiguousarray(picture.transpose(2, 0, 1)),
            )
            whole = warp_bilinear((depth > 0).astype(np.float32), flow) > 0.999
            found.append(np.where(whole, warp_bilinear(depth, flow), np.nan))
    known = np.isfinite(found[0])
    result = np.zeros(depths[middle].shape, np.float32)
    result[known] = np.nanmedian(np.stack(found)[:, known], axis=0)
    return result
