"""Local contrast, the pose of points, and matches of features.

Inputs and outputs are NumPy arrays in this project's conventions: image positions are in pixels with the centre of the
first pixel at (0.5, 0.5), poses map the axes of the points to the axes of the camera. Every function is deterministic.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.library import cv2_library
from endotsr.method.kernels.arrays import Array, BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera

CONTRAST, CELLS = 2.0, (8, 8)  # limit and grid of the adaptive histogram
DRAWS, FAR, CONFIDENCE = 200, 2.0, 0.999  # of the consensus: samples, pixels, probability
MOST_FEATURES, FAINT = 3000, 0.01  # of a picture, and the least contrast of one
DISTINCT = 0.8  # distance to the best match over the distance to the second best


class Consensus(NamedTuple):
    """A pose that some of the points agree with."""

    rotation: FloatArray  # (3, 3)
    translation: FloatArray  # (3,)
    agree: NDArray[np.intp]  # indices of the points


class Features(NamedTuple):
    """Scale-invariant features of a picture, the strongest first."""

    place: FloatArray  # (F, 2) pixels
    descriptor: NDArray[np.float32]  # (F, 128)

    def first(self, most: int) -> "Features":
        """The strongest ones, at most this many."""
        return Features(self.place[:most], self.descriptor[:most])


def grey_of(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Luminance (H, W) of a planar RGB picture (3, H, W)."""
    cv2 = cv2_library()
    return cv2.cvtColor(np.ascontiguousarray(image.transpose(1, 2, 0)), cv2.COLOR_RGB2GRAY)


def equalised(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture (H, W) with its histogram equalised in cells, with limited contrast (CLAHE)."""
    return cv2_library().createCLAHE(CONTRAST, CELLS).apply(np.ascontiguousarray(grey))


def halved_blurred(plane: Array) -> Array:
    """The next level of a Gaussian pyramid: blurred and every second pixel, (ceil(H/2), ceil(W/2))."""
    return cv2_library().pyrDown(np.ascontiguousarray(plane))


def pose_by_consensus(
    points: FloatArray, pixels: FloatArray, camera: Camera, start: tuple[FloatArray, FloatArray]
) -> Consensus | None:
    """The pose under which most points project near their pixels, by random samples (RANSAC); None without one.

    points   (3, M) scene units, M >= 4
    pixels   (2, M) in the picture of `camera`, whose intrinsics are used
    start    rotation and translation with which the least squares over the agreeing points begin; the samples do not
             use it, and a start far from the pose can end in another minimum
    """
    cv2 = cv2_library()
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    turn, shift = cv2.Rodrigues(start[0])[0], np.array(start[1], np.float64).reshape(3, 1)
    x, u = np.ascontiguousarray(points.T), np.ascontiguousarray(pixels.T)
    try:
        found, turn, shift, agree = cv2.solvePnPRansac(x, u, matrix, None, turn, shift, True, DRAWS, FAR, CONFIDENCE)
    except cv2.error:  # degenerate points
        return None
    if not found or agree is None or not (np.isfinite(turn).all() and np.isfinite(shift).all()):
        return None
    return Consensus(cv2.Rodrigues(turn)[0], shift.ravel(), agree.ravel().astype(np.intp))


def features_of(grey: NDArray[np.uint8], mask: BoolArray) -> Features:
    """Features (SIFT) of a picture (H, W) inside a mask (H, W)."""
    cv2 = cv2_library()
    detector = cv2.SIFT_create(MOST_FEATURES, contrastThreshold=FAINT)
    points, found = detector.detectAndCompute(grey, mask.astype(np.uint8))
    if not points or found is None:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32))
    order = np.argsort([-point.response for point in points], kind="stable")
    place, descriptor = np.array([point.pt for point in points]) + 0.5, np.asarray(found, np.float32)
    return Features(place[order], np.ascontiguousarray(descriptor[order]))


def matched_features(source: Features, target: Features) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of features of two pictures that match one another best and distinctly.

    Descriptors are integers below 256: squared distances are exact in float32, and their order is the same everywhere.
    """
    if len(source.place) < 2 or len(target.place) < 2:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    one, other = source.descriptor, target.descriptor
    squared = (one * one).sum(1)[:, None] + (other * other).sum(1) - 2 * (one @ other.T)
    nearest, back = squared.argmin(axis=1), squared.argmin(axis=0)
    rows = np.arange(len(one))
    first = squared[rows, nearest]
    squared[rows, nearest] = np.inf
    second = squared.min(axis=1)
    here = np.flatnonzero((first < DISTINCT**2 * second) & (back[nearest] == rows))
    return here, nearest[here]
