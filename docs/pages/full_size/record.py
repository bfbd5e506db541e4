"""Record a run: docs/results/NAME.json from RUN/metrics.json, and the tables made from all recorded runs.

    python docs/make.py full_size.record RUN NAME COMMIT   add or replace one record, then rewrite the tables
    python docs/make.py full_size.record                   rewrite the tables only

COMMIT is the revision of this repository that made the run.

The tables stand in docs/results/README.md and in README.md, between the `results:start` and `results:end` marks.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy import stats

from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from pages.store.published import PUBLISHED

FOLDER = Path(__file__).parents[2] / "results"
START, END = "<!-- results:start (made by docs/pages/full_size/record.py) -->", "<!-- results:end -->"
EVERY_EIGHTH = "every eighth frame"
MORE = "[All runs, with blocks of frames held out, machine and times](docs/results/README.md). ± is a 95 % interval."
COLUMNS = (
    ("psnr_full", "PSNR full, dB", "{:.2f}"),
    ("psnr_tissue", "PSNR tissue, dB", "{:.2f}"),
    ("ssim_full", "SSIM full", "{:.4f}"),
    ("lpips", "LPIPS [0,1]", "{:.4f}"),
    ("lpips_symmetric", "LPIPS [-1,1]", "{:.4f}"),
)


def record(run: Path, name: str, commit: str) -> None:
    """Copy the metrics of a run; paths of the machine are reduced to the name of the folder."""
    metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
    source = metrics["run"]["input"]
    source["source"] = Path(source["source"]).name
    metrics["run"]["commit"] = commit
    metrics["published"] = [row for clip, row in PUBLISHED.items() if clip in source["source"]]
    write_json(FOLDER / f"{name}.json", metrics)


def split_of(metrics: dict) -> str:
    """The held-out frames of a run, in words."""
    sequence = metrics["run"]["settings"]["sequence"]
    frames = sequence["block_length"]
    words = {
        "every_eighth": EVERY_EIGHTH, "every_second": "every second frame",
        "blocks": f"blocks of {frames} frames", "end": f"the last {frames} frames",
    }  # fmt: skip
    return words[sequence["split"]]


def rows(records: dict[str, dict]) -> list[tuple[str, list[dict]]]:
    """Label and held-out means: the seeds of every preset, the baselines of the first run, what was published."""
    first = next(iter(records.values()))
    presets: dict[str, list[dict]] = {}
    faded: dict[str, list[dict]] = {}
    for metrics in records.values():
        preset = metrics["run"]["settings"]["preset"]
        presets.setdefault(preset, []).append(metrics["held_out"]["mean"])
        if row := metrics.get("cross_fade"):
            faded.setdefault(preset, []).append(row["mean"])
    out = [(f"endotsr, preset `{name}`{counted(runs)}", runs) for name, runs in presets.items()]
    out += [(f"blend of the own renders of `{name}`{counted(means)}", means) for name, means in faded.items()]
    out += [(baseline["label"], [baseline["mean"]]) for baseline in first["baselines"].values()]
    return out + [(row["label"], [row]) for row in first["published"] if split_of(first) == EVERY_EIGHTH]


def counted(runs: list[dict]) -> str:
    """What a mean is taken over, if there is more than one run."""
    return f", mean of {len(runs)} seeds" if len(runs) > 1 else ""


def cell(values: list[dict], key: str, form: str) -> str:
    """The mean over the seeds, with the half width of its 95 % interval (Student) if there are several."""
    numbers = [row[key] for row in values if row.get(key) is not None]
    if not numbers:
        return "-"
    if len(numbers) < 2:
        return form.format(numbers[0])
    half = stats.t.ppf(0.975, len(numbers) - 1) * np.std(numbers, ddof=1) / np.sqrt(len(numbers))
    return f"{form.format(np.mean(numbers))} ± {form.format(half)}"


def table(records: dict[str, dict]) -> str:
    """For every split the held-out means as Markdown."""
    parts = []
    for split in dict.fromkeys(split_of(metrics) for metrics in records.values()):
        chosen = {name: metrics for name, metrics in records.items() if split_of(metrics) == split}
        cells = [[label, *(cell(values, key, form) for key, _, form in COLUMNS)] for label, values in rows(chosen)]
        parts.append(markdown([f"Held out: {split}", *(c[1] for c in COLUMNS)], cells))
    return "\n\n".join(parts)


def about(name: str, metrics: dict) -> str:
    """What was run, when, on what."""
    run, training, machine = metrics["run"], metrics["training"]["mean"], metrics["run"]["machine"]
    source, settings = run["input"], run["settings"]
    return (
        f"- `{name}.json`: {source['source']}, {source['width']}x{source['height']}, preset `{settings['preset']}`, "
        f"split `{settings['sequence']['split']}`, {run['iteration']} iterations, seed {run['seed']}, "
        f"{run['gaussians']} Gaussians at the end, training PSNR {training['psnr_full']:.2f} dB, "
        f"lambda_lap {run['lambda_lap']:.3g}, {run['seconds'] / 60:.0f} minutes and "
        f"{run['peak_memory_bytes'] / 1e9:.2f} GB on {run['threads']} threads of {machine['processor']} "
        f"({machine['cores']} cores), {run['started'][:10]}, revision {run['commit']}."
    )


def replace_marked(path: Path, text: str) -> None:
    """Put `text` between the marks of a file."""
    old = path.read_text(encoding="utf-8")
    head, _, rest = old.partition("<!-- results:start")
    tail = rest.partition(END)[2]
    path.write_text(f"{head}{START}\n{text}\n{END}{tail}", encoding="utf-8")


def main(words: list[str]) -> None:
    """The command."""
    if len(words) == 3:
        record(Path(words[0]), words[1], words[2])
    elif words:
        sys.exit(__doc__)
    records = {p.stem: json.loads(p.read_text(encoding="utf-8")) for p in sorted(FOLDER.glob("pulling*.json"))}
    if records:
        runs = "\n".join(about(name, metrics) for name, metrics in records.items())
        replace_marked(FOLDER / "README.md", f"{table(records)}\n\n{runs}")
        short = {name: metrics for name, metrics in records.items() if split_of(metrics) == EVERY_EIGHTH}
        replace_marked(FOLDER.parents[1] / "README.md", f"{table(short)}\n\n{MORE}")
