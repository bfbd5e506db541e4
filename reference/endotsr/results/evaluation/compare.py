"""Comparison of methods on the same held-out frames: means and paired differences.

In: metrics.json of runs or of folders of pictures. Out: one row per method and metric. Differences to the first method
are taken frame by frame, which cancels what the difficulty of a frame adds to both values. Their intervals resample the
frames of this clip as if these were independent; they hold no spread between clips.
"""

from typing import Any, NamedTuple, cast

import numpy as np

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.records import EvaluationRecord, FrameMetrics, PicturesEvaluation, RunEvaluation
from endotsr.untrusted.json import number
from endotsr.untrusted.names import counted

RESAMPLES = 9999
CONFIDENCE = 0.95
SMALLER_IS_BETTER = ("lpips", "lpips_symmetric")
ABOUT = ("frame", "name", "time")  # keys of a frame that are no metrics


class Method(NamedTuple):
    """The held-out metrics of one method."""

    label: str
    per_frame: list[FrameMetrics]  # entries of metrics.json: frame, name, time, metrics
    digests: dict[str, str]  # SHA-256 of `images` and `masks` of the sequence
    outside: tuple[int, ...] = ()  # numbers of the frames before the first or after the last training frame


class PairedDifference(NamedTuple):
    """A paired difference to the first method, over the frames with both values."""

    mean: float
    low: float | None  # of the interval; None for a single frame
    high: float | None
    better: int  # number of frames on which this method is better
    frames: int


class Row(NamedTuple):
    """The result of one method and metric."""

    label: str
    metric: str
    mean: float | None
    difference: PairedDifference | None  # None for the first method, and without a common frame
    extrapolated: bool = False  # over the frames before the first or after the last training frame; else the others


def methods_of(metrics: EvaluationRecord, label: str, where: object, baselines: bool = False) -> list[Method]:
    """The method of one metrics.json, optionally with its baselines.

    where   the file, for messages
    Raises: InputError if the dictionary is not from `endotsr evaluate`, or if a metric is no number.
    """
    try:
        hashes = _hashes(metrics)
        digests = {name: str(hashes[name]) for name in ("images", "masks")}
        rows = [(label, metrics["held_out"]["per_frame"])]  # no dictionary: a baseline may have the label
        if baselines:
            rows += [(entry["label"], entry["per_frame"]) for entry in metrics["baselines"].values()]
        outside = tuple(int(i) for i in (metrics.get("frames") or {}).get("extrapolated") or ())
        methods = [Method(name, list(per_frame), digests, outside) for name, per_frame in rows]
        for method in methods:
            _frames(method)
            _about(method)
            _refuse_no_number(method, where)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{where}: {error}: use a file that `endotsr evaluate` wrote") from None
    return methods


def _hashes(metrics: EvaluationRecord) -> Any:
    """SHA-256 by name of an array; a run of windows has them beside its windows."""
    found: Any = metrics
    if "windows" not in metrics:
        pictures = cast(PicturesEvaluation, metrics).get("pictures")
        found = cast(RunEvaluation, metrics)["run"]["input"] if pictures is None else pictures
    return found["arrays_sha256"]


def compare(methods: list[Method], metric_names: tuple[str, ...], seed: int = 0) -> list[Row]:
    """Means and paired differences to the first method for each metric; apart for extrapolated frames, at the end.

    metric_names   keys of the entries; a metric without any value is left out
    seed           of the resampling
    Raises: InputError if two methods have the same label, or were measured on different frames, pictures or masks.
    """
    _refuse_other_frames(methods)
    outside = {frame for method in methods for frame in method.outside}
    rows = []
    for extrapolated in (False, True):
        part = [_of_frames(method, outside, extrapolated) for method in methods]
        if part[0].per_frame:
            rows += _compared(part, metric_names, seed, extrapolated)
    return rows


def _of_frames(method: Method, outside: set[int], extrapolated: bool) -> Method:
    """The method on the frames that are in `outside`, or on the others."""
    return method._replace(per_frame=[row for row in method.per_frame if (row["frame"] in outside) is extrapolated])


def _compared(methods: list[Method], metric_names: tuple[str, ...], seed: int, extrapolated: bool) -> list[Row]:
    rows = []
    for metric in metric_names:
        columns = [_column(method, metric) for method in methods]
        if all(np.isnan(column).all() for column in columns):
            continue
        for k, (method, column) in enumerate(zip(methods, columns)):
            difference = None if k == 0 else _paired(column - columns[0], metric, seed)
            mean = None if np.isnan(column).all() else float(np.nanmean(column))
            rows.append(Row(method.label, metric, mean, difference, extrapolated))
    return rows


def _refuse_other_frames(methods: list[Method]) -> None:
    first = methods[0]
    frames = _frames(first)
    for k, other in enumerate(methods[1:], start=1):
        if other.label in [method.label for method in methods[:k]]:
            raise InputError(f"two methods are called {other.label!r}; use NAME=PATH with different names")
        if _frames(other) != frames:
            raise InputError(
                f"{other.label}: {_about(other)}; {first.label}: {_about(first)}; use the same held-out frames"
            )
        for name, digest in other.digests.items():
            if first.digests.get(name) != digest:
                raise InputError(f"{other.label} and {first.label}: measured on different {name}; use the same")


def _frames(method: Method) -> list[int]:
    """Frame numbers. Names are not compared: they depend on the layout of the clip; the digests do not."""
    return [int(row["frame"]) for row in method.per_frame]


def _about(method: Method) -> str:
    names = [row["name"] for row in method.per_frame]
    return f"{counted(len(names), 'frame')}" + (f" from {names[0]} to {names[-1]}" if names else "")


def _refuse_no_number(method: Method, where: object) -> None:
    """Raises InputError for a metric of a frame that is neither a finite number nor null."""
    for row in method.per_frame:
        for key, value in row.items():
            if key not in ABOUT and value is not None:
                number(value, f"{where}: frame {row['frame']}: {key}")


def _column(method: Method, metric: str) -> FloatArray:
    """The metric of every frame; NaN if it has no value."""
    values = [row.get(metric) for row in method.per_frame]
    return np.array([np.nan if value is None else float(value) for value in values], np.float64)


def _paired(difference: FloatArray, metric: str, seed: int) -> PairedDifference | None:
    """The paired difference; NaN entries are left out, None if there is no other."""
    known = difference[np.isfinite(difference)]
    if not known.size:
        return None
    low, high = interval(known, seed) if known.size > 1 else (None, None)
    better = int(np.count_nonzero(known < 0 if metric in SMALLER_IS_BETTER else known > 0))
    return PairedDifference(float(known.mean()), low, high, better, known.size)


def interval(values: FloatArray, seed: int = 0) -> tuple[float, float]:
    """Percentile bootstrap interval of a mean at CONFIDENCE; for a single value both limits equal it."""
    if values.size < 2:
        return float(values[0]), float(values[0])
    return bootstrapped((values,), np.mean, seed)


def bootstrapped(samples: tuple[FloatArray, ...], middle: Any, seed: int) -> tuple[float, float]:
    """Percentile bootstrap interval at CONFIDENCE of the average of the samples' means or medians (`middle`)."""
    from scipy.stats import bootstrap

    def averaged(*drawn: FloatArray, axis: int = -1) -> FloatArray:
        return np.mean([middle(sample, axis=axis) for sample in drawn], axis=0)

    found = bootstrap(
        samples, averaged, n_resamples=RESAMPLES, confidence_level=CONFIDENCE, method="percentile", vectorized=True,
        rng=np.random.default_rng(seed),
    ).confidence_interval  # fmt: skip
    return float(found.low), float(found.high)
