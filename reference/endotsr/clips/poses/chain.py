"""First poses of a clip: every frame is registered to a keyframe by flow and resection.

In: a `Matcher`. Out: `Chain`, with None for frames that show too little. A frame is tried against the keyframe, then
against the last frame with a pose, by flow; after a gap also by features. A keyframe is replaced when too few of its
usable points are found or agree.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from endotsr.clips.poses.matches import Matcher, Matches
from endotsr.clips.poses.resection import LEAST, Resection, resection
from endotsr.clips.poses.views import IDENTITY, between, compose
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose

KEEP_AGREEING, KEEP_FOUND = 0.75, 0.5  # shares of the matches, and of the usable points, below which a keyframe goes
USE_AGREEING, USE_FOUND = 0.6, 0.35  # below which a match with the keyframe is not used
LONGEST_GAP = 8  # frames without a pose in a row that are bridged
OnFrame = Callable[[int, int], None]


class Link(NamedTuple):
    """How a frame was registered."""

    source: int  # frame to which it was registered
    found: int  # matches
    share: float  # of the matches that agree
    left: float  # median distance in pixels that the pose leaves
    still: float  # median length of the flow, pixels


class Chain(NamedTuple):
    """A pose and a link for each frame; None where there is none. The first frame with a pose has no link."""

    poses: list[CameraPose | None]
    links: list[Link | None]

    @property
    def without(self) -> list[int]:
        """Frames without a pose."""
        return [k for k, pose in enumerate(self.poses) if pose is None]


def chained(matcher: Matcher, on_frame: OnFrame = lambda i, n: None) -> Chain:
    """Register every frame.

    on_frame  called with (frames done, frames in all)

    Raises:  InputError if no two frames can be registered, or if more than `LONGEST_GAP` frames in a row have no pose
             between frames that have one.
    """
    count = matcher.views.count
    poses: list[CameraPose | None] = [None] * count
    links: list[Link | None] = [None] * count
    first = _first_frame(matcher)
    poses[first], key, last = IDENTITY, first, first
    for j in range(first + 1, count):
        found = _registered(matcher, poses, key, last, j)
        if found is not None:
            source, matches, done = found
            start = poses[source]
            assert start is not None
            _refuse_gap(last, j)
            poses[j] = compose(done.pose, start)
            still = float(np.median(matches.flow))
            links[j] = Link(source, matches.count, done.share, float(np.median(done.distance)), still)
            if source != key or done.share < KEEP_AGREEING or matches.count < KEEP_FOUND * matches.usable:
                key = j
            last = j
        on_frame(j + 1, count)
    if count > 1 and last == first:
        raise InputError(f"frames {first} and {first + 1}: fewer than {LEAST} points match, nor in any later frame")
    return Chain(poses, links)


def _first_frame(matcher: Matcher) -> int:
    """The first frame with enough usable pixels that have depth. Raises InputError without one."""
    for k, (usable, depth) in enumerate(zip(matcher.usable, matcher.views.depth)):
        if (usable & (depth > 0)).sum() >= LEAST:
            return k
    raise InputError(
        "no frame has usable tissue with depth; a highlight, a dark pixel and a mask's edge are not usable"
    )


def _refuse_gap(last: int, j: int) -> None:
    if j - last - 1 > LONGEST_GAP:
        raise InputError(
            f"frames {last + 1} to {j - 1} cannot be registered: {j - last - 1} in a row, and {LONGEST_GAP} are bridged"
            f" at most; cut the clip there: endotsr prepare --frames :{last + 1} and --frames {j}:"
        )


def _registered(
    matcher: Matcher, poses: list[CameraPose | None], key: int, last: int, j: int
) -> tuple[int, Matches, Resection] | None:
    """The source, the matches and the resection of frame j; None if it cannot be registered."""
    known = [pose if pose is not None else IDENTITY for pose in poses]
    for source in dict.fromkeys((key, last)):
        matches = matcher.by_flow(source, j)
        done = resection(matches, matcher.camera, between(known, source, last))
        if done is None:
            continue
        enough = done.share >= USE_AGREEING and matches.count >= USE_FOUND * matches.usable
        if enough or source == last:
            return source, matches, done
    if j == last + 1:
        return None
    for source in dict.fromkeys((last, key)):
        matches = matcher.by_features(source, j)
        done = resection(matches, matcher.camera)
        if done is not None:
            return source, matches, done
    return None
