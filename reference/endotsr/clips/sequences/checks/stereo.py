"""Whether the two views of a stereo clip are rectified and of one moment, for `check` and `depth`.

In: the pairs of a clip. Out: findings. A right view that is the left one has no parallax. The steps of both views from
frame to frame show a right view that stands still. Features that both views share show the rows: in a rectified pair, a
point lies in the same row of both, and farther left in the right view. A right view that is late shows a point where it
was some frames before, and its rows differ by the motion in between.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.geometry import Features, features_of, grey_of, matched_features
from endotsr.clips.poses.views import side_of, usable_pixels
from endotsr.clips.sequences.checks.copies import SAME, steps_between
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.checks.late import lag_in_words
from endotsr.clips.sequences.clip import Clip, Picture
from endotsr.clips.sequences.sampling import even_frames, longest_run, small_picture
from endotsr.clips.sequences.view_frames import frame_of
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.names import counted

SAMPLED, WIDEST, STRONGEST = 8, 640, 1500  # frames whose features are matched, columns, and features of a picture
MOVES = 10 * SAME  # grey levels by which the left view changes where it is said to move
LEAST_STEPS, PART = 4, 0.3  # repeats of the right view in a row, or of all steps
OFF_ROW = 0.08  # of the height: a match farther from its row is wrong
NEAR, ROUNDS = 1.5, 8  # pixels from the fitted rows, and rounds of a fit
FEWEST, AGREEING = 60, 0.6  # matches that agree, and fraction of all
APART = 0.75  # pixels between the rows of a point
# Pixels, and the part of the matches that lie farther right in the right view: at most 0.02 in da Vinci frames,
# EndoNeRF pulling and four simulated clips, whole, at half size and in parts; exchanged, 0.97 or more.
RIGHT, EXCHANGED = 0.5, 0.8
CLEAR = 1.0  # pixels up or down from frame to frame
FEWEST_MOVED, PART_MOVED = 15, 0.1  # points of a frame that move so, and fraction of those that are found again
LATE, ALIKE = 0.6, 0.75  # frames, and fraction of the sampled frames that show at least half of them
# Frames by which the steps of both views are moved against each other, their least correlation at the best shift, its
# gain over that without a shift, and the shortest shift. EndoNeRF pulling: 0.97 at a shift of one, gain 0.06; with the
# right view 3 frames early and 5 late 0.40 and 0.31.
SHIFTS, FITS, GAIN, SHORTEST = 8, 0.85, 0.25, 2


# Brightness of one view, of that of the other (medians): at most 1.02 on two recorded and seven simulated clips.
UNEQUAL = 1.3


class RowMatches(NamedTuple):
    """M points that both views of a pair show, and their motion since the frame before."""

    place: FloatArray  # (2, M) in the left view, fractions of width and height
    down: FloatArray  # (M,) rows of the right view below those of the left one, pixels
    across: FloatArray  # (M,) columns of the right view to the right of those of the left one, pixels
    motion: FloatArray  # (M,) downwards since the frame before, pixels; NaN where it is unknown


class PairViews:
    """What is kept of the pairs of a clip of `count` frames, which are added in order."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.sampled = {max(1, i) for i in even_frames(count, SAMPLED)}
        self.small: tuple[list[NDArray], list[NDArray]] = ([], [])
        self.rows: list[RowMatches] = []
        self.before: Picture | None = None

    def add(self, i: int, left: Picture, right: Picture | None) -> None:
        """Frame i; a frame without a right view of the size of the left one is left out."""
        if right is None or right.shape != left.shape:
            return
        for kept, picture in zip(self.small, (left, right)):
            kept.append(small_picture(picture))
        if i in self.sampled and self.before is not None:
            self.rows.append(row_matches(left, right, self.before))
        self.before = left

    def findings(self, files: list[Path]) -> list[Finding]:
        """Findings on the pairs with these right pictures; none if a frame was left out."""
        if len(self.small[0]) < max(2, self.count):
            return []
        where, names = str(files[0].parent), [file.name for file in files]
        left, right = (steps_between(small) for small in self.small)
        frozen = frozen_finding(left, right, names, where)
        if wrong := frozen or same_finding(*self.small, names, where) or exchanged_finding(self.rows, where):
            return wrong
        late = late_finding(self.rows, where) or late_steps_finding(left, right, where)
        return late + row_finding(self.rows, where) + unequal_finding(*self.small, where)


def pair_findings(clip: Clip) -> list[Finding]:
    """Findings on the pairs of a clip; none without right pictures, or if one of them cannot be read."""
    if not clip.right:
        return []
    views = PairViews(clip.count)
    try:
        for i, (left, right) in enumerate(clip.pictures(list(range(clip.count)))):
            views.add(i, left, right)
    except InputError:
        return []  # `depth` names the file; training reads no right picture
    return views.findings(clip.right)


def same_finding(left: list[NDArray], right: list[NDArray], names: list[str], where: str) -> list[Finding]:
    """A warning on right pictures that are the left ones: their small pictures differ by less than any noise."""
    equal = np.array([np.abs(b - a).mean() < SAME and np.ptp(a) > 0 for a, b in zip(left, right)])
    if not equal.any():
        return []
    first = int(equal.argmax())
    what = f"the right picture is the left one in {equal.sum()} of {counted(len(names), 'frame')}, first {names[first]}"
    return [finding("same-views", where, what, first)]


def unequal_finding(left: list[NDArray], right: list[NDArray], where: str) -> list[Finding]:
    """A warning on a right view that is far darker or brighter than the left one."""
    ratio = float(np.median([(b.mean() + 1) / (a.mean() + 1) for a, b in zip(left, right)]))
    if 1 / UNEQUAL < ratio < UNEQUAL:
        return []
    what = f"the right view is {ratio:.2f} times as bright as the left one (median; the limit is {UNEQUAL} times)"
    return [finding("unequal-views", where, what)]


def frozen_finding(left: FloatArray, right: FloatArray, names: list[str], where: str) -> list[Finding]:
    """A warning on a right view that repeats its picture while the left one moves.

    left, right   (n - 1,) steps between frames, grey levels
    """
    still = (right < SAME) & (left > MOVES)
    first, last = longest_run(still)
    if not still.any() or (last - first < LEAST_STEPS and still.mean() < PART):
        return []
    what = (
        f"the right view repeats its picture in {still.sum()} of {len(still)} steps, from {names[first]} to"
        f" {names[last]} without a break, while the left one changes by {np.median(left[still]):.1f} grey levels"
    )
    return [finding("frozen-right-view", where, what, first + 1)]


def row_matches(left: Picture, right: Picture, before: Picture | None = None) -> RowMatches:
    """The matches of a pair, and of its left view with the frame before, if there is one."""
    side = side_of(left.shape[1], WIDEST)
    here, there = (_features(picture, side) for picture in (left, right))
    one, other = matched_features(here, there)
    across, down = side * (there.place[other] - here.place[one]).T
    height, width = (size // side for size in left.shape[:2])
    near = np.abs(down) < OFF_ROW * left.shape[0]
    motion = np.full(len(here.place), np.nan)
    if before is not None:
        past = _features(before, side)
        moved, came = matched_features(here, past)
        motion[moved] = side * (here.place[moved, 1] - past.place[came, 1])
    place = here.place[one[near]].T / np.array([[width], [height]])
    return RowMatches(place, down[near], across[near], motion[one[near]])


def _features(picture: Picture, side: int) -> Features:
    image = frame_of(picture).reduced(side).image
    return features_of(grey_of(image), usable_pixels(image, np.ones(image.shape[1:], bool))).first(STRONGEST)


def rows_apart(rows: list[RowMatches]) -> FloatArray:
    """How far points lie above or below their row in the left view, (K,) pixels, of the K matches near a robust fit.

    The fit is linear in the place, over all sampled frames. K is 0 for few matches, and where few of them agree.
    """
    none = np.zeros(0)
    if sum(r.down.size for r in rows) < FEWEST:
        return none
    place, down = np.concatenate([r.place for r in rows], axis=1), np.concatenate([r.down for r in rows])
    design = np.column_stack([np.ones(down.size), *(place - 0.5)])
    offset, near = np.full(down.size, np.median(down)), 4 * NEAR
    for _ in range(ROUNDS):
        kept = np.abs(down - offset) < near
        if kept.sum() < FEWEST:
            return none
        offset, near = design @ np.linalg.lstsq(design[kept], down[kept], rcond=None)[0], NEAR
    kept = np.abs(down - offset) < NEAR
    return none if kept.sum() < max(FEWEST, AGREEING * down.size) else np.abs(offset[kept])


def row_finding(rows: list[RowMatches], where: str) -> list[Finding]:
    """A warning on pairs whose rows are apart."""
    apart = rows_apart(rows)
    if not apart.size or np.median(apart) < APART:
        return []
    what = (
        f"points lie {np.median(apart):.1f} pixels (at most {apart.max():.1f}) above or below their row in the left"
        f" view: {apart.size} matches in {len(rows)} frames; the limit is {APART:g}"
    )
    return [finding("unrectified-views", where, what)]


def exchanged_finding(rows: list[RowMatches], where: str) -> list[Finding]:
    """A warning on pairs whose points lie farther right in the right view."""
    across = np.concatenate([r.across for r in rows]) if rows else np.zeros(0)
    if across.size < FEWEST or (part := float(np.mean(across > RIGHT))) < EXCHANGED:
        return []
    what = (
        f"points lie {np.median(across):.1f} pixels farther right in the right view than in the left one (median;"
        f" {part:.1%} of {across.size} matches in {len(rows)} frames)"
    )
    return [finding("exchanged-views", where, what)]


def late_finding(rows: list[RowMatches], where: str) -> list[Finding]:
    """A warning on a right view of another frame: its rows differ by the motion of the points up or down.

    Edges:   none where few points move by a pixel a frame.
    """
    known = [np.isfinite(found.motion) for found in rows]
    moving = [(r.down[k], r.motion[k]) for r, k in zip(rows, known) if _many_move(r.motion[k])]
    if len(moving) < LEAST_STEPS - 1:
        return []
    down, motion = (np.concatenate(values) for values in zip(*moving))
    far, frames = np.abs(motion) > CLEAR, 0.0
    for _ in range(ROUNDS):  # down = usual - frames * motion
        usual = np.median(down + frames * motion)
        frames = float(np.median((usual - down[far]) / motion[far]))
    by_frame = [np.median((usual - d[far]) / m[far]) for d, m in moving for far in [np.abs(m) > CLEAR]]
    if abs(frames) < LATE or np.mean(np.array(by_frame) / frames > 0.5) < ALIKE:
        return []
    lag = int(np.copysign(max(1, round(abs(frames))), frames))
    what = (
        f"the right view is about {lag_in_words(lag)}: points that move up or"
        f" down lie where the left view {'showed' if frames > 0 else 'will show'} them (estimate"
        f" {abs(frames):.1f}, from {counted(len(moving), 'frame')})"
    )
    return [finding("late-right-view", where, what)]


def late_steps_finding(left: FloatArray, right: FloatArray, where: str) -> list[Finding]:
    """A warning on a right view of another frame, by the steps of both views: motion is fast and slow in both at once.

    left, right   (n - 1,) steps between frames, grey levels

    Edges:   none for steps of 0, and where the steps of other frames are as alike.
    """
    if len(left) < 3 * SHIFTS or min(left.min(), right.min()) < SAME:
        return []
    middle = np.log(left[SHIFTS : len(left) - SHIFTS])
    shifts = range(-SHIFTS, SHIFTS + 1)
    moved = {k: np.log(right[SHIFTS + k : len(right) - SHIFTS + k]) for k in shifts}
    if min(np.ptp(values) for values in (middle, *moved.values())) == 0:
        return []
    alike = {k: float(np.corrcoef(middle, values)[0, 1]) for k, values in moved.items()}
    best = max(alike, key=lambda k: alike[k])
    if abs(best) < SHORTEST or alike[best] < FITS or alike[best] - alike[0] < GAIN:
        return []
    what = (
        f"the right view is about {lag_in_words(best)}: its steps from frame to frame"
        f" fit those of the left view then (correlation {alike[best]:.2f}, as stored {alike[0]:.2f})"
    )
    return [finding("late-right-view", where, what)]


def _many_move(motion: FloatArray) -> bool:
    """Whether many points move; of points at rest, wrong matches seem to."""
    far = np.abs(motion) > CLEAR
    return bool(far.sum() >= FEWEST_MOVED and far.mean() >= PART_MOVED)
