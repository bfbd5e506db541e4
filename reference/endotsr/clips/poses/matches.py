"""Points of one frame found again in another: dense flow there and back, on a grid of usable pixels with depth.

In: `Views` of moderate width. Out: `Matches`. Pictures are equalised once; flow is computed on demand.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.opencv import dense_flow, sample_bilinear
from endotsr.clips.opencv.geometry import Features, equalised, features_of, grey_of, matched_features
from endotsr.clips.poses.views import Views, known_depth, usable_pixels
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import backproject

POINTS, LEAST_STEP = 600, 4  # number of grid points of a picture, and their least distance in pixels
RETURN, RETURN_SHARE = 1.0, 0.03  # accepted error of flow there and back: pixels, and share of the flow


class Matches(NamedTuple):
    """M points of a source frame in a target frame."""

    points: FloatArray  # (3, M) in the axes of the source camera, scene units
    source: FloatArray  # (2, M) pixels, the centre of the first pixel is (0.5, 0.5)
    target: FloatArray  # (2, M) pixels
    usable: int  # grid points of the source frame that could have matched

    @property
    def count(self) -> int:
        """Number of points M."""
        return self.points.shape[1]

    @property
    def flow(self) -> FloatArray:
        """(M,) pixels that the points move in the picture."""
        return np.hypot(*(self.target - self.source))


class Matcher:
    """Matches between any two frames."""

    def __init__(self, views: Views) -> None:
        self.views, self.camera = views, views.camera._replace(rotation=np.eye(3), translation=np.zeros(3))
        self.usable = [usable_pixels(image, tissue) for image, tissue in zip(views.images, views.tissue)]
        self._plain = [grey_of(image) for image in views.images]
        self._grey = [equalised(grey) for grey in self._plain]
        self._features: dict[int, Features] = {}
        height, width = views.tissue.shape[1:]
        step = max(LEAST_STEP, round((height * width / POINTS) ** 0.5))
        grid = np.mgrid[step // 2 : height : step, step // 2 : width : step]
        self._row, self._column = grid.reshape(2, -1)

    def by_flow(self, source: int, target: int) -> Matches:
        """Grid points of the source frame that flow finds in the target frame, and back again."""
        column, row, depth = self._grid_points(source)
        there = dense_flow(self._grey[source], self._grey[target])
        back = dense_flow(self._grey[target], self._grey[source])
        flow = there[:, row, column].astype(np.float64)
        x, y = column + flow[0], row + flow[1]
        error = np.hypot(*(flow + sample_bilinear(back, x, y)))
        kept = (error < RETURN + RETURN_SHARE * np.hypot(*flow)) & _marked(self.usable[target], x, y)
        points = backproject(self.camera, column[kept], row[kept], depth[kept])
        source_place, target_place = np.stack([column, row])[:, kept] + 0.5, np.stack([x, y])[:, kept] + 0.5
        return Matches(points, source_place, target_place, column.size)

    def by_features(self, source: int, target: int) -> Matches:
        """Features of the source frame in the target frame; for frames that are too far apart for flow."""
        one, other = (self._features_of(k) for k in (source, target))
        here, there = matched_features(one, other)
        place = one.place[here].T
        column, row = np.floor(place).astype(np.intp)
        depth = known_depth(self.views.depth[source])[row, column].astype(np.float64)
        kept = depth > 0
        points = backproject(self.camera, *(place[:, kept] - 0.5), depth[kept])
        return Matches(points, place[:, kept], other.place[there[kept]].T, len(one.place))

    def _grid_points(self, frame: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Columns, rows and depth of the usable grid points of a frame."""
        depth = known_depth(self.views.depth[frame])[self._row, self._column].astype(np.float64)
        kept = self.usable[frame][self._row, self._column] & (depth > 0)
        return self._column[kept], self._row[kept], depth[kept]

    def _features_of(self, frame: int) -> Features:
        if frame not in self._features:
            self._features[frame] = features_of(self._plain[frame], self.usable[frame])
        return self._features[frame]


def _marked(mask: BoolArray, x: FloatArray, y: FloatArray) -> BoolArray:
    """Whether the pixel nearest to column x, row y is in the mask; False outside the picture."""
    height, width = mask.shape
    column, row = np.rint(x).astype(np.intp), np.rint(y).astype(np.intp)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return inside & mask[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
