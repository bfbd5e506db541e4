"""The poses of a clip from pictures and depth: a chain, returns to places seen before, the direct bundle adjustment.

In: `Views`. Out: `PathEstimate`. Poses are world to camera; the world is the camera of the first frame with a pose.
Frames that show too little remain without a pose; `chain` names the limits.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from endotsr.clips.poses.agreement import left_by
from endotsr.clips.poses.bundle import SCALES, STEPS, PairFit, adjusted
from endotsr.clips.poses.chain import Chain, Link, chained
from endotsr.clips.poses.levels import make_levels
from endotsr.clips.poses.matches import Matcher, matcher_of
from endotsr.clips.poses.movement import LEAST_MATCHES, FramePair, Movement, movement, pairs_that_move
from endotsr.clips.poses.resection import left_over
from endotsr.clips.poses.returns import Return, closed, returns_of
from endotsr.clips.poses.views import Views, between, known_depth, small_views
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose

APART, MOST_APART = 16, 8  # frames between the two, and number of pairs, that show the motion of the tissue
LEVELS = (1, 0)  # halvings of the pictures, coarse to fine
ADJUSTMENTS = len(LEVELS) * SCALES * STEPS  # most steps that the bundle adjustment tries


class PathEstimate(NamedTuple):
    """Poses of a clip, and how well they fit. Lengths in scene units."""

    poses: list[CameraPose | None]  # None: this frame shows too little
    links: list[Link | None]  # how each frame was registered at first
    moves: Movement
    before: PairFit  # of the direct residuals, with the poses of the chain
    after: PairFit
    path: float  # length of the path of the camera
    left: float  # median pixels that the poses leave of the flow between frames, at the size of the flow
    still: float  # median pixels that no motion leaves
    returns: list[Return]  # to places seen before
    own: float  # median motion of the tissue beside the rigid one, between frames at most `APART` apart

    @property
    def agreeing(self) -> float:
        """Mean fraction of the matches that agree, over the frames."""
        found = [link.agreeing for link in self.links if link is not None]
        return float(np.mean(found)) if found else float("nan")


def movement_of(views: Views) -> tuple[Matcher, list[FramePair], Movement]:
    """Whether the scope moves, with the matches that say so."""
    matcher = matcher_of(small_views(views))
    pairs = pairs_that_move(matcher)
    return matcher, pairs, movement(pairs)


def estimated(
    views: Views,
    *,
    on_frame: Callable[[Chain], object] = lambda chain: None,
    on_step: Callable[[], object] = lambda: None,
    begun: Chain | None = None,
    known: tuple[Matcher, list[FramePair], Movement] | None = None,
    with_returns: bool = True,
) -> PathEstimate:
    """Estimate the pose of every frame.

    on_frame  called with the chain after each frame; `begun` continues an interrupted one
    on_step   called after each step of the bundle adjustment, at most `ADJUSTMENTS` times
    known     from `movement_of`, if it was called
    with_returns   whether places that are seen again hold the path against drift

    Raises:  InputError for a clip of one frame or without depth, and as `chained`.
    """
    if views.count < 2:
        raise InputError("one frame: there is no motion to estimate")
    if not (known_depth(views.depth) > 0).any():
        raise InputError("no frame has depth; depth comes first: endotsr depth, or poses of another program")
    matcher, pairs, moves = known or movement_of(views)
    chain = chained(matcher, on_frame, begun)
    kept = [k for k, pose in enumerate(chain.poses) if pose is not None]
    seen = Views(views.images[kept], views.tissue[kept], views.depth[kept], views.camera)
    depth = float(np.median(seen.depth[known_depth(seen.depth) > 0]))
    returns = returns_of(matcher, chain.poses) if with_returns else []
    place = {k: i for i, k in enumerate(kept)}
    inside = [found._replace(source=place[found.source], target=place[found.target]) for found in returns]
    start = closed([chain.poses[k] for k in kept], inside, depth)  # type: ignore[misc]
    bundle = adjusted(make_levels(seen, LEVELS), start, depth, on_step, [found[:2] for found in inside])
    poses: list[CameraPose | None] = [None] * views.count
    for k, pose in zip(kept, bundle.poses):
        poses[k] = pose
    length, (left, still), own = _path(bundle.poses), _leftover(matcher, pairs, poses), _own_motion(matcher, poses)
    return PathEstimate(poses, chain.links, moves, bundle.before, bundle.after, length, left, still, returns, own)


def _path(poses: list[CameraPose]) -> float:
    """Length of the path of the optical centre."""
    centres = np.array([-pose.rotation.T @ pose.translation for pose in poses])
    return float(np.linalg.norm(np.diff(centres, axis=0), axis=1).sum())


def _leftover(matcher: Matcher, pairs: list[FramePair], poses: list[CameraPose | None]) -> tuple[float, float]:
    """Median pixels that the poses leave, and that no motion leaves; NaN without pairs."""
    whole = [pair for pair in pairs if poses[pair.source] and poses[pair.target]]
    if not whole:
        return float("nan"), float("nan")
    left = left_by(matcher, whole, poses)  # type: ignore[arg-type]
    return float(np.median(left)), float(np.median([pair.still for pair in whole]))


def _own_motion(matcher: Matcher, poses: list[CameraPose | None]) -> float:
    """Median length at the tissue of the flow that the poses leave between frames `APART` apart; NaN without any."""
    gap, focal = min(APART, matcher.count - 1), (matcher.camera.fx + matcher.camera.fy) / 2
    found = []
    for i in np.unique(np.linspace(0, matcher.count - 1 - gap, MOST_APART).astype(int)).tolist():
        if poses[i] is None or poses[i + gap] is None:
            continue
        matches = matcher.by_flow(i, i + gap)
        if matches.count >= LEAST_MATCHES and matches.related:
            left = left_over(between(poses, i, i + gap), matches, matcher.camera)  # type: ignore[arg-type]
            found.append(np.median(left * matches.points[2]) / focal)
    return float(np.median(found)) if found else float("nan")
