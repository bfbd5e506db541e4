"""The field of view of a scope: the part of the picture that shows tissue in some frame.

A scope shows tissue in a round or truncated part of the picture. The border outside it is dark in all frames and stays
where it is when the scope moves. A model that takes it for tissue learns a border that travels with the camera.

In: the pictures of a clip, one at a time. Out: the border as a mask.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.clip import Picture
from endotsr.clips.sequences.sampling import reduced_to
from endotsr.clips.sequences.smaller import resized_nearest
from endotsr.method.kernels.arrays import BoolArray

WORKING = 320  # px, longer side of the working pictures
DARK = 20.0  # grey levels: pixels that are never brighter are outside the field of view
THIN = 2  # px at the working size: a narrower bridge does not join a bright area to the field of view
LEAST_OUTSIDE, LEAST_INSIDE = 0.01, 0.05  # of the picture: smallest border and smallest field of view
# px at the working size: the blurred edge of the field of view and the bright rim of the optics are outside. Chosen on
# the one clip with such a rim that was tried: there the held-out PSNR hardly changed from 5 to 6.
SOFT_EDGE = 5


class FieldOfView:
    """What is found of the field of view while the pictures of a clip pass by."""

    def __init__(self) -> None:
        self._brightest: NDArray[np.float32] | None = None  # (h, w) at the working size
        self._equal = True  # all pictures have one size
        self.tissue: BoolArray = np.zeros((0, 0), bool)  # (H, W) in some frame

    def add(self, picture: Picture, tissue: BoolArray | None = None) -> None:
        """Take a picture (H, W, 3) and its tissue (H, W), None without masks, into account."""
        found = brightness(reduced(picture))
        if self._brightest is None:
            self._brightest, self.tissue = found, np.zeros(picture.shape[:2], bool)
        elif picture.shape[:2] == self.tissue.shape:
            np.maximum(self._brightest, found, out=self._brightest)
        else:
            self._equal = False
            return
        self.tissue |= True if tissue is None else tissue

    def dark_border(self) -> BoolArray | None:
        """(H, W) True where every picture is dark, joined to the edge; None if nothing is, or for several sizes."""
        return self._at_full_size(dark_from_the_edge)

    def outside(self) -> BoolArray | None:
        """(H, W) True outside the field of view; None if there is no border, or for pictures of several sizes."""
        return self._at_full_size(outside_of)

    def _at_full_size(self, search: Callable[[NDArray[np.float32]], BoolArray]) -> BoolArray | None:
        if self._brightest is None or not self._equal:
            return None
        found = search(self._brightest)
        height, width = self.tissue.shape
        return resized_nearest(found, width, height, "mask") if found.any() else None


def reduced(picture: Picture) -> Picture:
    """The picture with its longer side reduced to `WORKING`."""
    return reduced_to(picture, WORKING)


def brightness(picture: Picture) -> NDArray[np.float32]:
    """(h, w) the brightest channel in grey levels, smoothed with a standard deviation of 1 px."""
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(picture.max(axis=2).astype(np.float32), 1.0), np.float32)


def outside_of_view(pictures: list[Picture]) -> BoolArray:
    """(H, W) True outside the field of view of pictures of one size. Pictures of several sizes: False everywhere."""
    view = FieldOfView()
    for picture in pictures:
        view.add(picture)
    found = view.outside()
    return np.zeros(pictures[0].shape[:2], bool) if found is None else found


def dark_from_the_edge(brightest: NDArray[np.float32]) -> BoolArray:
    """(h, w) True where the brightest of all pictures is dark, in a region that is connected to the edge."""
    from scipy.ndimage import binary_propagation

    ring = np.pad(brightest < DARK, 1, constant_values=True)
    around = np.pad(np.zeros(brightest.shape, bool), 1, constant_values=True)
    return np.asarray(binary_propagation(around, mask=ring), bool)[1:-1, 1:-1]


def outside_of(brightest: NDArray[np.float32]) -> BoolArray:
    """(h, w) True in the dark region of `dark_from_the_edge`, and in all that is not the field of view.

    Bright areas out there, such as text, are also outside: the field of view is one region without holes.

    Edges:  almost no border or almost no field of view: False everywhere.
    """
    from scipy import ndimage

    nowhere, joined = np.zeros(brightest.shape, bool), dark_from_the_edge(brightest)
    padded = np.pad(~joined, THIN, "edge")  # opening must not erode at the edge of the picture
    opened = ndimage.binary_opening(padded, iterations=THIN)[THIN:-THIN, THIN:-THIN]
    labels: Any
    labels, count = ndimage.label(opened)  # pyright: ignore[reportGeneralTypeIssues]
    if not count:
        return nowhere
    largest = labels == 1 + int(np.bincount(labels.ravel())[1:].argmax())
    beyond = ~np.asarray(ndimage.binary_fill_holes(largest), bool)
    outside = np.asarray(ndimage.binary_dilation(beyond, iterations=SOFT_EDGE), bool)
    if not LEAST_OUTSIDE <= joined.mean() or 1 - outside.mean() < LEAST_INSIDE:
        return nowhere
    return outside
