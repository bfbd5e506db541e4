"""Does the scope move? Told from pictures and depth, or from pictures alone, without poses.

In: a `Matcher`. Out: `Movement`. With depth, a pose is fitted to the flow between two frames. If the scope moves, one
rigid motion explains nearly all of the flow; if only the tissue moves, it does not. Without depth, a long drift of the
whole picture shows a moving scope; its absence shows nothing.
"""

from typing import Literal, NamedTuple

import numpy as np

from endotsr.clips.poses.matches import Matcher, Matches
from endotsr.clips.poses.resection import LEAST, resection

MOVING, STILL = 0.17, 0.25  # fraction of the flow that a rigid motion leaves: at most, and at least
LEAST_FLOW = 0.7  # pixels: with less, the picture hardly moves
DRIFT = 0.05  # of the width: the flow of the whole picture, added up
MOST_PAIRS, LEAST_PAIRS = 24, 4
GAPS = (1, 2, 4, 8, 16)  # frames
WANTED = 4.0  # pixels that the picture moves between the frames of a pair; half of it is enough
LEAST_MATCHES = 25
Answer = Literal["moving", "still", "unclear"]


class FramePair(NamedTuple):
    """Two frames between which the picture moves."""

    source: int
    target: int
    matches: Matches
    still: float  # median length of the flow, pixels
    best: float  # median that the best rigid motion leaves, pixels; `still` if none was found


class Movement(NamedTuple):
    """The answer, and what it is based on."""

    answer: Answer
    left: float  # fraction of the flow that a rigid motion leaves; NaN without depth
    flow: float  # pixels, median over pairs
    pairs: int
    drift: float  # of the width; NaN with depth
    assumed: str = ""  # what of the depth is assumed; with any of it, a rigid motion cannot explain the flow

    @property
    def sentence(self) -> str:
        """The answer with its reason."""
        if np.isfinite(self.drift):
            if self.answer == "moving":
                return f"the whole picture drifts by {self.drift:.0%} of its width: the scope moves"
            return f"the picture drifts by {self.drift:.0%} of its width: without depth, a still scope cannot be told"
        if self.pairs < LEAST_PAIRS:
            return "too few frames match one another: whether the scope moves cannot be told"
        if self.flow < LEAST_FLOW:
            return f"the picture moves by {self.flow:.1f} pixels in the median: the scope is still"
        words = {
            "moving": "the scope moves",
            "still": "the scope is still, and the tissue moves",
            "assumed": f"whether the scope moves cannot be told, as the depth is assumed ({self.assumed})",
            "unclear": f"whether the scope moves is unclear ({MOVING:.0%} to {STILL:.0%} can be either)",
        }
        kind = "assumed" if self.assumed and self.answer == "unclear" else self.answer
        return f"one rigid motion leaves {self.left:.0%} of the flow of {self.flow:.1f} pixels: {words[kind]}"


def pairs_that_move(matcher: Matcher) -> list[FramePair]:
    """Up to `MOST_PAIRS` pairs, each with a gap at which the picture moves enough, or else the widest that matches.

    The search starts from the gap that served last, or from the one below where the picture moved far.

    The first and the last frame are left out: a time that is shifted by a frame has no pose there.
    """
    gaps = [gap for gap in GAPS if gap < matcher.count - 2]
    if not gaps:
        return []
    found: list[FramePair] = []
    at = 0  # index of the gap that served last
    for i in np.unique(np.linspace(1, matcher.count - 2 - gaps[0], MOST_PAIRS).astype(int)).tolist():
        reach = [k for k, gap in enumerate(gaps) if i + gap <= matcher.count - 2]
        kept, at = _best_gap(matcher, i, gaps, min(at, reach[-1]), reach[-1])
        if kept is not None:
            found.append(_pair(matcher, i, i + gaps[at], kept))
            at -= found[-1].still > 3 * WANTED and at > 0
    return found


def _best_gap(matcher: Matcher, i: int, gaps: list[int], at: int, last: int) -> tuple[Matches | None, int]:
    """The matches at the smallest gap from index `at` to `last` at which the picture moves enough, and its index.

    Where none does, the widest gap with enough matches; where the first has too few, the next smaller one.
    """
    kept: Matches | None = None
    chosen = at
    for k in range(at, last + 1):  # wider, while the picture moves too little
        matches = matcher.by_flow(i, i + gaps[k])
        if not _enough(matches):
            break
        kept, chosen = matches, k
        if np.median(matches.flow) >= WANTED / 2:
            break
    while kept is None and at > 0:  # closer, while too little matches
        at -= 1
        matches = matcher.by_flow(i, i + gaps[at])
        if _enough(matches):
            kept, chosen = matches, at
    return kept, chosen


def _enough(matches: Matches) -> bool:
    return matches.count >= LEAST_MATCHES and matches.related


def _pair(matcher: Matcher, source: int, target: int, matches: Matches) -> FramePair:
    still = float(np.median(matches.flow))
    done = resection(matches, matcher.camera, consensus=False) if matches.count >= LEAST else None
    best = still if done is None else min(still, float(np.median(done.distance)))
    return FramePair(source, target, matches, still, best)


def movement(pairs: list[FramePair]) -> Movement:
    """The answer with depth."""
    if len(pairs) < LEAST_PAIRS:
        return Movement("unclear", float("nan"), float("nan"), len(pairs), float("nan"))
    flow = float(np.median([pair.still for pair in pairs]))
    left = float(np.median([pair.best / max(pair.still, 1e-9) for pair in pairs]))
    if flow < LEAST_FLOW:
        answer: Answer = "still"
    else:
        answer = "moving" if left < MOVING else "still" if left > STILL else "unclear"
    return Movement(answer, left, flow, len(pairs), float("nan"))


def with_assumed_depth(moves: Movement, assumed: str) -> Movement:
    """The answer where part of the depth is assumed: never `still` for what a rigid motion leaves.

    The flow of a rigid scene seen from a moving scope depends on its depth. With the wrong depth, a rigid motion leaves
    part of this flow, as it does where the tissue deforms.
    """
    if not assumed:
        return moves
    answer = "unclear" if moves.answer == "still" and moves.flow >= LEAST_FLOW else moves.answer
    return moves._replace(answer=answer, assumed=assumed)


def drift(matcher: Matcher) -> Movement:
    """The answer without depth; a depth of 1 everywhere serves as well, since only the flow is used."""
    place, places = np.zeros(2), [np.zeros(2)]
    for k in range(matcher.count - 1):
        matches = matcher.by_flow(k, k + 1)
        if _enough(matches):
            place = place + np.median(matches.target - matches.source, axis=1)
        places.append(place)
    far = float(np.linalg.norm(np.ptp(places, axis=0))) / matcher.camera.width
    return Movement("moving" if far > DRIFT else "unclear", float("nan"), float("nan"), matcher.count - 1, far)
