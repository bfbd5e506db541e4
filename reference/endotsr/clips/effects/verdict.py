"""The result of one test: presence of an effect, confidence, and a map or curve for display."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from endotsr.method.kernels.arrays import FloatArray

UNKNOWN = "unknown"  # kind of a verdict for which the clip is insufficient


class Curve(NamedTuple):
    """A quantity over time or frequency."""

    name: str  # of the quantity, with its unit
    x_name: str
    x: FloatArray  # (k,)
    lines: dict[str, FloatArray]  # by legend entry, (k,) each
    threshold: float | None = None


class Map(NamedTuple):
    """A quantity over the working picture; NaN where unknown."""

    name: str  # of the quantity, with its unit
    values: FloatArray  # (h, w)


class EffectVerdict(NamedTuple):
    """The result of one test."""

    effect: str  # key of `inspect.EFFECTS`
    present: bool
    kind: str  # one or two words: "none", "periodic", "white balance"
    statistic: float
    threshold: float  # of the statistic; the effect is present at or above it, and above it for a fact
    unit: str  # of both
    test: str  # description of the statistic
    false_positive_rate: float | None  # designed rate; 0 for a fact, None where the threshold has no rate
    reason: str  # one sentence
    details: Mapping[str, Any] = MappingProxyType({})  # JSON-able numbers, by name
    curve: Curve | None = None
    map: Map | None = None

    @property
    def confidence(self) -> float:
        """1 - (smaller / larger)^2 / 2 of statistic and threshold: 0.5 at the threshold, towards 1 on either side.

        This measures the distance from the threshold and is not a probability. It is 1 for a fact and 0.5 for
        "unknown".
        """
        if self.kind == UNKNOWN:
            return 0.5
        if self.false_positive_rate == 0.0:
            return 1.0
        small, large = sorted((abs(self.statistic), abs(self.threshold)))
        return 1.0 - 0.5 * (small / large) ** 2 if large > 0 else 0.5


def sentence(clauses: Mapping[str, str], found: Iterable[str], otherwise: str) -> str:
    """One sentence that joins the clauses of what was found; `otherwise` if nothing was."""
    joined = ", ".join(clauses[name] for name in found)
    return joined[0].upper() + joined[1:] + "." if joined else otherwise


def verdict_record(verdict: EffectVerdict) -> dict[str, Any]:
    """The verdict as JSON-able data, without picture and curve."""
    fields = verdict._asdict()
    kept = {k: v for k, v in fields.items() if k not in ("curve", "map", "details")}
    return kept | {"details": dict(verdict.details), "confidence": verdict.confidence}
