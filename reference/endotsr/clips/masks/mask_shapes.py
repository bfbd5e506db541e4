"""Shapes that a person draws on a picture, and the masks that they cover.

A mask is a list of shapes in the order in which they were drawn. A polygon covers the pixels whose centre is inside by
the even-odd rule; a stroke of the brush covers the pixels whose centre is at most `radius` from its line. A shape adds
its pixels, or erases them. Coordinates are pixels, and the centre of the first pixel is at (0.5, 0.5).
"""

from itertools import pairwise
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.untrusted.sections import Section

MOST_POINTS = 5000  # of a shape; a freehand outline around a large picture has about 1000
LARGEST = (1 << 14) - 1  # px, of a coordinate or radius: the longest side of a WebP picture, which a page shows
TOLERANCE = 1.0  # px between the outline of a mask and its polygon
LEAST_AREA = 20.0  # px: a smaller region of a mask becomes no polygon
Coordinate = Annotated[float, msgspec.Meta(ge=-LARGEST, le=LARGEST)]
Origin = Literal["drawn", "copied", "colour", "carried"]


class MaskShape(Section, frozen=True, kw_only=True):
    """A polygon or a stroke of the brush."""

    tool: Literal["polygon", "brush"]
    points: Annotated[list[tuple[Coordinate, Coordinate]], msgspec.Meta(min_length=1, max_length=MOST_POINTS)]  # x, y
    erase: bool = False
    radius: Annotated[float, msgspec.Meta(ge=0, le=LARGEST)] = 0.0  # px, of the brush
    origin: Origin = "drawn"  # by hand, moved from another frame, or a draft that a person accepted


def filled(shapes: list[MaskShape], width: int, height: int) -> BoolArray:
    """The pixels (H, W) that the shapes cover, True = covered."""
    mask = np.zeros((height, width), bool)
    for shape in shapes:
        points = np.asarray(shape.points, np.float64)
        if shape.tool == "polygon":
            covered = inside_polygon(points, width, height)
        else:
            covered = near_line(points, shape.radius, width, height)
        mask = mask & ~covered if shape.erase else mask | covered
    return mask


def inside_polygon(points: FloatArray, width: int, height: int) -> BoolArray:
    """Pixels (H, W) whose centre is inside the polygon (n, 2) by the even-odd rule; fewer than 3 points: none.

    An edge crosses the row of a pixel centre at x if one end is at most as low as the row and the other lower. Every
    crossing switches the pixels whose centre is at x or to its right.
    """
    switches = np.zeros((height, width + 1), np.int64)
    ends = np.roll(points, -1, axis=0)
    rows = np.arange(height) + 0.5
    for (x0, y0), (x1, y1) in zip(points, ends):
        first, last = np.searchsorted(rows, [min(y0, y1), max(y0, y1)])
        if last > first:
            x = x0 + (rows[first:last] - y0) / (y1 - y0) * (x1 - x0)
            columns = np.clip(np.ceil(x - 0.5), 0, width).astype(np.intp)
            switches[np.arange(first, last), columns] += 1
    return np.cumsum(switches, axis=1)[:, :width] % 2 == 1


def near_line(points: FloatArray, radius: float, width: int, height: int) -> BoolArray:
    """Pixels (H, W) whose centre is at most `radius` from the line through the points (n, 2).

    The area is a union of discs around the points and rectangles around the segments. Each covers one interval of a
    row; the intervals are counted at their ends.
    """
    ends = np.zeros((height, width + 1), np.int64)
    y = np.arange(height) + 0.5
    for centre in points:
        squared = radius**2 - (y - centre[1]) ** 2
        half = np.sqrt(np.where(squared >= 0, squared, np.nan))
        _count(ends, centre[0] - half, centre[0] + half)
    for a, b in pairwise(points):
        length = float(np.hypot(*(b - a)))
        if length > 0:
            side = radius / length * np.array([a[1] - b[1], b[0] - a[0]])
            _count(ends, *_row_intervals(np.array([a + side, b + side, b - side, a - side]), y))
    return np.cumsum(ends, axis=1)[:, :width] > 0


def _row_intervals(corners: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ends of the interval that a convex polygon covers in each row; NaN where there is none."""
    low, high = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0)):
        if y0 != y1:
            crossed = (y >= min(y0, y1)) & (y <= max(y0, y1))
            x = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
            low = np.where(crossed, np.minimum(low, x), low)
            high = np.where(crossed, np.maximum(high, x), high)
    empty = low > high
    return np.where(empty, np.nan, low), np.where(empty, np.nan, high)


def _count(ends: NDArray[np.int64], low: FloatArray, high: FloatArray) -> None:
    """Add 1 where an interval of a row begins and -1 behind its end; pixel centres in [low, high] are inside."""
    width = ends.shape[1] - 1
    rows = np.flatnonzero(np.isfinite(low))
    first = np.clip(np.ceil(low[rows] - 0.5), 0, width).astype(np.intp)
    behind = np.clip(np.floor(high[rows] - 0.5) + 1, 0, width).astype(np.intp)
    kept = behind > first
    ends[rows[kept], first[kept]] += 1
    ends[rows[kept], behind[kept]] -= 1


def shapes_of(mask: BoolArray, origin: Origin) -> list[MaskShape]:
    """Polygons whose area is a mask (H, W), within TOLERANCE of its outline; holes are polygons that erase.

    The largest comes first, so that a hole is erased before the region inside it is drawn. Regions and holes below
    LEAST_AREA, and outlines of more than MOST_POINTS points, are left out.
    """
    from endotsr.clips.opencv.regions import outlines

    found = outlines(mask, TOLERANCE)
    kept = [(points, hole) for points, hole in found if 3 <= len(points) <= MOST_POINTS and _area(points) >= LEAST_AREA]
    return [
        MaskShape(tool="polygon", points=[(float(x), float(y)) for x, y in points], erase=hole, origin=origin)
        for points, hole in sorted(kept, key=lambda pair: -_area(pair[0]))
    ]


def _area(points: FloatArray) -> float:
    """Area of a polygon (n, 2), px."""
    x, y = points.T
    return 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
