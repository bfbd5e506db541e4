"""The paper's claims as differences between configurations, paired by sequence, split and seed.

In: rows of a sweep. Out: one `Increment` per comparison, split and metric: configuration `with_` minus configuration
`without`, on the same frames, with the same seed and all other settings equal (matched input). Sequences have equal
weights, regardless of their number of seeds. The intervals cover other seeds on these sequences, but not other
sequences. Student's interval has a coverage of 95 % for any number of seeds, if the differences are normal. The
bootstrap reaches 95 % only with many seeds: with three, its interval is at most the range of the differences and misses
the true value in 25 % of all cases.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple, Required, cast

import numpy as np

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.compare import CONFIDENCE, bootstrapped
from endotsr.results.evaluation.records import MetricValues
from endotsr.studies.sweeps.execute import FINISHED
from endotsr.studies.sweeps.results import METRICS, RunRow

FIXED = " fixed"  # suffix of configurations that start from the shared checkpoint, without density control
NO_PRIOR = "S without prior"
COMPONENTS = {"A": "appearance", "S": "spectral_motion", "L": "laplacian"}
MATCHED = ("iterations", "preset", "arrays_sha256")  # keys of a row that must be equal in a pair


def model_of(name: str) -> dict[str, dict[str, Any]]:
    """Settings of a configuration by name: "base", "A+S", "S without prior"."""
    on = set(name.split(" ")[0].split("+")) if name != "base" else set()
    changes: dict[str, dict[str, Any]] = {"model": {setting: key in on for key, setting in COMPONENTS.items()}}
    return changes | ({"loss": {"lambda_msp": 0.0}} if name == NO_PRIOR else {})


CONFIGURATIONS = ("base", "A", "S", "L", "A+S", "A+S+L", NO_PRIOR)


def ablation_spec(
    sequences: Iterable[str], seeds: int, *, fixed_at: int | None, chosen: Iterable[str] = CONFIGURATIONS, **keys: Any
) -> dict[str, Any]:
    """A sweep of the configurations, in the form of `sweeps.spec.spec_of`.

    seeds     number of seeds, 0 .. seeds - 1
    fixed_at  iteration of a checkpoint of the base. Every configuration is also trained from it without density
              control, hence with the same number of Gaussians; None = no such runs
    chosen    names among CONFIGURATIONS
    keys      other keys of the spec
    """
    made: dict[str, Any] = {name: model_of(name) for name in chosen}
    if fixed_at is not None:
        start = {"configuration": "base", "iteration": fixed_at}
        made |= {f"{name}{FIXED}": model_of(name) | {"density": {"until": 0}, "start": start} for name in list(made)}
        made.setdefault("base", model_of("base"))
    return {"sequences": list(sequences), "seeds": list(range(seeds)), "configurations": made, **keys}


class Contrast(NamedTuple):
    """The gain of `with_` over `without`. A comparison from the paper has a published value; the others are ours."""

    claim: str
    with_: str
    without: str
    published: float | None = None  # PSNR full, dB
    says: str = ""  # the paper's claim in our words


# The paper adds S to the base, A to S, and L to both; at a fixed count it adds A and L to S.
COMPARISONS = (
    Contrast("S", "S", "base", 0.04, "Spectral motion improves on the base"),
    Contrast("A added to S", "A+S", "S", 0.29, "Temporal appearance improves on spectral motion alone"),
    Contrast("L added to A and S", "A+S+L", "A+S", 0.12, "Laplacian detail improves on both residuals"),
    Contrast(
        "A and L added to S, fixed count", f"A+S+L{FIXED}", f"S{FIXED}", 0.25,
        "With a fixed number of Gaussians, appearance and detail improve on motion alone",
    ),
    Contrast("Matérn prior", "S", NO_PRIOR, 0.0, "The Matérn prior changes PSNR by less than 0.01 dB"),
    Contrast(
        "Matérn prior, fixed representation", f"S{FIXED}", f"{NO_PRIOR}{FIXED}", 0.0,
        "The same with a fixed representation",
    ),
    Contrast("A alone", "A", "base"),
    Contrast("L alone", "L", "base"),
    Contrast("S added to A", "A+S", "A"),
    Contrast("A and S together", "A+S", "base"),
    Contrast("all three", "A+S+L", "base"),
    Contrast("A, fixed count", f"A{FIXED}", f"base{FIXED}"),
    Contrast("S, fixed count", f"S{FIXED}", f"base{FIXED}"),
    Contrast("L, fixed count", f"L{FIXED}", f"base{FIXED}"),
    Contrast("all three, fixed count", f"A+S+L{FIXED}", f"base{FIXED}"),
)  # fmt: skip


Limits = tuple[float | None, float | None]  # lower and upper


class Estimate(NamedTuple):
    """Mean and median of a paired difference. Limits are None unless every sequence has at least two pairs."""

    mean: float
    student_low: float | None  # of the mean
    student_high: float | None
    mean_low: float | None  # bootstrap
    mean_high: float | None
    median: float
    median_low: float | None  # bootstrap
    median_high: float | None
    pairs: int
    sequences: int


class RunPair(NamedTuple):
    """The metric difference of two runs on the same sequence with the same seed."""

    sequence: str
    seed: int
    difference: float


class Increment(NamedTuple):
    """A comparison on one split and metric."""

    comparison: Contrast
    split: str
    metric: str
    estimate: Estimate
    pairs: list[RunPair]


def increments(rows: Iterable[RunRow]) -> list[Increment]:
    """Every comparison with finished pairs.

    rows     of results.json
    Raises:  InputError if the two runs of a pair have different inputs.
    """
    finished = [row for row in rows if row["status"] == FINISHED]
    found = []
    for split in dict.fromkeys(row["split"] for row in finished):
        for comparison in COMPARISONS:
            for metric in METRICS:
                pairs = paired(finished, comparison, split, metric)
                if pairs:
                    found.append(Increment(comparison, split, metric, estimate(pairs), pairs))
    return found


def paired(rows: list[RunRow], comparison: Contrast, split: str, metric: str) -> list[RunPair]:
    """The differences of all runs that have a partner and a value of the metric."""
    with_, without = (
        {(row["sequence"], row["seed"]): row for row in rows if row["split"] == split and row["configuration"] == name}
        for name in (comparison.with_, comparison.without)
    )
    pairs = []
    for key in with_:
        if key not in without:
            continue
        a, b = with_[key], without[key]
        _refuse_other_input(a, b)
        if (gained := a.get(metric)) is not None and (base := b.get(metric)) is not None:
            pairs.append(RunPair(*key, gained - base))
    return pairs


def _refuse_other_input(a: RunRow, b: RunRow) -> None:
    for key in MATCHED:
        if a.get(key) != b.get(key):
            raise InputError(f"{a['name']} and {b['name']}: differ in {key}; allowed: runs on the same input")


def estimate(pairs: list[RunPair], seed: int = 0) -> Estimate:
    """Mean and median over the seeds of each sequence, averaged over the sequences, with intervals.

    seed     of the resampling
    """
    groups: dict[str, list[float]] = {}
    for pair in pairs:
        groups.setdefault(pair.sequence, []).append(pair.difference)
    samples = tuple(np.array(values) for values in groups.values())
    mean, median = (float(np.mean([middle(sample) for sample in samples])) for middle in (np.mean, np.median))
    known = min(map(len, samples)) >= 2
    of_mean, of_median = (
        bootstrapped(samples, middle, seed) if known else (None, None) for middle in (np.mean, np.median)
    )
    return Estimate(mean, *_student(samples), *of_mean, median, *of_median, len(pairs), len(samples))


def _student(samples: tuple[FloatArray, ...]) -> Limits:
    """Student's interval of the average of the means; Welch's degrees of freedom for several sequences."""
    from scipy.stats import t

    if min(map(len, samples)) < 2:
        return None, None
    middle = float(np.mean([sample.mean() for sample in samples]))
    variances = np.array([sample.var(ddof=1) / len(sample) for sample in samples])  # of the means
    if not variances.sum() ** 2 > 0.0:  # equal values, or underflow
        return middle, middle
    freedom = variances.sum() ** 2 / sum(v**2 / (len(s) - 1) for v, s in zip(variances, samples, strict=True))
    half = float(t.ppf((1 + CONFIDENCE) / 2, freedom) * np.sqrt(variances.sum()) / len(samples))
    return middle - half, middle + half


class Level(MetricValues, total=False):
    """The means of a configuration on a split, with equal weights of the sequences."""

    split: Required[str]
    configuration: Required[str]
    runs: Required[int]
    gaussians: float | None
    training_psnr_tissue: float | None


def levels(rows: Iterable[RunRow]) -> list[Level]:
    """The `Level` of every configuration and split with finished runs."""
    groups: dict[tuple[str, str], list[RunRow]] = {}
    for row in rows:
        if row["status"] == FINISHED:
            groups.setdefault((row["split"], row["configuration"]), []).append(row)
    found = []
    for (split, configuration), members in groups.items():
        values = {name: _equal_weights(members, name) for name in (*METRICS, "gaussians", "training_psnr_tissue")}
        found.append(cast(Level, {"split": split, "configuration": configuration, "runs": len(members), **values}))
    return found


def _equal_weights(rows: list[RunRow], key: str) -> float | None:
    groups: dict[str, list[float]] = {}
    for row in rows:
        if (value := row.get(key)) is not None:
            groups.setdefault(row["sequence"], []).append(float(value))
    return float(np.mean([np.mean(values) for values in groups.values()])) if groups else None
