"""The table of a sweep: one row per run, as JSON, CSV and Markdown, rewritten after every run.

In: jobs and their folders. Out: rows of plain values. The row of a finished run is read from its folder; the reason of
a failure is stored in results.json only.
"""

from pathlib import Path
from typing import Any, Required, cast

from endotsr.errors import InputError
from endotsr.results.evaluation.records import FrameMetrics, LabelledMeans, Measured, MetricValues
from endotsr.results.report.comparison import csv_text
from endotsr.results.report.tables import markdown
from endotsr.studies.sweeps.execute import FAILED, FINISHED, Outcome
from endotsr.studies.sweeps.jobs import Job
from endotsr.training.runs.files import read_json, write_json
from endotsr.training.runs.machine import MachinePart, now
from endotsr.untrusted.json import Keys
from endotsr.untrusted.writing import replace_text

FORMAT = 1  # of results.json; raised when a key changes its name or meaning
FILES = ("results.json", "results.csv", "results.md")
OPEN = "open"  # status of a run that is not finished
METRICS = ("psnr_full", "psnr_tissue", "ssim_full", "ssim_tissue", "lpips", "lpips_symmetric")
ABOUT = ("sequence", "split", "configuration", "seed")
COSTS = ("iterations", "gaussians", "seconds", "peak_memory_bytes")
FURTHER = ("training_psnr_full", "training_psnr_tissue", "cross_fade_psnr_full", "cross_fade_psnr_tissue")
SHOWN = (
    ("psnr_full", "PSNR full", "{:.2f}"), ("psnr_tissue", "PSNR tissue", "{:.2f}"),
    ("ssim_full", "SSIM full", "{:.4f}"), ("ssim_tissue", "SSIM tissue", "{:.4f}"), ("lpips", "LPIPS", "{:.4f}"),
    ("training_psnr_tissue", "training PSNR tissue", "{:.2f}"), ("cross_fade_psnr_tissue", "cross-fade", "{:.2f}"),
    ("gaussians", "Gaussians", "{}"), ("seconds", "seconds", "{:.0f}"),
)  # fmt: skip
MEANS = tuple((key, form) for key, _, form in SHOWN if key in ("psnr_full", "psnr_tissue", "ssim_tissue", "lpips"))


class RunRow(MetricValues, total=False):
    """One run. An unfinished run has no numbers; a failed one has a reason."""

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
    settings: Keys
    per_frame: list[FrameMetrics]
    baselines: dict[str, LabelledMeans]
    measures: dict[str, Measured]
    versions: dict[str, str] | None
    machine: MachinePart | None


def finished_row(job: Job) -> RunRow:
    """The row of a finished run. Raises InputError if its metrics.json lacks a key."""
    path = Path(job.folder) / "metrics.json"
    metrics = read_json(path, ("held_out.mean", "training.mean", "run.input.arrays_sha256", "baselines"))
    run, held_out, inside = metrics["run"], metrics["held_out"], metrics["training"]["mean"]
    faded = (metrics.get("cross_fade") or {}).get("mean") or {}
    names = ("psnr_full", "psnr_tissue")
    row = {
        **about(job),
        "status": FINISHED,
        **{name: held_out["mean"].get(name) for name in METRICS},
        **{f"training_{name}": inside.get(name) for name in names},
        **{f"cross_fade_{name}": faded.get(name) for name in names},
        "iterations": run.get("iteration"),
        **{name: run.get(name) for name in (*COSTS[1:], "threads", "versions", "machine")},
        "preset": run["settings"]["preset"],
        "width": run["input"].get("width"),
        "height": run["input"].get("height"),
        "arrays_sha256": run["input"]["arrays_sha256"],
        "settings": run["settings"],
        "per_frame": held_out["per_frame"],
        "baselines": {name: {"label": row["label"], "mean": row["mean"]} for name, row in metrics["baselines"].items()},
        "measures": metrics.get("measures", {}),
    }
    return cast(RunRow, row)


def about(job: Job) -> RunRow:
    """The keys that identify a run."""
    return cast(RunRow, {"name": job.name} | {key: getattr(job, key) for key in ABOUT})


def open_row(job: Job, outcome: Outcome | None = None) -> RunRow:
    """The row of an unfinished run, with the reason if it failed."""
    if outcome is not None and outcome.status == FAILED:
        return {**about(job), "status": FAILED, "reason": outcome.reason}
    return {**about(job), "status": OPEN}


def failures(out: Path) -> dict[str, str]:
    """Name -> reason of the failed runs in results.json. Raises InputError if the file is damaged."""
    path = out / FILES[0]
    if not path.exists():
        return {}
    found = read_json(path, ("rows", "format"))
    if found["format"] != FORMAT or not isinstance(found["rows"], list):
        raise InputError(f"{path}: not the results of this version; use a file that `endotsr sweep` wrote")
    rows = [row for row in found["rows"] if isinstance(row, dict) and row.get("status") == FAILED]
    return {str(row.get("name")): str(row.get("reason", "")) for row in rows}


def write_results(out: Path, rows: list[RunRow]) -> None:
    """Write results.json, results.csv and results.md, each atomically. Raises OSError."""
    write_json(out / FILES[0], {"format": FORMAT, "date": now(), "rows": rows})
    for name, text in zip(FILES[1:], (results_csv(rows), results_markdown(rows) + "\n"), strict=True):
        replace_text(out / name, text)


def results_csv(rows: list[RunRow]) -> str:
    """One line per run; a missing number is an empty cell."""
    columns = ("name", *ABOUT, "status", *METRICS, *FURTHER, *COSTS, "reason")
    return csv_text(columns, ([row.get(name) for name in columns] for row in rows))


def results_markdown(rows: list[RunRow]) -> str:
    """A table of the finished runs, one of their means over several seeds, and the failed runs with reasons."""
    finished = [row for row in rows if row["status"] == FINISHED]
    failed = [row for row in rows if row["status"] == FAILED]
    columns = [column for column in SHOWN if any(row.get(column[0]) is not None for row in finished)]
    cells = (
        [*(_text(row[key]) for key in ABOUT), *(_cell(row.get(key), form) for key, _, form in columns)]
        for row in finished
    )
    parts = [f"{len(finished)} of {len(rows)} runs finished, {len(failed)} failed."]
    if finished:
        parts.append(markdown([*ABOUT, *(head for _, head, _ in columns)], cells))
    if any(len(group) > 1 for group in _by_seed(finished).values()):
        parts.append(_means_markdown(finished))
    if failed:
        parts.append("\n".join(f"- {_text(row['name'])}: {_text(row.get('reason'))}" for row in failed))
    return "\n\n".join(parts)


Group = tuple[str, str, str]  # sequence, split, configuration


def _by_seed(rows: list[RunRow]) -> dict[Group, dict[int, RunRow]]:
    """The runs that differ in their seed alone: seed -> row, of each sequence, split and configuration."""
    groups: dict[Group, dict[int, RunRow]] = {}
    for row in rows:
        groups.setdefault((row["sequence"], row["split"], row["configuration"]), {})[row["seed"]] = row
    return groups


def _means_markdown(rows: list[RunRow]) -> str:
    """Means over the seeds, and the gain in PSNR of tissue over the first configuration, paired by seed."""
    groups, body = _by_seed(rows), []
    shown = [(key, form) for key, form in MEANS if any(row.get(key) is not None for row in rows)]
    for (sequence, split, configuration), group in groups.items():
        first = next(key for key in groups if key[:2] == (sequence, split))
        gain = "-" if first[2] == configuration else _gain(group, groups[first])
        means = [_mean_cell([row.get(key) for row in group.values()], form) for key, form in shown]
        body.append([*map(_text, (sequence, split, configuration)), str(len(group)), *means, gain])
    heads = {key: head for key, head, _ in SHOWN}
    gained = "PSNR tissue minus that of the first configuration, mean (smallest to largest)"
    return markdown([*ABOUT[:3], "seeds", *(f"mean {heads[key]}" for key, _ in shown), gained], body)


def _gain(group: dict[int, RunRow], first: dict[int, RunRow]) -> str:
    """The differences of the runs of one seed: their mean, and the smallest to the largest."""
    pairs = [(row.get("psnr_tissue"), first[seed].get("psnr_tissue")) for seed, row in group.items() if seed in first]
    gains = [ours - theirs for ours, theirs in pairs if ours is not None and theirs is not None]
    return f"{sum(gains) / len(gains):+.2f} ({min(gains):+.2f} to {max(gains):+.2f})" if gains else "-"


def _mean_cell(values: list[Any], form: str) -> str:
    known = [value for value in values if value is not None]
    return form.format(sum(known) / len(known)) if known and len(known) == len(values) else "-"


def _text(value: Any) -> str:
    """A name or a reason in Markdown: a bar would begin a cell."""
    return str(value).replace("|", "\\|")


def _cell(value: Any, form: str) -> str:
    return "-" if value is None else form.format(value)
