"""Contrasts between the configurations of an ablation: mean, median and two intervals.

A contrast gives each configuration a coefficient; the coefficients add up to 0. `{"S": 1, "base": -1}` is the step of
S, and `{"A+S": 2, "S": -1, "A+S+L": -1}` the step of A minus the step of L. The value of a seed is the sum over its
runs, so whatever a seed changes in all configurations alike cancels.

Two intervals. *Paired*: Student's, from the n values of the contrast alone (n - 1 degrees of freedom). *Common spread*:
from a run x seed analysis of variance, y_cs = mean + configuration_c + seed_s + noise. The noise is taken to have the
same standard deviation in every configuration of a kind (free or fixed number of Gaussians). With C configurations and
n seeds it has (C - 1)(n - 1) degrees of freedom.

`ablation.increments` has compared the input of every run with that of its partner before.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from endotsr.studies.sweeps.ablation import FIXED, RunPair, estimate
from pages.store.intervals import LEVEL, Interval, student

Record = Any  # content of a file of docs/results
SPLIT = "every_eighth"


class Estimate(NamedTuple):
    """A contrast over the seeds."""

    values: tuple[float, ...]  # by seed
    mean: float
    median: float
    paired: Interval
    common: Interval
    fewest: int | None = None  # seeds of the clip with the fewest; None: `values` are of one clip

    @property
    def seeds(self) -> int:
        """Number of seeds on which a verdict rests: of several clips, that of the clip with the fewest."""
        return len(self.values) if self.fewest is None else self.fewest


class Spread(NamedTuple):
    """The standard deviation of a run that neither its configuration nor its seed explains."""

    deviation: float
    freedom: int
    configurations: int
    seeds: int


def runs_of(found: Record, configuration: str, metric: str) -> dict[int, float]:
    """The metric of the finished runs of a configuration, by seed."""
    chosen = (r for r in found["rows"] if (r["configuration"], r["split"]) == (configuration, SPLIT))
    return {row["seed"]: row[metric] for row in chosen if row.get(metric) is not None}


def contrast(found: Record | None, terms: Mapping[str, int], metric: str) -> Estimate | None:
    """The estimate from all seeds that have every configuration of the contrast; None without such a seed."""
    if found is None:
        return None
    runs = {name: runs_of(found, name, metric) for name in terms}
    seeds = sorted(set.intersection(*(set(of) for of in runs.values())))
    if not seeds:
        return None
    values = tuple(float(sum(c * runs[name][seed] for name, c in terms.items())) for seed in seeds)
    return Estimate(
        values, float(np.mean(values)), float(np.median(values)), student(values)[1],
        _common(values, terms, spread(found, metric, any(FIXED in name for name in terms))),
    )  # fmt: skip


def _common(values: tuple[float, ...], terms: Mapping[str, int], of: Spread | None) -> Interval:
    from scipy import stats

    if of is None:
        return None
    error = of.deviation * np.sqrt(sum(c * c for c in terms.values()) / len(values))
    half = float(stats.t.ppf((1 + LEVEL) / 2, of.freedom) * error)
    return float(np.mean(values)) - half, float(np.mean(values)) + half


def spread(found: Record, metric: str, fixed: bool) -> Spread | None:
    """The common spread of the configurations with a free, or with a fixed, number of Gaussians.

    Returns None with fewer than two configurations or two seeds that all of them have.
    """
    names = dict.fromkeys(row["configuration"] for row in found["rows"] if row["split"] == SPLIT)
    runs = {name: runs_of(found, name, metric) for name in names if (FIXED in name) == fixed}
    runs = {name: of for name, of in runs.items() if len(of) > 1}
    seeds = sorted(set.intersection(*(set(of) for of in runs.values()))) if runs else []
    if len(runs) < 2 or len(seeds) < 2:
        return None
    values = np.array([[of[seed] for seed in seeds] for of in runs.values()])
    left = values - values.mean(1, keepdims=True) - values.mean(0) + values.mean()
    freedom = (len(runs) - 1) * (len(seeds) - 1)
    return Spread(float(np.sqrt(np.square(left).sum() / freedom)), freedom, len(runs), len(seeds))


def averaged(of_clips: list[Estimate]) -> Estimate:
    """The mean over the clips, with equal weights. Paired: Welch's degrees of freedom; common: limits in quadrature."""
    mean, median = float(np.mean([e.mean for e in of_clips])), float(np.mean([e.median for e in of_clips]))
    pairs = [RunPair(str(clip), seed, v) for clip, e in enumerate(of_clips) for seed, v in enumerate(e.values)]
    welch = estimate(pairs)
    low, high = welch.student_low, welch.student_high
    paired = (low, high) if low is not None and high is not None else None
    values = tuple(value for e in of_clips for value in e.values)
    common = _quadrature(mean, [e.common for e in of_clips])
    return Estimate(values, mean, median, paired, common, min(e.seeds for e in of_clips))


def _quadrature(mean: float, limits: list[Interval]) -> Interval:
    known = [of for of in limits if of is not None]
    if len(known) < len(limits):
        return None
    half = float(np.sqrt(sum(((high - low) / 2) ** 2 for low, high in known)) / len(known))
    return mean - half, mean + half
