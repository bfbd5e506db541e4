"""Points of one frame found again in another: dense flow there and back, on a grid of usable pixels with depth.

In: `ViewFrame`s of moderate width, read on demand. Out: `Matches`. A frame is prepared once.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.filters import gaussian_blur
from endotsr.clips.opencv.flow import dense_flow, sample_bilinear
from endotsr.clips.opencv.geometry import Features, equalised, features_of, grey_of, matched_features
from endotsr.clips.poses.views import ViewFrame, Views, known_depth, usable_pixels
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera, backproject

POINTS, LEAST_STEP = 600, 4  # about the most grid points of a picture, and their least distance in pixels
RETURN, RETURN_FRACTION = 1.0, 0.03  # accepted error of flow there and back: pixels, and fraction of the flow
SMOOTH = 2.0  # pixels: standard deviation of the blur before pictures are compared
STRONGEST = 800  # features of a frame in `by_strongest`
LEAST_SUPPORT = 0.35  # neighbouring frames have over 0.8, pictures of two simulated scenes under 0.25


class Matches(NamedTuple):
    """M points of a source frame in a target frame."""

    points: FloatArray  # (3, M) in the axes of the source camera, scene units
    source: FloatArray  # (2, M) pixels, the centre of the first pixel is (0.5, 0.5)
    target: FloatArray  # (2, M) pixels
    usable: int  # grid points, or features, of the source frame that could have matched
    likeness: float = 1.0  # correlation of the equalised, smoothed luminance of the points; 1 for features

    @property
    def support(self) -> float:
        """Fraction of the usable points that were found, times their likeness."""
        return self.count / max(self.usable, 1) * self.likeness

    @property
    def related(self) -> bool:
        """Whether both frames show one scene; between unrelated pictures, flow returns to some points by chance."""
        return self.support >= LEAST_SUPPORT

    @property
    def count(self) -> int:
        """Number of points M."""
        return self.points.shape[1]

    @property
    def flow(self) -> FloatArray:
        """(M,) pixels that the points move in the picture."""
        return np.hypot(*(self.target - self.source))


class _Prepared(NamedTuple):
    """A frame, ready to be matched."""

    plain: NDArray[np.uint8]  # (H, W) luminance
    grey: NDArray[np.uint8]  # (H, W) the same, equalised
    smooth: NDArray[np.float32]  # (H, W) that, blurred: without most of the noise
    usable: BoolArray  # (H, W)
    depth: NDArray[np.float32]  # (H, W) 0 = none


class Matcher:
    """Matches between any two of `count` frames.

    read     frame number -> the frame
    camera   intrinsics of all frames
    """

    def __init__(self, read: Callable[[int], ViewFrame], count: int, camera: Camera) -> None:
        self.count, self.camera = count, camera._replace(rotation=np.eye(3), translation=np.zeros(3))
        self._read = read
        self._frames: dict[int, _Prepared] = {}
        self._features: dict[int, Features] = {}
        step = max(LEAST_STEP, round((camera.height * camera.width / POINTS) ** 0.5))
        grid = np.mgrid[step // 2 : camera.height : step, step // 2 : camera.width : step]
        self._row, self._column = grid.reshape(2, -1)

    def by_flow(self, source: int, target: int) -> Matches:
        """Grid points of the source frame that flow finds in the target frame, and back again."""
        one, other = self._frame(source), self._frame(target)
        depth = one.depth[self._row, self._column].astype(np.float64)
        known = one.usable[self._row, self._column] & (depth > 0)
        column, row, depth = self._column[known], self._row[known], depth[known]
        there, back = dense_flow(one.grey, other.grey), dense_flow(other.grey, one.grey)
        flow = there[:, row, column].astype(np.float64)
        x, y = column + flow[0], row + flow[1]
        error = np.hypot(*(flow + sample_bilinear(back, x, y)))
        kept = (error < RETURN + RETURN_FRACTION * np.hypot(*flow)) & _marked(other.usable, x, y)
        points = backproject(self.camera, column[kept], row[kept], depth[kept])
        source_place, target_place = np.stack([column, row])[:, kept] + 0.5, np.stack([x, y])[:, kept] + 0.5
        likeness = _correlation(one.smooth[row[kept], column[kept]], sample_bilinear(other.smooth, x[kept], y[kept]))
        return Matches(points, source_place, target_place, column.size, likeness)

    def by_features(self, source: int, target: int) -> Matches:
        """Features of the source frame in the target frame; for frames that are too far apart for flow."""
        return self._matched(source, target, *(self._features_of(k) for k in (source, target)))

    def by_strongest(self, source: int, target: int) -> Matches:
        """The same for the strongest features of both alone: the time grows with the product of their numbers."""
        return self._matched(source, target, *(self._features_of(k).first(STRONGEST) for k in (source, target)))

    def _matched(self, source: int, target: int, one: Features, other: Features) -> Matches:
        here, there = matched_features(one, other)
        place = one.place[here].T
        column, row = np.floor(place).astype(np.intp)
        depth = self._frame(source).depth[row, column].astype(np.float64)
        kept = depth > 0
        across, down = place[:, kept] - 0.5
        points = backproject(self.camera, across, down, depth[kept])
        return Matches(points, place[:, kept], other.place[there[kept]].T, len(one.place))

    def seen_points(self, frame: int) -> int:
        """Number of usable pixels of a frame that have depth."""
        one = self._frame(frame)
        return int((one.usable & (one.depth > 0)).sum())

    def _frame(self, number: int) -> _Prepared:
        if number not in self._frames:
            frame = self._read(number)
            plain = grey_of(frame.image)
            usable = usable_pixels(frame.image, frame.tissue)
            grey = equalised(plain)
            smooth = gaussian_blur(grey.astype(np.float32), SMOOTH)
            self._frames[number] = _Prepared(plain, grey, smooth, usable, known_depth(frame.depth))
        return self._frames[number]

    def _features_of(self, number: int) -> Features:
        if number not in self._features:
            one = self._frame(number)
            self._features[number] = features_of(one.plain, one.usable)
        return self._features[number]


def _correlation(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Of two lists of values; 0 where one of them is constant or shorter than three."""
    if len(one) < 3 or not np.ptp(one) > 0 or not np.ptp(other) > 0:
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])


def matcher_of(views: Views) -> Matcher:
    """Matches between the frames of a clip in memory."""
    return Matcher(views.frame, views.count, views.camera)


def _marked(mask: BoolArray, x: FloatArray, y: FloatArray) -> BoolArray:
    """Whether the pixel nearest to column x, row y is in the mask; False outside the picture."""
    height, width = mask.shape
    column, row = np.rint(x).astype(np.intp), np.rint(y).astype(np.intp)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return inside & mask[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
