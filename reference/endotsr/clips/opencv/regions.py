"""Regions of a mask: growing, shrinking, the nearest known pixel, outlines."""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.library import cv2_library
from endotsr.method.kernels.arrays import BoolArray

LARGEST_DISC = 12  # px; in a trial without a record, a dilation took a third of the time of a distance transform there


def grown_by_disc(mask: BoolArray, pixels: float) -> BoolArray:
    """The mask (H, W) and all pixels at most `pixels` px (Euclidean, between centres) from it; itself for 0."""
    if pixels <= 0 or not mask.any():
        return mask.copy()
    cv2 = cv2_library()
    if pixels <= LARGEST_DISC:  # the same pixels as below, in less time
        across = np.arange(-int(pixels), int(pixels) + 1)
        disc = (across[:, None] ** 2 + across**2 <= pixels**2).astype(np.uint8)
        return cv2.dilate(mask.astype(np.uint8), disc) > 0
    distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return distance <= pixels


def grown_by_square(mask: BoolArray, margin: int) -> BoolArray:
    """The mask (H, W) grown by `margin` pixels, in squares."""
    return cv2_library().dilate(mask.astype(np.uint8), np.ones((2 * margin + 1,) * 2, np.uint8)) > 0


def shrunk_by_square(mask: BoolArray, margin: int) -> BoolArray:
    """The mask (H, W) without the pixels within `margin` of a pixel outside it or of the edge of the picture."""
    cv2 = cv2_library()
    square = np.ones((2 * margin + 1,) * 2, np.uint8)
    return cv2.erode(mask.astype(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0


def nearest_known(missing: BoolArray) -> NDArray[np.intp]:
    """(H, W) flat index of the nearest pixel that is not missing; its own, if a pixel is not missing itself.

    Distances are those of OpenCV's mask of 5x5 pixels, within 2 % of the Euclidean ones. The pixel that is found can
    therefore be up to 4 % farther than the nearest one.

    Edges:   at least one pixel must not be missing.
    """
    cv2 = cv2_library()
    kind = {"distanceType": cv2.DIST_L2, "maskSize": 5, "labelType": cv2.DIST_LABEL_PIXEL}
    labels = cv2.distanceTransformWithLabels(missing.astype(np.uint8), **kind)[1]
    places = np.zeros(labels.max() + 1, np.intp)
    known = np.flatnonzero(~missing)
    places[labels.ravel()[known]] = known
    return places[labels]


def outlines(mask: BoolArray, tolerance: float) -> list[tuple[NDArray[np.float64], bool]]:
    """Outlines of the regions of a mask (H, W) as polygons (n, 2) in x and y, px, and whether each is that of a hole.

    tolerance   px between an outline and its polygon

    The centre of the first pixel is at (0.5, 0.5). OpenCV follows the centres of the outermost pixels; the mask is
    therefore enlarged, so that the outline passes within a quarter of a pixel of the edge between two pixels. The
    polygon is within `tolerance` of that outline.
    """
    cv2, factor = cv2_library(), 2
    large = np.kron(mask, np.ones((factor, factor), bool)).astype(np.uint8)
    found, tree = cv2.findContours(large, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    parents = [] if tree is None else [int(entry[3]) for entry in tree.reshape(-1, 4)]
    polygons = [cv2.approxPolyDP(line, tolerance * factor, True).reshape(-1, 2) for line in found]
    return [((points + 0.5) / factor, parent >= 0) for points, parent in zip(polygons, parents)]
