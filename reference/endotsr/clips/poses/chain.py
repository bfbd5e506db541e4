"""First poses of a clip: every frame is registered to a keyframe by flow and resection.

In: a `Matcher`. Out: `Chain`, with None for frames that show too little. A frame is tried against the keyframe, then
against the last frame with a pose, by flow; after a gap also by features. Too few matches, or matches that do not look
alike, are not used, so flow registers nothing across a cut to another scene. A keyframe is replaced when too few of its
usable points are found or agree, and after a frame that is registered to another one.
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


class Link(NamedTuple):
    """How a frame was registered."""

    source: int  # frame to which it was registered
    found: int  # matches
    agreeing: float  # of the matches that agree
    left: float  # median distance in pixels that the pose leaves
    still: float  # median length of the flow, pixels


class Chain(NamedTuple):
    """A pose and a link for each frame done; None where there is none. The first frame with a pose has no link."""

    poses: list[CameraPose | None]
    links: list[Link | None]
    key: int  # keyframe
    last: int  # last frame with a pose


def chained(
    matcher: Matcher, on_frame: Callable[[Chain], object] = lambda chain: None, begun: Chain | None = None
) -> Chain:
    """Register every frame.

    on_frame  called with the chain after each frame
    begun     the chain of an interrupted call, which continues

    Raises:  InputError if no frame has enough usable pixels with depth, if no later frame can be registered to the
             first one that has, or if more than `LONGEST_GAP` frames in a row after it have no pose, also at the end.
    """
    chain = begun or _beginning(matcher)
    first = next(k for k, pose in enumerate(chain.poses) if pose is not None)
    while (j := len(chain.poses)) < matcher.count:
        chain = _lengthened(matcher, chain, j)
        on_frame(chain)
    _refuse_gap(chain.last, matcher.count, matcher.count)
    if matcher.count > 1 and chain.last == first:
        raise InputError(f"frame {first}: no later frame has {LEAST} points in common with it")
    return chain


def _beginning(matcher: Matcher) -> Chain:
    first = _first_frame(matcher)
    return Chain([*[None] * first, IDENTITY], [None] * (first + 1), first, first)


def _lengthened(matcher: Matcher, chain: Chain, j: int) -> Chain:
    """The chain with frame j."""
    found = _registered(matcher, chain, j)
    if found is None:
        return chain._replace(poses=[*chain.poses, None], links=[*chain.links, None])
    source, matches, done = found
    start = chain.poses[source]
    assert start is not None
    _refuse_gap(chain.last, j, matcher.count)
    still = float(np.median(matches.flow))
    link = Link(source, matches.count, done.agreeing, float(np.median(done.distance)), still)
    holds = source == chain.key and done.agreeing >= KEEP_AGREEING and matches.count >= KEEP_FOUND * matches.usable
    pose = compose(done.pose, start)
    return Chain([*chain.poses, pose], [*chain.links, link], chain.key if holds else j, j)


def _first_frame(matcher: Matcher) -> int:
    """The first frame with enough usable pixels that have depth. Raises InputError without one."""
    for k in range(matcher.count):
        if matcher.seen_points(k) >= LEAST:
            return k
    raise InputError(
        "no frame has usable tissue with depth; a highlight, a dark pixel and a mask's edge are not usable"
    )


def _refuse_gap(last: int, j: int, count: int) -> None:
    if j - last - 1 > LONGEST_GAP:
        raise InputError(
            f"frames {last + 1} to {j - 1} cannot be registered: {j - last - 1} in a row, and {LONGEST_GAP} are bridged"
            f" at most; cut the clip there: endotsr prepare --frames :{last + 1}" + f" and --frames {j}:" * (j < count)
        )


def _registered(matcher: Matcher, chain: Chain, j: int) -> tuple[int, Matches, Resection] | None:
    """The source, the matches and the resection of frame j; None if it cannot be registered."""
    known, key, last = [pose or IDENTITY for pose in chain.poses], chain.key, chain.last
    for source in dict.fromkeys((key, last)):
        matches = matcher.by_flow(source, j)
        done = resection(matches, matcher.camera, between(known, source, last)) if matches.related else None
        if done is None:
            continue
        enough = done.agreeing >= USE_AGREEING and matches.count >= USE_FOUND * matches.usable
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
