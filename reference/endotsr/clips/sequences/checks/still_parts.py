"""What stands still in pictures that move: text, logos, the straight border of a second picture, parts of one colour.

In: pictures and tissue of a clip, one frame at a time. Out: findings. An edge that moves is blurred in the mean of all
frames, and an edge that stands still is not. A border between two pictures is an edge in a whole column or row.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.field_of_view import FieldOfView
from endotsr.clips.sequences.sampling import even_frames, reduced_to
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.smaller import resized_nearest
from endotsr.method.kernels.arrays import BoolArray, FloatArray

WORKING, SAMPLED, FEWEST = 640, 32, 6  # columns of the pictures that are looked at; frames of a clip, and of a finding
MARGIN = 2  # pixels of tissue around an edge
SHARP, STILL = 70.0, 0.9  # grey levels from pixel to pixel in the mean of all frames; part of an edge that it keeps
# Sharp still edges, pixels per column of the picture: at most 0.03 on four recorded clips and twelve simulated ones of
# 320 columns or more, and 0.10 to 1.9 with a line of opaque text on tissue of any of them. Small grey text and
# transparent text have less than the limit on most of them.
MANY, NARROWEST = 0.07, 240  # and columns: smaller pictures have sharp edges of their own
FAINT, MOVING = 6.0, 0.75  # grey levels of other edges, and the part of them above which the whole scene stands still
CLEAR = 20.0  # the same of edges above the noise of a sharpened picture, if there is one per column or more
# Tissue that is sharpened has sharp still edges too, but as few among its edges of half their height: at most 0.05 of
# them on the same clips after unsharp masks of radius 1 and 2. Opaque text has 0.13 or more, sharpened with the tissue.
STRONG, AMONG = 35.0, 0.08  # grey levels of those edges, and the number of sharp still ones relative to theirs
BORDER = 4.5  # times the steps beside it: at most 3.1 in tissue on these clips, 6.0 or more between two pictures
ALONE = 2.2  # times the largest step beside it: the blocks of JPEG have at most 1.3 at any quality, borders 3.8 or more
BESIDE, NEXT = 12, 3  # columns on either side that are compared, without the nearest
# Mean slope and differences in a part of one colour, grey levels, and the part of the picture: at most 0.1 % on these
# clips, 1.7 % on three of them after H.264 at CRF 48, and 28 % with a round view in a surround of one colour.
LEVEL, ONE_COLOUR, PLAIN = 0.25, 1.0, 0.05
# Part of the two borders of an inset in a corner that stands out, less that of lines beside them: at most 0.17 on parts
# of these clips, and 0.25 after JPEG of quality 40; 0.49 to 0.97 with another of them in a corner, and less where both
# are dark at a border.
INSET, OUTSTANDING = 0.42, 3.0  # and steps that stand out, times those beside them
LEAST_INSET, LARGEST_INSET, LEAST_SIDE = 0.12, 0.6, 120  # parts of height and width; pixels of a picture
LONG, FLAT = 0.3, 0.5  # part of a column that is tissue; grey levels of a picture without steps


class StillParts:
    """Sums over the frames of a clip of `count` frames."""

    def __init__(self, count: int) -> None:
        self._sampled = set(even_frames(count, SAMPLED))
        self._sum: FloatArray | None = None  # (h, w) grey levels
        self._slopes: FloatArray | None = None  # (2, h, w) absolute slopes across and down
        self._tissue: BoolArray | None = None  # (h, w) in every frame
        self._view, self._frames = FieldOfView(), 0
        self._size = (0, 0)  # of a picture

    def add(self, i: int, picture: NDArray[np.uint8], tissue: BoolArray | None) -> None:
        """Frame i: picture (H, W, 3), tissue (H, W) or None without masks. Pictures of another size are left out."""
        if i not in self._sampled or (self._frames and picture.shape[:2] != self._size):
            return
        grey = _working(picture)
        slopes, mask = np.abs(_slopes(grey)), np.ones(grey.shape, bool) if tissue is None else _reduced(tissue, grey)
        if self._sum is None or self._slopes is None or self._tissue is None:
            self._size, self._sum, self._slopes, self._tissue = picture.shape[:2], grey, slopes, mask
        else:
            self._sum += grey
            self._slopes += slopes
            self._tissue = self._tissue & mask  # the first one may be the mask of the caller
        self._view.add(picture)
        self._frames += 1

    def findings(self, where: str) -> list[Finding]:
        """Findings on burnt-in parts and on borders of a second picture."""
        if self._sum is None or self._slopes is None or self._tissue is None or self._frames < FEWEST:
            return []
        outside = self._view.outside()
        height, width = self._sum.shape
        seen = self._tissue if outside is None else self._tissue & ~resized_nearest(outside, width, height, "mask")
        mean = Edges(self._sum / self._frames, self._slopes / self._frames, _inner(seen), self._size[1] / width)
        border = _border_findings(mean, where) or _inset_findings(mean, where)
        return border or plain_findings(mean, where) or _burnt_in_findings(mean, where)


class Edges(NamedTuple):
    """Means over the frames at the working size."""

    grey: FloatArray  # (h, w)
    slopes: FloatArray  # (2, h, w) mean absolute slopes
    seen: BoolArray  # (h, w) tissue inside the field of view, without its margin
    factor: float  # pixels of a picture per pixel


def _burnt_in_findings(edges: Edges, where: str) -> list[Finding]:
    """Sharp edges that stand still in a scene that moves."""
    kept, every = np.hypot(*_slopes(edges.grey)), np.hypot(*edges.slopes)
    still = kept > STILL * every
    sharp = edges.seen & still & (kept > SHARP)
    others = edges.seen & ~_grown(sharp)
    if sharp.shape[1] < NARROWEST or sharp.sum() <= MANY * sharp.shape[1]:
        return []
    if sharp.sum() < AMONG * (others & (every > STRONG)).sum() or _stands_still(still, others, every):
        return []
    rows, columns = np.nonzero(sharp)
    (top, bottom), (left, right) = (
        np.rint(np.percentile(place, (2, 98)) * edges.factor).astype(int) for place in (rows, columns)
    )
    what = (
        f"sharp edges stand still where the rest moves, most of them in columns {left} to {right} and rows {top} to"
        f" {bottom}: text, a logo, or an instrument at rest"
    )
    return [finding("burnt-in", where, what)]


def _stands_still(still: BoolArray, others: BoolArray, every: FloatArray) -> bool:
    """Whether the edges beside the sharp ones do not move either, or there is none."""
    faint, clear = others & (every > FAINT), others & (every > CLEAR)
    if not faint.any() or still[faint].mean() > MOVING:
        return True
    return bool(clear.sum() >= still.shape[1] and still[clear].mean() > MOVING)


def plain_findings(edges: Edges, where: str) -> list[Finding]:
    """A part of one colour in all frames, as around the round view of a scope or beside the view on a console."""
    plain = edges.seen & (edges.slopes.max(axis=0) < LEVEL)
    if plain.mean() < PLAIN:
        return []
    level = int(np.bincount(np.rint(edges.grey[plain]).astype(int)).argmax())
    plain &= np.abs(edges.grey - level) <= ONE_COLOUR
    if plain.mean() < PLAIN:
        return []
    what = f"{plain.mean():.1%} of the picture has no detail and the grey level {level} in every frame"
    return [finding("plain-part", where, what)]


def _border_findings(edges: Edges, where: str) -> list[Finding]:
    """A straight border over the whole height or width, as between two pictures."""
    for k, line in enumerate(("column", "row")):
        steps, place = _border(edges.slopes[k], edges.seen, k)
        if steps > BORDER:
            what = (
                f"a straight border crosses the pictures at {line} {round(place * edges.factor)}: the step there is"
                f" {steps:.1f} times those beside it"
            )
            return [finding("straight-border", where, what)]
    return []


def _inset_findings(edges: Edges, where: str) -> list[Finding]:
    """A second picture in a corner: a straight border down and one across, which meet."""
    (height, width), found = edges.grey.shape, (0.0, "", 0, 0)
    if min(height, width) < LEAST_SIDE:
        return []
    marked = [_outstanding(slope, axis) & edges.seen for slope, axis in zip(edges.slopes, (1, 0))]
    for down, across in np.ndindex(2, 2):
        turn = (slice(None, None, -1 if down else 1), slice(None, None, -1 if across else 1))
        lines = [_standing_out(part[turn], axis) for part, axis in zip(marked, (0, 1))]
        both = np.minimum(*lines)[: int(LARGEST_INSET * height), : int(LARGEST_INSET * width)]
        both[: int(LEAST_INSET * height)] = both[:, : int(LEAST_INSET * width)] = 0
        row, column = np.unravel_index(both.argmax(), both.shape)
        corner = f"{('upper', 'lower')[down]} {('left', 'right')[across]}"
        found = max(found, (float(both[row, column]), corner, int(row), int(column)))
    part, corner, row, column = found
    if part < INSET:
        return []
    size = f"{round(column * edges.factor)}x{round(row * edges.factor)}"
    what = (
        f"straight borders cut off a part of about {size} pixels in the {corner} corner, as of a second picture there"
    )
    return [finding("straight-border", where, what)]


def _outstanding(slope: FloatArray, axis: int) -> BoolArray:
    """Where a step is larger than those beside it."""
    from scipy.ndimage import uniform_filter1d

    wide, near = 2 * BESIDE + 1, 2 * NEXT - 1
    whole, middle = (size * uniform_filter1d(slope, size, axis) for size in (wide, near))
    return slope > OUTSTANDING * np.maximum((whole - middle) / (wide - near), FLAT)


def _standing_out(marked: BoolArray, axis: int) -> FloatArray:
    """(h, w) part of the line from the border of the picture to each pixel along `axis` that is marked, less the most
    of the lines beside it; within a pixel."""
    from scipy.ndimage import maximum_filter

    part = np.cumsum(marked, axis, dtype=np.float32) / np.expand_dims(np.arange(1, marked.shape[axis] + 1), 1 - axis)
    beside = np.zeros_like(part)
    for shift in range(NEXT, BESIDE + 1):
        for way in (-shift, shift):
            np.maximum(beside, np.roll(part, way, 1 - axis), out=beside)
    return np.asarray(maximum_filter(part - beside, 3))


def _border(slope: FloatArray, seen: BoolArray, axis: int) -> tuple[float, int]:
    """The largest step of a column (axis 0) or row (axis 1), relative to those beside it, and its place."""
    counts = seen.sum(axis=axis)
    long = counts > LONG * seen.shape[axis]
    profile = np.full(counts.size, np.nan)
    profile[long] = np.nanmedian(np.where(seen, slope, np.nan).compress(long, axis=1 - axis), axis=axis)
    best = (0.0, 0)
    for place in np.flatnonzero(long):
        beside = np.concatenate([profile[max(0, place - BESIDE) : max(0, place - NEXT)],
                                 profile[place + NEXT + 1 : place + BESIDE + 1]])  # fmt: skip
        beside = beside[np.isfinite(beside)]
        if beside.size >= BESIDE - NEXT and profile[place] > ALONE * beside.max():
            best = max(best, (float(profile[place] / max(np.median(beside), FLAT)), int(place)))
    return best


def loaded_still_findings(sequence: Sequence, where: str) -> list[Finding]:
    """`StillParts.findings` of a sequence in memory."""
    parts = StillParts(sequence.count)
    for i in even_frames(sequence.count, SAMPLED):
        parts.add(i, sequence.picture(i), sequence.masks[i])
    return parts.findings(where)


def _working(picture: NDArray[np.uint8]) -> FloatArray:
    """The grey picture, its longer side reduced to `WORKING`."""
    return reduced_to(picture, WORKING).mean(axis=2, dtype=np.float32)


def _reduced(tissue: BoolArray, grey: FloatArray) -> BoolArray:
    height, width = grey.shape
    return np.asarray(resized_nearest(tissue, width, height, "mask"), bool)


def _slopes(grey: FloatArray) -> FloatArray:
    """(2, h, w) steps to the next column and to the next row, grey levels; 0 at the end."""
    found = np.zeros((2, *grey.shape), np.float32)
    found[0, :, :-1] = np.diff(grey, axis=1)
    found[1, :-1] = np.diff(grey, axis=0)
    return found


def _inner(seen: BoolArray) -> BoolArray:
    from scipy.ndimage import binary_erosion

    return np.asarray(binary_erosion(seen, iterations=MARGIN, border_value=1), bool)


def _grown(part: BoolArray) -> BoolArray:
    from scipy.ndimage import binary_dilation

    return np.asarray(binary_dilation(part, iterations=4 * MARGIN), bool)
