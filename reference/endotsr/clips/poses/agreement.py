"""Do given poses, depth and pictures agree? And if not: which misreading of the poses would?

In: a `Matcher` and one pose per frame. Out: `Agreement`. The flow between two frames is measured once; given poses and
every usual misreading predict it from the depth. A median over points and one over pairs give the pixels that a reading
leaves.
"""

from typing import Literal, NamedTuple

import numpy as np

from endotsr.clips.poses.matches import Matcher
from endotsr.clips.poses.movement import LEAST_FLOW, LEAST_PAIRS, FramePair, pairs_that_move
from endotsr.clips.poses.readings import readings
from endotsr.clips.poses.resection import left_over
from endotsr.clips.poses.views import between
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose

FARTHEST = 1e4  # pixels that count for a point behind the camera
CLEARLY, PIXELS, PAIRS, OF_STILL = 0.75, 0.1, 0.75, 0.5
"""A misreading is named if it leaves less than 0.75 of what the given poses leave, 0.1 pixels less, less in 75 % of the
pairs, and less than half of what no motion leaves."""
WORSE, EXPLAINED = 1.25, 0.6  # given poses leave more than no motion; the best rigid motion explains the pictures
DOUBTFUL, SLACK = 2.0, 0.3  # times the best rigid motion, and pixels
SAME = 1e-9  # poses that differ by less do not differ
Verdict = Literal["same", "not checked", "fits", "doubtful", "misread", "wrong"]


class Agreement(NamedTuple):
    """The verdict; all numbers in pixels, medians over pairs."""

    verdict: Verdict
    given: float  # that the given poses leave
    still: float  # that no motion leaves
    best: float  # that the best rigid motion between two frames leaves
    reading: str = ""  # the misreading that explains the pictures
    left: float = float("nan")  # that it leaves
    remedy: str = ""
    pairs: int = 0
    table: tuple[tuple[str, float], ...] = ()  # every reading, and what it leaves

    @property
    def sentence(self) -> str:
        """The finding in words."""
        base = f"given poses leave {self.given:.2f} pixels, no motion {self.still:.2f}, the best motion {self.best:.2f}"
        return {
            "same": "all poses are the same",
            "not checked": f"the poses were not held against the pictures: {self.pairs} pairs of frames match and move",
            "fits": f"poses, depth and pictures agree ({base})",
            "doubtful": f"poses, depth and pictures agree only roughly ({base})",
            "misread": f"another reading explains the pictures: {self.reading} leaves {self.left:.2f} pixels; {base}",
            "wrong": f"poses, depth and pictures do not agree, and no usual misreading explains them ({base})"
            + self._closest,
        }[self.verdict]

    @property
    def _closest(self) -> str:
        """The misreading that leaves least, as the end of a sentence; "" if it leaves nearly as much as given poses."""
        if not self.left < min(CLEARLY * self.given, self.still):
            return ""
        return f"; {self.reading} comes closest and leaves {self.left:.2f} pixels: {self.remedy}"


def agreement(matcher: Matcher, poses: list[CameraPose], pairs: list[FramePair] | None = None) -> Agreement:
    """Hold poses against the pictures.

    poses   one per frame, world to camera
    pairs   from `pairs_that_move`, if they are known
    """
    rows = np.array([np.concatenate([pose.rotation.ravel(), pose.translation]) for pose in poses])
    if np.ptp(rows, axis=0).max() < SAME:
        return Agreement("same", float("nan"), float("nan"), float("nan"))
    pairs = pairs_that_move(matcher) if pairs is None else pairs
    still, best = (float(np.median([getattr(p, name) for p in pairs] or [0.0])) for name in ("still", "best"))
    if len(pairs) < LEAST_PAIRS or still < LEAST_FLOW:
        return Agreement("not checked", float("nan"), still, best, pairs=len(pairs))
    given = left_by(matcher, pairs, poses)
    others = {reading.name: (left_by(matcher, pairs, reading.poses), reading) for reading in readings(poses)}
    name = min(others, key=lambda name: float(np.median(others[name][0])))
    left, reading = others[name]
    table = (("as given", float(np.median(given))), *((n, float(np.median(e))) for n, (e, _) in others.items()))
    found = Agreement(
        "fits", float(np.median(given)), still, best, name, float(np.median(left)), reading.remedy, len(pairs), table
    )
    return found._replace(verdict=_verdict(found, float((left < given).mean())))


def _verdict(found: Agreement, wins: float) -> Verdict:
    """The rule; `wins`: fraction of the pairs in which the best misreading leaves less than the given poses."""
    closer = found.left < CLEARLY * found.given and found.given - found.left > PIXELS
    if closer and wins >= PAIRS and found.left < OF_STILL * found.still:
        return "misread"
    if found.given > WORSE * found.still and found.best < EXPLAINED * found.still:
        return "wrong"
    return "doubtful" if found.given > max(OF_STILL * found.still, DOUBTFUL * found.best + SLACK) else "fits"


def left_by(matcher: Matcher, pairs: list[FramePair], poses: list[CameraPose]) -> FloatArray:
    """(pairs,) median distance in pixels between measured flow and that of the poses."""
    found = []
    for pair in pairs:
        left = left_over(between(poses, pair.source, pair.target), pair.matches, matcher.camera)
        found.append(np.median(np.minimum(left, FARTHEST)))
    return np.array(found)
