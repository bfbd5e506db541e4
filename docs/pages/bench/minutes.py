"""Quality of trainings of some minutes on one clip, compared with methods that need no model.

    python docs/make.py bench.minutes measure RUN... --name "sharp"    add or replace a row of finished runs (seeds)

The runs come from `endotsr train CLIP --preset sharp --seed 1 --lpips FILE` or `--minutes 3`; all rows are of one clip.
The table is part of docs/bench.md.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from pathlib import Path
from statistics import mean
from typing import Any

from endotsr.errors import InputError
from endotsr.results.report.style import BLUE, INK, name_axes, new_figure, plain_axes, save
from endotsr.results.report.tables import markdown
from endotsr.training.runs.log import log_until
from pages.full_size.interpolation import tissue_only
from pages.full_size.record import EVERY_EIGHTH
from pages.full_size.text import LABELS
from pages.store import figures
from pages.store.commands import loaded
from pages.store.program import RESULTS, RUNS, Program
from pages.store.published import PUBLISHED, as_printed
from pages.store.tables import days

PICTURE = RESULTS / "minutes.svg"
METRICS = {"psnr_full": ("PSNR full, dB", "{:.2f}"), "ssim_full": ("SSIM", "{:.4f}"), "lpips": ("LPIPS", "{:.4f}")}
PUBLISHED_ROW = "as published"
LEVELS = {"two_neighbours": "blend", "flow_interpolation": "flow"}  # drawn baselines


def run_row(folder: Path) -> dict[str, Any]:
    """Results of one finished run; its seconds count only its iterations."""
    metrics = loaded(folder / "metrics.json")
    run = metrics["run"]
    return {
        "seed": run["seed"],
        "iterations": run["iteration"],
        "gaussians": run["gaussians"],
        "threads": run["threads"],
        "processor": run["machine"]["processor"],
        "date": run["started"][:10],
        "seconds": sum(entry["seconds"] for entry in log_until(folder / "log.jsonl", run["iteration"])),
        "peak_memory_bytes": run["peak_memory_bytes"],
        **{key: metrics["held_out"]["mean"][key] for key in METRICS},
    }


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The record with the runs as one row, and with the baselines of their clip."""
    metrics = loaded(options.runs[0] / "metrics.json")
    source = metrics["run"]["input"]
    size = f"{source['width']}x{source['height']}"
    clip = {"name": Path(source["source"]).name, "frames": source["frames"], "size": size}
    known = loaded(options.record) if options.record.exists() else {"clip": clip, "rows": {}}
    if known["clip"] != clip:
        raise InputError(f"{options.runs[0]}: its clip is {clip}; use the clip of the other rows, {known['clip']}")
    known["rows"][options.name] = [run_row(folder) for folder in options.runs]
    known["baselines"] = {
        label: {key: metrics["baselines"][baseline]["mean"][key] for key in METRICS}
        for baseline, label in LEVELS.items()
    }
    return known


def ordered(result: dict[str, Any]) -> dict[str, dict[str, float]]:
    """The means of every row over its seeds, by ascending time."""
    numbers = ("threads", "iterations", "gaussians", "seconds", "peak_memory_bytes", *METRICS)
    means = {name: {key: mean(run[key] for run in runs) for key in numbers} for name, runs in result["rows"].items()}
    return dict(sorted(means.items(), key=lambda row: row[1]["seconds"]))


def baselines(result: dict[str, Any]) -> dict[str, Any]:
    """Predictions without a model by label, those that obey the masks last."""
    obeying = tissue_only(result["clip"]["name"], EVERY_EIGHTH)
    return result["baselines"] | {LABELS[name]: row for name, row in obeying.items()}


def levels(result: dict[str, Any]) -> dict[str, Any]:
    """Levels without a training: the baselines, and the numbers published for this clip."""
    published = next((row for clip, row in PUBLISHED.items() if clip in result["clip"]["name"]), None)
    return baselines(result) | ({PUBLISHED_ROW: published} if published else {})


def label(name: str) -> str:
    """The first word of a name as code; the other words may wrap to another line."""
    first, *others = name.split()
    return " ".join((f"`{first}`", *others))


def table(result: dict[str, Any]) -> str:
    """One row per training, then the baselines and the published numbers."""
    names = [name for name, _ in METRICS.values()]
    headings = ["Training", "Threads", "Minutes", "Iterations", "Gaussians", "GB", *names]
    rows = [
        [label(name), f"{row['threads']:.0f}", f"{row['seconds'] / 60:.1f}", f"{row['iterations']:.0f}",
         f"{row['gaussians']:.0f}", f"{row['peak_memory_bytes'] / 1e9:.1f}",
         *(form.format(row[key]) for key, (_, form) in METRICS.items())]
        for name, row in ordered(result).items()
    ]  # fmt: skip
    for name, row in levels(result).items():
        of = [
            as_printed(key, row[key]) if name == PUBLISHED_ROW else form.format(row[key])
            for key, (_, form) in METRICS.items()
        ]
        rows.append([name, *["-"] * 5, *of])
    return markdown(headings, rows)


def about(result: dict[str, Any]) -> str:
    """Clip, processor and days."""
    runs = [run for rows in result["rows"].values() for run in rows]
    clip = result["clip"]
    return (
        f"{clip['name']}, {clip['frames']} frames of {clip['size']}, held out: every eighth frame; "
        f"{', '.join(sorted({run['processor'] for run in runs}))}; {days(runs)}. "
        "LPIPS has its input in [0, 1]; the paper does not state the range of its own."
    )


def draw(result: dict[str, Any]) -> None:
    """PSNR and LPIPS against minutes, a panel each, with the levels of the baselines."""
    figure = new_figure(7.4, 3.2)
    for axes, key in zip(figure.subplots(1, 2), ("psnr_full", "lpips"), strict=True):
        for name, row in ordered(result).items():
            at = row["seconds"] / 60, row[key]
            axes.plot(*at, "o", color=BLUE, markersize=5)
            axes.annotate(name, at, xytext=(4, 4), textcoords="offset points", fontsize=8, color=INK)
        for name, row in levels(result).items():
            figures.level(axes, row[key], name)
        figures.logarithmic_x(axes, (1, 2, 4, 8, 16, 32), xlim=(0.9, 50))
        name_axes(axes, "minutes of training", METRICS[key][0])
        plain_axes(axes)
    save(figure, PICTURE)


def shown(result: dict[str, Any]) -> str:
    """Picture, table, clip and processor."""
    picture = f"![PSNR and LPIPS against minutes of training](results/{PICTURE.name})"
    return "\n\n".join((picture, table(result), about(result)))


PROGRAM = Program(
    __name__, "bench.md", {"table": shown}, "minutes.json", measured,
    {"runs": RUNS, "--name": {"required": True, "help": "of the row: the options of the training"}}, draw,
    stamped=False,
)  # fmt: skip
