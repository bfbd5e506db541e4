"""From refused outputs to the mistakes that they resemble, by the fingerprints stored in each case.

Each known mistake was injected into a copy of the reference and examined on some cases. Every output of these cases is
evidence for or against it:

agrees       refused, with the fingerprint of the mistake
fits         refused, as expected, but the wrong output does not identify this mistake
differs      refused, but wrong in another way
passes       passed, although the mistake changes it
unexplained  refused, although the mistake does not change it
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.compare import fingerprint, largest, scale_of
from endotsr.port.judge.diagnose import made_of
from endotsr.port.judge.format import Case, Output, Rule, Shown
from endotsr.port.judge.store import Golden

NEAR = 2e-3  # allowed deviation of a fingerprint from a mistake's, relative to the difference of right and wrong
ROUNDINGS = 4.0  # allowed deviation of a fingerprint, in tolerances of one entry times the root of their number
MOST_PAIRED = 40  # mistakes with the most agreeing outputs that are tried in pairs
LIKE = 1.5  # decades within which the sizes of two rounding mistakes count as equal
NAMED = 0.5  # lowest score of a named mistake
CERTAIN = 0.999  # score from which a name stands above a line of the search
MENTIONED = 0.4  # lowest score of a partial resemblance


class Taken(NamedTuple):
    """An output of a port: its array, None if unreadable or of another shape; its verdict; the answer."""

    status: str
    got: NDArray | None
    expected: NDArray


class Evidence(msgspec.Struct, kw_only=True):
    """Evidence from the outputs of the examined cases on one mistake, as lists of family/case/output."""

    agrees: list[str] = []
    fits: list[str] = []
    differs: list[str] = []
    passes: list[str] = []
    unexplained: list[str] = []
    unlike: float = 0.0
    """of a mistake that loses digits: decades between the sizes of its changes and those found, added up"""

    @property
    def score(self) -> float:
        """From 0 to 1: the fraction of refusals that it explains.

        It is reduced if outputs pass that the mistake would change, and if no fingerprint agrees.
        """
        explained = len(self.agrees) + len(self.fits)
        if not explained:
            return 0.0
        refused = explained + len(self.differs)
        against = len(related(self.passes, (*self.agrees, *self.fits)))
        recall, precision = explained / (refused + len(self.unexplained)), explained / (refused + against)
        return recall * precision**0.25 * (1.0 if self.agrees else 0.6)


class Suspect(msgspec.Struct, kw_only=True):
    """A mistake that explains refusals."""

    flag: str
    title: str
    wrong: str
    score: float
    evidence: Evidence

    @property
    def named(self) -> bool:
        """Whether it explains enough to be named, and not on the evidence of one case that others contradict."""
        return self.score >= NAMED and not contradicted(self.evidence)

    @property
    def whole(self) -> bool:
        """Whether every refused output is explained and no other is expected."""
        return self.named and self.score > CERTAIN


def related(names: Iterable[str], agreeing: Iterable[str]) -> list[str]:
    """Outputs of the operations that agree with a mistake, of their parts, and of what is composed of them.

    Others say nothing: a port may make a mistake in one of two operations that share a rule.
    """
    families = {name.partition("/")[0] for name in agreeing}
    below = families.union(*map(made_of, families))
    return [n for n in names if (own := n.partition("/")[0]) in below or made_of(own) & families]


def contradicted(evidence: Evidence) -> bool:
    """Whether a single case has the values of a mistake, and another case of the same family has not.

    Where no output has a fingerprint, the single case is that of the outputs that are refused as expected.
    Other families say nothing here: a port may make a mistake in one of two operations that share a rule.
    """
    agreeing = {name.rpartition("/")[0] for name in evidence.agrees or evidence.fits}
    family = {case.partition("/")[0] for case in agreeing}
    against = {name.rpartition("/")[0] for name in (*evidence.differs, *evidence.passes, *evidence.unexplained)}
    return len(agreeing) == 1 and any(case.partition("/")[0] in family for case in against - agreeing)


def evidence_of(case: Case, taken: Mapping[str, Taken], precision: str) -> dict[str, Evidence]:
    """Evidence of one case on every mistake examined on it."""
    found, refused = {}, any(one.status == "refused" for one in taken.values())
    for flag, mistake in case.mistakes.items():
        shown, evidence = mistake.shown(precision), Evidence()
        if not (shown or refused):
            continue
        for name, one in taken.items():
            kind = _kind(name, one, case.outputs[name], shown.get(name), precision, mistake.rounding)
            if kind:
                getattr(evidence, kind).append(f"{case.name}/{name}")
            if kind == "fits" and mistake.rounding:
                evidence.unlike += _decades(one, case.outputs[name], shown[name])
        found[flag] = evidence
    return found


def _kind(name: str, one: Taken, asked: Output, shown: Shown | None, precision: str, rounding: bool) -> str:
    """Which list of `Evidence` an output belongs to, "" for none."""
    changes = _changes(shown, asked.compare, precision)
    if one.status == "passed":
        return "passes" if changes else ""
    if one.status != "refused":
        return ""
    if changes is False or shown is None:
        return "unexplained"
    if changes is None:
        return ""
    if one.got is None:
        return "fits" if shown.distance is None and shown.fingerprint is None else "differs"
    if rounding:
        return "fits" if _decades(one, asked, shown) <= LIKE else "differs"
    if shown.fingerprint is None:
        return "fits" if shown.distance is not None else "differs"
    return _fingerprints(name, one, shown, asked.compare, precision)


def _changes(shown: Shown | None, rule: Rule, precision: str) -> bool | None:
    """Whether the mistake makes this output be refused; None: too close to the tolerance to decide."""
    if shown is None:
        return False
    tolerance = rule.float64 if precision == "float64" else rule.float32
    if shown.distance is None or rule.kind not in ("relative", "either-of"):
        return True
    return True if shown.distance > 2 * tolerance else False if shown.distance < tolerance / 2 else None


def _decades(one: Taken, asked: Output, shown: Shown) -> float:
    """Decades between the size of a change and the size of a mistake; infinite if one is not a number."""
    size = 0.0 if one.got is None else largest(one.got, one.expected, asked.compare.scale)
    known = 0 < size < math.inf and shown.distance is not None
    return abs(math.log10(size / shown.distance)) if known else math.inf  # type: ignore[operator]


def _fingerprints(name: str, one: Taken, shown: Shown, rule: Rule, precision: str) -> str:
    assert one.got is not None and shown.fingerprint is not None
    finite = bool(np.isfinite(one.got.astype(np.float64)).all())
    if finite == (shown.distance is None):
        return "differs"
    own = fingerprint(name, one.got)
    if not finite:
        return "agrees" if own == shown.fingerprint else "differs"
    way = abs(shown.fingerprint - fingerprint(name, one.expected))
    tolerance = 0.0 if rule.kind == "exact" else rule.float64 if precision == "float64" else rule.float32
    largest_unit = float(np.max(scale_of(one.expected, rule.scale or "max"))) if one.expected.size else 0.0
    allowed = max(NEAR * way, ROUNDINGS * tolerance * largest_unit * np.sqrt(one.got.size))
    near = abs(own - shown.fingerprint) <= allowed
    if 4 * allowed > way:  # the signs cancel: right and wrong have equal fingerprints, within rounding
        return "fits" if near else "differs"
    return "agrees" if near else "differs"


def merged(parts: Iterable[Mapping[str, Evidence]]) -> dict[str, Evidence]:
    """The combined evidence of several cases on every mistake that explains a refusal in one of them."""
    parts = list(parts)
    found = {flag: Evidence() for part in parts for flag, one in part.items() if one.agrees or one.fits}
    for part in parts:
        for flag in part.keys() & found.keys():
            one, whole = part[flag], found[flag]
            for field in ("agrees", "fits", "differs", "passes", "unexplained"):
                getattr(whole, field).extend(getattr(one, field))
            whole.unlike += one.unlike
    return found


def suspects_of(golden: Golden, evidence: Mapping[str, Evidence]) -> list[Suspect]:
    """Mistakes that explain refusals, best first: by score, then by the number of outputs that agree, then by size."""
    found = [
        Suspect(flag=flag, title=note.title, wrong=note.wrong, score=evidence[flag].score, evidence=evidence[flag])
        for flag, note in golden.manifest.flags.items()
        if flag in evidence and evidence[flag].score >= MENTIONED
    ]
    return sorted(found, key=lambda s: (-round(s.score, 6), -len(s.evidence.agrees), s.evidence.unlike))


class TwoMistakes(NamedTuple):
    """Two mistakes that together explain what neither explains alone."""

    first: str
    second: str
    agrees: tuple[int, int]
    """outputs with the values of the one, and of the other"""


def pair_of(evidence: Mapping[str, Evidence]) -> TwoMistakes | None:
    """The pair of mistakes that explains every refused output, if there is one and no other does.

    Each has to be recognised by outputs of its own, and both together may change no more outputs that pass than there
    are refused ones. Two mistakes in one output have in general the fingerprint of neither. Tried are the MOST_PAIRED
    mistakes with the most agreeing outputs.
    """
    refused = {n for one in evidence.values() for n in (*one.agrees, *one.fits, *one.differs, *one.unexplained)}
    likely = sorted((f for f, one in evidence.items() if one.agrees), key=lambda f: -len(evidence[f].agrees))
    found = []
    for k, first in enumerate(likely[:MOST_PAIRED]):
        for second in likely[k + 1 : MOST_PAIRED]:
            a, b = (set(evidence[flag].agrees) for flag in (first, second))
            passed = {*evidence[first].passes, *evidence[second].passes}
            if a - b and b - a and a | b >= refused and len(passed) <= len(refused):
                found.append(TwoMistakes(first, second, (len(a), len(b))))
    return found[0] if len(found) == 1 else None
