"""What results.json and ablation.json hold: plain values, with None where there is none."""

from typing import Any, Required, TypedDict

from endotsr.evaluation.records import FrameMetrics, MetricValues
from endotsr.runs.machine import MachinePart


class RunRow(MetricValues, total=False):
    """One run; a run that is not finished has no numbers, a failed one a reason."""

    name: Required[str]
    sequence: Required[str]
    split: Required[str]
    configuration: Required[str]
    seed: Required[int]
    status: Required[str]
    reason: str
    training_psnr_full: float | None
    training_psnr_tissue: float | None
    cross_fade_psnr_full: float | None
    cross_fade_psnr_tissue: float | None
    iterations: int | None
    gaussians: int | None
    seconds: float | None
    peak_memory_bytes: int | None
    threads: int | None
    preset: str
    width: int | None
    height: int | None
    arrays_sha256: dict[str, str]
    settings: dict[str, Any]
    per_frame: list[FrameMetrics]
    baselines: dict[str, dict[str, Any]]  # label and mean of each
    measures: dict[str, dict[str, Any]]
    versions: dict[str, str] | None
    machine: MachinePart | None


class Level(MetricValues, total=False):
    """The means of a configuration on a split, sequences weighted equally."""

    split: Required[str]
    configuration: Required[str]
    runs: Required[int]
    gaussians: float | None
    training_psnr_tissue: float | None


IncrementRow = TypedDict(
    "IncrementRow",
    {
        "claim": str, "with": str, "without": str, "published": float | None, "split": str, "metric": str,
        "mean": float, "student_low": float | None, "student_high": float | None, "mean_low": float | None,
        "mean_high": float | None, "median": float, "median_low": float | None, "median_high": float | None,
        "pairs": int, "sequences": int, "of": list[dict[str, Any]],
    },
)  # fmt: skip
"""A paired difference: contrast, split and metric; the fields of `Estimate`; and its pairs."""


class AblationRecord(TypedDict):
    """ablation.json."""

    format: int
    date: str
    command: list[str]
    machine: MachinePart
    versions: dict[str, str]
    runs: dict[str, Any]  # planned, finished, and the names of the failed ones
    levels: list[Level]
    increments: list[IncrementRow]
    rows: list[RunRow]
