"""The result of an ablation as JSON, Markdown and a plot with intervals.

In: rows of a sweep. Out: `ablation.json`, `ablation.md` and `ablation.png`, rewritten after every run.
"""

from pathlib import Path
from typing import Any, TypedDict, cast

from endotsr.results.report import style
from endotsr.results.report.tables import fixed, markdown
from endotsr.studies.sweeps.ablation import Increment, Level, increments, levels, published_value
from endotsr.studies.sweeps.execute import FAILED, FINISHED
from endotsr.studies.sweeps.results import RunRow
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import MachinePart, machine, now, versions
from endotsr.untrusted.writing import replace_text

FORMAT = 2  # of ablation.json; raised when a key changes its name or meaning
FILES = ("ablation.json", "ablation.md", "ablation.png")
ROW_KEYS = (
    "name", "sequence", "split", "configuration", "seed", "iterations", "gaussians", "seconds", "psnr_full",
    "psnr_tissue", "ssim_full", "ssim_tissue", "lpips", "lpips_symmetric", "training_psnr_full", "training_psnr_tissue",
    "cross_fade_psnr_full", "cross_fade_psnr_tissue", "preset", "width", "height", "threads", "baselines", "measures",
    "arrays_sha256", "per_frame",
)  # fmt: skip
DRAWN = "psnr_full"  # metric of ablation.png
UNRECORDED = (
    "Input not recorded: these runs are paired by sequence and seed; no hash shows that they read the same files."
)
SHOWN = (  # metric, label, digits
    ("psnr_full", "PSNR full, dB", 2), ("psnr_tissue", "PSNR tissue, dB", 2), ("ssim_tissue", "SSIM tissue", 4),
    ("lpips", "LPIPS", 4),
)  # fmt: skip


IncrementRow = TypedDict(
    "IncrementRow",
    {
        "claim": str, "with": str, "without": str, "in_paper": bool, "published": float | None, "input_recorded": bool,
        "split": str, "metric": str,
        "mean": float, "student_low": float | None, "student_high": float | None, "mean_low": float | None,
        "mean_high": float | None, "median": float, "median_low": float | None, "median_high": float | None,
        "pairs": int, "sequences": int, "of": list[dict[str, Any]],
    },
)  # fmt: skip
"""A paired difference: contrast, split, metric, the fields of `Estimate`, and its pairs."""


class AblationRecord(TypedDict):
    """ablation.json."""

    format: int
    date: str
    command: list[str]
    machine: MachinePart
    versions: dict[str, str]
    runs: dict[str, Any]  # counts `planned` and `finished`, names `failed`
    levels: list[Level]
    increments: list[IncrementRow]
    rows: list[RunRow]


def ablation_record(rows: list[RunRow], command: list[str], unrecorded: bool = False) -> AblationRecord:
    """The content of ablation.json; `unrecorded` as in `increments`.

    Raises InputError if the two runs of a pair have different inputs.
    """
    return {
        "format": FORMAT,
        "date": now(),
        "command": command,
        "machine": machine(),
        "versions": versions(),
        "runs": {
            "planned": len(rows),
            "finished": sum(row["status"] == FINISHED for row in rows),
            "failed": [row["name"] for row in rows if row["status"] == FAILED],
        },
        "levels": levels(rows),
        "increments": [_increment(found) for found in increments(rows, unrecorded)],
        "rows": [_kept(row) for row in rows if row["status"] == FINISHED],
    }


def _kept(row: RunRow) -> RunRow:
    return cast(RunRow, {key: row.get(key) for key in ROW_KEYS if key in row})


def _increment(found: Increment) -> IncrementRow:
    c = found.comparison
    stated = published_value(c, found.metric, {pair.sequence for pair in found.pairs})
    about = {"claim": c.claim, "with": c.with_, "without": c.without, "in_paper": bool(c.says), "published": stated}
    about |= {"input_recorded": found.input_recorded}
    numbers = {**found.estimate._asdict(), "of": [pair._asdict() for pair in found.pairs]}
    return cast(IncrementRow, about | {"split": found.split, "metric": found.metric} | numbers)


def write_ablation(out: Path, rows: list[RunRow], command: list[str]) -> AblationRecord:
    """Write the three files to the folder of the sweep; returns the content of ablation.json. Raises OSError."""
    record = ablation_record(rows, command)
    write_json(out / FILES[0], record)
    replace_text(out / FILES[1], ablation_markdown(record) + "\n")
    if any(found["metric"] == DRAWN for found in record["increments"]):
        draw(record, out / FILES[2])
    return record


def ablation_markdown(record: AblationRecord) -> str:
    """Means of the configurations and differences with intervals, one section per split."""
    runs = record["runs"]
    parts = [f"{runs['finished']} of {runs['planned']} runs finished, {len(runs['failed'])} failed."]
    if not all(found["input_recorded"] for found in record["increments"]):
        parts.append(UNRECORDED)
    for split in dict.fromkeys(level["split"] for level in record["levels"]):
        parts += [f"Held out: {split}", level_table(record, split)]
        if any(found["split"] == split for found in record["increments"]):
            parts.append(increment_table(record, split))
    return "\n\n".join(parts)


def level_table(record: AblationRecord, split: str) -> str:
    """Table of the means of the configurations on a split."""
    chosen = [level for level in record["levels"] if level["split"] == split]
    columns = [column for column in SHOWN if any(level.get(column[0]) is not None for level in chosen)]
    rows = [
        [level["configuration"], str(level["runs"]), *(fixed(level.get(key), d) for key, _, d in columns),
         fixed(level.get("gaussians"), 0)]
        for level in chosen
    ]  # fmt: skip
    return markdown(["configuration", "runs", *(head for _, head, _ in columns), "Gaussians"], rows)


def increment_table(record: AblationRecord, split: str) -> str:
    """Table of the paired differences on a split: mean and median with intervals, and the published value."""
    rows = []
    for found in record["increments"]:
        digits = next((d for key, _, d in SHOWN if key == found["metric"]), None)
        if found["split"] != split or digits is None:
            continue
        label = next(head for key, head, _ in SHOWN if key == found["metric"])
        rows.append([
            name_of(found), label, fixed(found["mean"], digits, "+"),
            *(interval_text(found, of, digits) for of in ("student", "mean")),
            fixed(found["median"], digits, "+"), interval_text(found, "median", digits),
            fixed(found["published"], digits, "+"), f"{found['pairs']} on {found['sequences']}",
        ])  # fmt: skip
    heads = (
        "difference",
        "metric",
        "mean",
        "95 % interval",
        "bootstrap",
        "median",
        "bootstrap",
        "published",
        "pairs on clips",
    )
    return markdown(heads, rows)


def name_of(found: IncrementRow) -> str:
    """The name of a difference, marked if it is not from the paper."""
    return found["claim"] + ("" if found["in_paper"] else " (ours)")


def interval_text(found: IncrementRow, of: str, digits: int) -> str:
    """An interval as text, "-0.02 to +0.11"; `of` is student, mean or median. "-" without an interval."""
    low, high = found.get(f"{of}_low"), found.get(f"{of}_high")
    return "-" if low is None or high is None else f"{low:+.{digits}f} to {high:+.{digits}f}"


def draw(record: AblationRecord, path: Path, metric: str = DRAWN) -> None:
    """Plot mean differences with intervals, a line per comparison and a panel per split; crosses: published values."""
    chosen = [found for found in record["increments"] if found["metric"] == metric]
    splits = list(dict.fromkeys(found["split"] for found in chosen))
    count = max(sum(found["split"] == split for found in chosen) for split in splits)
    figure = style.new_figure(4.0 + 3.2 * len(splits), 1.5 + 0.32 * count)
    panels = figure.subplots(1, len(splits), squeeze=False)[0]
    named: dict[str, object] = {}  # one legend entry per label, over all panels
    for axes, split in zip(panels, splits, strict=True):
        _panel(axes, [found for found in chosen if found["split"] == split])
        style.name_axes(axes, x="difference of PSNR full, dB", title=f"held out: {split}")
        handles, labels = axes.get_legend_handles_labels()
        named |= dict(zip(labels, handles, strict=True))
    style.legend(figure, handles=list(named.values()), labels=list(named), loc="outside lower center", ncols=5)
    style.save(figure, path)


def _panel(axes: Any, chosen: list[IncrementRow]) -> None:
    style.plain_axes(axes, grid="x")
    axes.axvline(0.0, color=style.GREY, linewidth=1.0)
    places = range(len(chosen))
    for of, width, label in (("student", 1.2, "95 %, Student"), ("mean", 3.5, "95 %, bootstrap")):
        limits = [(place, f.get(f"{of}_low"), f.get(f"{of}_high")) for place, f in enumerate(chosen)]
        known = [limit for limit in limits if limit[1] is not None]
        if known:
            axes.hlines(*zip(*known, strict=True), color=style.BLUE, linewidth=width, label=label)
    single = [(pair["difference"], place) for place, f in enumerate(chosen) for pair in f["of"]]
    axes.plot(*zip(*single, strict=True), ".", color=style.INK, markersize=4, zorder=3, label="one pair")
    axes.plot([f["mean"] for f in chosen], places, "o", color=style.BLUE, label="mean")
    stated = [(f["published"], place) for place, f in enumerate(chosen) if f["published"] is not None]
    if stated:
        axes.plot(*zip(*stated, strict=True), "x", color=style.ORANGE, zorder=4, label="as published")
    axes.set_yticks(list(places), [name_of(found) for found in chosen])
    axes.invert_yaxis()
