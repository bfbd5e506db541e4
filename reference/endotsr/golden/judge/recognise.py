"""From refused outputs to the mistakes that they resemble, by the fingerprints stored in each case."""

from collections.abc import Mapping

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.golden.judge.compare import fingerprint
from endotsr.golden.judge.format import Case
from endotsr.golden.judge.store import Golden

NEAR = 0.02  # fraction of the way from right to wrong within which a fingerprint counts as that of a mistake


class Suspect(msgspec.Struct, kw_only=True):
    """A mistake that explains refusals."""

    flag: str
    title: str
    wrong: str
    matches: int
    """refused cases with its fingerprint"""
    contradicted: int
    """passed cases that it would have spoiled"""


def recognise(case: Case, name: str, got: NDArray, expected: NDArray, looks: dict[str, float]) -> None:
    """Mistakes of the case whose fingerprint this output has, with the distance from that fingerprint."""
    finite = bool(np.isfinite(got.astype(np.float64)).all())
    for flag, mistake in case.mistakes.items():
        if mistake.output != name:
            continue
        if mistake.fingerprint is None:
            if not finite:
                looks[flag] = 0.0
            continue
        right = fingerprint(name, expected)
        way = abs(mistake.fingerprint - right)
        off = abs(fingerprint(name, got) - mistake.fingerprint) if finite else np.inf
        if off <= NEAR * way or (case.outputs[name].compare.kind == "identical" and finite):
            looks[flag] = float(off / way) if way else 0.0


def suspects_of(golden: Golden, verdicts: Mapping[str, tuple[str, list[str]]]) -> list[Suspect]:
    """Mistakes that explain refusals, best first, from status and likely mistakes by case."""
    passed = {name for name, (status, _) in verdicts.items() if status == "passed"}
    found = []
    for flag, note in golden.manifest.flags.items():
        matches = sum(flag in looks for _, looks in verdicts.values())
        if matches:
            against = sum(c.name in passed for c in golden.cases if flag in c.mistakes)
            found.append(Suspect(flag=flag, title=note.title, wrong=note.wrong, matches=matches, contradicted=against))
    return sorted(found, key=lambda s: (s.contradicted - s.matches, s.contradicted))
