"""The paper's claims as differences between configurations, paired by sequence, split and seed.

In: rows of a sweep. Out: one `Increment` per comparison, split and metric: configuration `with_` minus configuration
`without`, on the same frames, with the same seed and all other settings equal (matched input). Sequences have equal
weights, regardless of their number of seeds. The intervals cover other seeds on these sequences, but not other
sequences. Two runs are a pair only if the SHA-256 of their pictures, masks and depth are equal. Runs of which a hash is
not recorded are refused, or paired with a label that says so.

Student's interval has its nominal coverage for any number of seeds from two on, if the differences are normal and of
one sequence; of several, Welch's degrees of freedom make the coverage approximate. The bootstrap needs
many seeds: with three, its interval is at most the range of the differences and misses the true median in a quarter of
all cases.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, Required, cast

import numpy as np

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.compare import CONFIDENCE, bootstrapped
from endotsr.results.evaluation.records import MetricValues
from endotsr.studies.sweeps.execute import FINISHED
from endotsr.studies.sweeps.results import METRICS, RunRow
from endotsr.untrusted.json import Keys

FIXED = " fixed"  # suffix of configurations that start from the shared checkpoint, without density control
NO_PRIOR = "S without prior"
COMPONENTS = {"A": "appearance", "S": "spectral_motion", "L": "laplacian"}
MATCHED = ("iterations", "preset", "arrays_sha256")  # keys of a row that must be equal in a pair


def model_of(name: str) -> dict[str, Keys]:
    """Settings of a configuration by name: "base", "A+S", "S without prior"."""
    on = set(name.split(" ")[0].split("+")) if name != "base" else set()
    changes: dict[str, Keys] = {"model": {setting: key in on for key, setting in COMPONENTS.items()}}
    return changes | ({"loss": {"lambda_msp": 0.0}} if name == NO_PRIOR else {})


CONFIGURATIONS = ("base", "A", "S", "L", "A+S", "A+S+L", NO_PRIOR)


def ablation_spec(
    sequences: Iterable[str], seeds: int, *, fixed_at: int | None, chosen: Iterable[str] = CONFIGURATIONS, **keys: Any
) -> Keys:
    """A sweep of the configurations, in the form of `sweeps.spec.spec_of`.

    seeds     number of seeds, 0 .. seeds - 1
    fixed_at  iteration of a checkpoint of the base. Every configuration is also trained from it without density
              control, hence with the same number of Gaussians; None = no such runs
    chosen    names among CONFIGURATIONS
    keys      other keys of the spec
    """
    made: Keys = {name: model_of(name) for name in chosen}
    if fixed_at is not None:
        start = {"configuration": "base", "iteration": fixed_at}
        made |= {f"{name}{FIXED}": model_of(name) | {"density": {"until": 0}, "start": start} for name in list(made)}
        made.setdefault("base", model_of("base"))
    return {"sequences": list(sequences), "seeds": list(range(seeds)), "configurations": made, **keys}


Metrics = Mapping[str, float]  # metric -> value
BOTH = "EndoNeRF"  # key of a mean over both clips, among values by clip
CLIPS = {  # clip of the paper -> names of its folder
    "pulling": ("endonerf_pulling", "pulling_soft_tissues"),
    "cutting": ("endonerf_cutting", "cutting_tissues_twice"),
}


class Contrast(NamedTuple):
    """The gain of `with_` over `without`. A comparison without `says` is not in the paper but ours."""

    claim: str
    with_: str
    without: str
    says: str = ""  # the paper's claim in our words
    published: Mapping[str, Metrics] = {}  # clip, or BOTH -> metric -> difference as printed; PSNR in dB


# The paper adds S to the base, A to S, and L to both; at a fixed count it adds A and L to S. Its steps are means over
# the EndoNeRF clips (SSIM on tissue); its gain at a fixed count is printed for each clip.
COMPARISONS = (
    Contrast(
        "S", "S", "base", "Spectral motion improves on the base",
        {BOTH: {"psnr_full": 0.04, "ssim_tissue": 0.0003, "lpips": -0.0007, "lpips_symmetric": -0.0007}},
    ),
    Contrast(
        "A added to S", "A+S", "S", "Temporal appearance improves on spectral motion alone",
        {BOTH: {"psnr_full": 0.29, "ssim_tissue": 0.0023, "lpips": -0.0022, "lpips_symmetric": -0.0022}},
    ),
    Contrast(
        "L added to A and S", "A+S+L", "A+S", "Laplacian detail improves on both residuals",
        {BOTH: {"psnr_full": 0.12, "ssim_tissue": 0.0006, "lpips": -0.0009, "lpips_symmetric": -0.0009}},
    ),
    Contrast(
        "A and L added to S, fixed count", f"A+S+L{FIXED}", f"S{FIXED}",
        "With a fixed number of Gaussians, appearance and detail improve on motion alone",
        {
            "pulling": {"psnr_full": 0.25, "lpips": -0.0028, "lpips_symmetric": -0.0028},
            "cutting": {"psnr_full": 0.52, "lpips": -0.0024, "lpips_symmetric": -0.0024},
        },
    ),
    Contrast(
        "Matérn prior, fixed representation", f"S{FIXED}", f"{NO_PRIOR}{FIXED}",
        "At a fixed representation the Matérn prior changes PSNR by less than 0.01 dB",
    ),
    Contrast("Matérn prior", "S", NO_PRIOR),
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
    input_recorded: bool  # the hashes of the input of every run are known, and equal within each pair


def increments(rows: Iterable[RunRow], unrecorded: bool = False) -> list[Increment]:
    """Every comparison with finished pairs.

    rows        of results.json
    unrecorded  also pair runs of which the hashes of the input are not recorded; the increment says so
    Raises:     InputError if the two runs of a pair have different inputs, or if an input is not recorded.
    """
    rows = list(rows)
    finished = [row for row in rows if row["status"] == FINISHED]
    found = []
    for split in dict.fromkeys(row["split"] for row in finished):
        for comparison in COMPARISONS:
            for metric in METRICS:
                pairs = paired(finished, comparison, split, metric, unrecorded)
                if pairs:
                    known = all(map(input_recorded, matched_rows(finished, comparison, split)))
                    found.append(Increment(comparison, split, metric, estimate(pairs), pairs, known))
    return found


def paired(
    rows: list[RunRow], comparison: Contrast, split: str, metric: str, unrecorded: bool = False
) -> list[RunPair]:
    """The differences of all runs that have a partner and a value of the metric; see `increments`."""
    runs = matched_rows(rows, comparison, split)
    pairs = []
    for a, b in zip(runs[::2], runs[1::2], strict=True):
        _refuse_other_input(a, b, unrecorded)
        if (gained := a.get(metric)) is not None and (base := b.get(metric)) is not None:
            pairs.append(RunPair(a["sequence"], a["seed"], gained - base))
    return pairs


def matched_rows(rows: list[RunRow], comparison: Contrast, split: str) -> list[RunRow]:
    """The runs with and without in turn, for every sequence and seed that has both."""
    with_, without = (
        {(row["sequence"], row["seed"]): row for row in rows if row["split"] == split and row["configuration"] == name}
        for name in (comparison.with_, comparison.without)
    )
    return [row for key in with_ if key in without for row in (with_[key], without[key])]


def input_recorded(row: RunRow) -> bool:
    """Whether the hashes of pictures, masks and depth are among the values of a run."""
    return bool(row.get("arrays_sha256"))


def _refuse_other_input(a: RunRow, b: RunRow, unrecorded: bool) -> None:
    for row in (a, b):
        if not (unrecorded or input_recorded(row)):
            raise InputError(f"{row['name']}: arrays_sha256, the hashes of its input, is not recorded; train it again")
    for key in MATCHED:
        known = key != "arrays_sha256" or (input_recorded(a) and input_recorded(b))
        if known and a.get(key) != b.get(key):
            raise InputError(f"{a['name']} and {b['name']} differ in {key}; use runs on the same input as a pair")


def published_value(comparison: Contrast, metric: str, sequences: Iterable[str]) -> float | None:
    """The published difference for these sequences: that of the clip, else of the mean over the clips of the paper.

    sequences   names of the folders; None for a sequence that is not a clip of the paper
    """
    clips = {next((clip for clip, names in CLIPS.items() if name in names), "") for name in sequences}
    keys = [*clips, BOTH] if len(clips) == 1 else [BOTH]
    known = [comparison.published[key] for key in keys if key in comparison.published and "" not in clips]
    return known[0].get(metric) if known else None


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
