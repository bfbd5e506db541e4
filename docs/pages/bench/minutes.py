"""Quality of trainings of some minutes on one clip, compared with methods that need no model.

    python docs/make.py bench.minutes add RUN... --name "sharp"    add or replace a row of finished runs (seeds)
    python docs/make.py bench.minutes                              rewrite the picture and the table

The runs come from `endotsr train CLIP --preset sharp --seed 1 --lpips FILE` or `--minutes 3`; all rows are of one clip.
The result is docs/results/minutes.json; the table is part of docs/bench.md.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from pathlib import Path
from statistics import mean
from typing import Any

from endotsr.errors import InputError
from endotsr.results.report.style import BLUE, GREY, INK, name_axes, new_figure, plain_axes, save
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.log import log_until
from pages.store.marks import read_json, write_marked
from pages.store.published import PUBLISHED

DOCS = Path(__file__).parents[2]
FILE, PICTURE, PAGE = DOCS / "results" / "minutes.json", DOCS / "results" / "minutes.svg", DOCS / "bench.md"
METRICS = {"psnr_full": ("PSNR full, dB", "{:.2f}"), "ssim_full": ("SSIM", "{:.4f}"), "lpips": ("LPIPS", "{:.4f}")}
LEVELS = {"two_neighbours": "blend", "flow_interpolation": "flow"}  # drawn baselines


def run_row(folder: Path) -> dict[str, Any]:
    """Results of one finished run; its seconds count only its iterations."""
    metrics = read_json(folder / "metrics.json", "endotsr train")
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


def add(folders: list[Path], name: str) -> None:
    """Store the runs as one row, and the baselines of their clip."""
    metrics = read_json(folders[0] / "metrics.json", "endotsr train")
    source = metrics["run"]["input"]
    clip = {
        "name": Path(source["source"]).name,
        "frames": source["frames"],
        "size": f"{source['width']}x{source['height']}",
    }
    known = read_json(FILE, "docs/pages/bench/minutes.py") if FILE.exists() else {"clip": clip, "rows": {}}
    if known["clip"] != clip:
        raise InputError(f"{folders[0]}: its clip is {clip}; allowed: the clip of the other rows, {known['clip']}")
    known["rows"][name] = [run_row(folder) for folder in folders]
    known["baselines"] = {
        label: {key: metrics["baselines"][baseline]["mean"][key] for key in METRICS}
        for baseline, label in LEVELS.items()
    }
    write_json(FILE, known)


def ordered(result: dict[str, Any]) -> dict[str, dict[str, float]]:
    """The means of every row over its seeds, by ascending time."""
    numbers = ("threads", "iterations", "gaussians", "seconds", "peak_memory_bytes", *METRICS)
    means = {name: {key: mean(run[key] for run in runs) for key in numbers} for name, runs in result["rows"].items()}
    return dict(sorted(means.items(), key=lambda row: row[1]["seconds"]))


def levels(result: dict[str, Any]) -> dict[str, Any]:
    """Levels without a training: the baselines, and the numbers published for this clip."""
    published = next((row for clip, row in PUBLISHED.items() if clip in result["clip"]["name"]), None)
    return result["baselines"] | ({"as published": published} if published else {})


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
        rows.append([name, *["-"] * 5, *(form.format(row[key]) for key, (_, form) in METRICS.items())])
    return markdown(headings, rows)


def about(result: dict[str, Any]) -> str:
    """Clip, processor and the last day."""
    runs = [run for rows in result["rows"].values() for run in rows]
    clip = result["clip"]
    return (
        f"{clip['name']}, {clip['frames']} frames of {clip['size']}, held out: every eighth frame; "
        f"{', '.join(sorted({run['processor'] for run in runs}))}; {max(run['date'] for run in runs)}."
    )


def draw(result: dict[str, Any], path: Path) -> None:
    """PSNR and LPIPS against minutes, a panel each, with the levels of the baselines."""
    figure = new_figure(7.4, 3.2)
    for axes, key in zip(figure.subplots(1, 2), ("psnr_full", "lpips"), strict=True):
        for name, row in ordered(result).items():
            at = row["seconds"] / 60, row[key]
            axes.plot(*at, "o", color=BLUE, markersize=5)
            axes.annotate(name, at, xytext=(4, 4), textcoords="offset points", fontsize=8, color=INK)
        for name, row in levels(result).items():
            axes.axhline(row[key], color=GREY, linewidth=1, linestyle="--")
            axes.annotate(name, (1.0, row[key]), xycoords=("axes fraction", "data"), xytext=(-4, 2),
                          textcoords="offset points", ha="right", fontsize=8, color=GREY)  # fmt: skip
        ticks = (1, 2, 4, 8, 16, 32)
        axes.set(xscale="log", xlim=(0.9, 50), xticks=ticks, xticklabels=[str(n) for n in ticks])
        axes.minorticks_off()
        name_axes(axes, "minutes of training", METRICS[key][0])
        plain_axes(axes)
    save(figure, path)


def parts(result: dict[str, Any]) -> dict[str, str]:
    """The generated part of the page."""
    picture = f"![PSNR and LPIPS against minutes of training](results/{PICTURE.name})"
    return {"table": "\n\n".join((picture, table(result), about(result)))}


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["add"], nargs="?")
    parser.add_argument("runs", type=Path, nargs="*")
    parser.add_argument("--name", help="of the row: the options of the training")
    options = parser.parse_args(words)
    if options.what and not (options.runs and options.name):
        parser.error("add needs finished runs and --name")
    if options.what:
        add(options.runs, options.name)
    result = read_json(FILE, "python docs/make.py bench.minutes add RUN --name NAME")
    draw(result, PICTURE)
    write_marked(PAGE, parts(result), "minutes")
