"""The tables of the presets in README.md and which_preset.md: time of trainings and whole commands, memory, quality.

The records of quality are those of `full_size.record`, of times docs/results/minutes.json (`bench.minutes`), of whole
commands waiting.json (`bench.waiting`), and of the simulated clip quick_simulated.json, which `book.running_clip`
wrote, and those of `full_size`. The running clip of the book is of earlier runs, with smaller learning rates.
"""

from collections.abc import Mapping, Sequence
from statistics import mean
from typing import Any

import numpy as np

from endotsr.config import PRESETS
from endotsr.results.report.tables import duration, markdown
from pages.bench import minutes
from pages.bench.waiting_text import CLOCKS, processor
from pages.book import running_clip, texture
from pages.full_size import page as full_size
from pages.full_size import record
from pages.full_size.interpolation import TISSUE_ONLY
from pages.full_size.text import LABELS, PREDICTIONS, mean_psnr
from pages.store.commands import loaded
from pages.store.program import RESULTS, Program
from pages.store.tables import days, noted

Columns = tuple[tuple[str, str, float, int], ...]
MEASURED: Columns = (
    ("PSNR full, dB", "psnr_full", 1.0, 2),
    ("LPIPS [0,1]", "lpips", 1.0, 4),
)  # head, key, unit, digits
OF_RUN = ("peak_memory_bytes", "gaussians")
TEXTURED = " with recorded texture"
SIZES: Columns = (("GB", "peak_memory_bytes", 1e9, 1), ("Gaussians", "gaussians", 1.0, 0))


def values(runs: Sequence[Mapping[str, Any]], columns: Columns) -> list[str]:
    """Means over runs, "-" for what they do not have."""
    return [
        f"{mean(run[key] for run in runs) / unit:.{digits}f}" if key in runs[0] else "-"
        for _, key, unit, digits in columns
    ]


def of_seeds(clip: str, name: str) -> list[dict[str, Any]]:
    """Held-out means, memory and Gaussians of every recorded seed of a preset on a clip."""
    return [
        metrics["held_out"]["mean"] | {key: metrics["run"][key] for key in OF_RUN}
        for key, metrics in record.stored(clip).items()
        if f"_{name}_seed" in key
    ]


def textured(clip: str, name: str) -> list[dict[str, Any]]:
    """Held-out means of every recorded seed of a preset with recorded texture; [] without such a row in the records."""
    return [run["recorded_texture"]["mean"] for run in texture.runs_of(clip, name)]


def table(columns: Columns = MEASURED) -> str:
    """One row per preset, the fastest first, means over the seeds; predictions without a model; clip and machine."""
    found = loaded(RESULTS / "minutes.json")
    presets = {name: runs for name, runs in found["rows"].items() if name in PRESETS}
    timed = sorted((mean(run["seconds"] for run in runs), name) for name, runs in presets.items())
    seeds = {name: of_seeds("pulling", name) or runs for name, runs in presets.items()}
    cells = []
    for seconds, name in timed:
        cells.append([f"`{name}`", f"{seconds / 60:.1f}", *values(seeds[name], columns), str(len(seeds[name]))])
        if of := textured("pulling", name):
            cells.append([f"`{name}`{TEXTURED}", f"{seconds / 60:.1f}", *values(of, columns), str(len(of))])
    for name, values_of in minutes.baselines(found).items():
        cells.append([name, "-", *values([values_of], columns), "-"])
    runs = [run for of in presets.values() for run in of]
    machines, threads = sorted({run["processor"] for run in runs}), sorted({run["threads"] for run in runs})
    clip = found["clip"]
    about = (
        f"{clip['name']}, {clip['frames']} frames of {clip['size']}, every eighth held out; means over the seeds. The "
        f"time is that of the iterations of one run with {' or '.join(map(str, threads))} threads of "
        f"{', '.join(machines)}, {days(runs)}; another machine of this name took longer. *With recorded texture*: the "
        "render, and what the two neighbouring training frames record and their renders lack; the texture reads no "
        "excluded colour."
    )
    return noted(("Preset", "Training, minutes", *(head for head, *_ in columns), "Seeds"), cells, about)


def whole() -> str:
    """The time of whole commands by preset and clip: of two threads on the clock, or else of one processor thread."""
    rows = [row for row in loaded(RESULTS / "waiting.json")["rows"] if row["seed"] == 0]
    clocks = list(CLOCKS)
    on_clock = {(row["preset"], row["clip"]) for row in rows if row["clock"] == "wall"}
    shown = [row for row in rows if row["clock"] == "wall" or (row["preset"], row["clip"]) not in on_clock]
    shown.sort(key=lambda row: (row["preset"], row["clip"], clocks.index(row["clock"]), row["whole"]))
    cells = [
        [
            f"`{row['preset']}`",
            f"{row['clip']}, {row['frames']} frames",
            duration(row["whole"]),
            f"{processor(row)}, {CLOCKS[row['clock']]}",
            "yes" if row["cold"] else "no",
        ]
        for row in shown
    ]
    sizes = sorted({row["size"] for row in rows})
    about = (
        "Time of the whole command, from reading the clip to its report, with LPIPS; kernels are compiled once on a "
        "machine. "
        f"Frames of {', '.join(sizes)}; {days(rows)}."
    )
    return noted(("Preset", "Clip", "Minutes", "Measured on", "With compilation"), cells, about)


def recorded() -> str:
    """Time, memory and quality of each preset on the recorded clip: the table of README.md with the sizes."""
    return table((*SIZES, *MEASURED))


def cutting() -> str:
    """Presets and predictions without a model on the second recorded clip; `paper` is the ablation with everything."""
    rows = {name: of_seeds("cutting", name) for name in ("quick", "sharp")}
    rows["paper"] = [
        row for row in loaded(RESULTS / "ablation_cutting.json")["rows"] if row["configuration"] == "A+S+L"
    ]
    columns = (*SIZES, *MEASURED)
    cells = []
    for name, of in rows.items():
        cells.append([f"`{name}`", *values(of, columns), str(len(of))])
        if with_texture := textured("cutting", name):
            cells.append([f"`{name}`{TEXTURED}", *values(with_texture, columns), str(len(with_texture))])
    first = next(iter(record.stored("cutting").values()))
    for key in (*PREDICTIONS[1:], *TISSUE_ONLY):
        cells.append([LABELS[key], *values([first["baselines"][key]["mean"]], columns), "-"])
    source = first["run"]["input"]
    size = f"{source['width']}x{source['height']}"
    about = f"{source['source']}, {source['frames']} frames of {size}, every eighth held out."
    return noted(("Preset", *(head for head, *_ in columns), "Seeds"), cells, about)


def simulated() -> str:
    """PSNR of the presets that were trained on the simulated clip, and of what needs no model."""
    seeds: dict[str, Any] = running_clip.means(loaded(RESULTS / "quick_simulated.json"))
    model, paper = seeds["model"], mean_psnr(full_size.PROGRAM.read()["paper_eighth"], "model")
    rows = [["`quick`", f"{model.mean():.2f}", f"{model.size}"], ["`paper`", f"{paper:.2f}", "1"]]
    rows += [[LABELS[name], f"{np.mean(seeds[name]):.2f}", "-"] for name in PREDICTIONS[1:]]
    return markdown(("Prediction", "PSNR tissue, dB", "Seeds"), rows)


PROGRAM = Program(
    __name__, ("../README.md", "guides/which_preset.md"),
    {"table": table, "whole": whole, "recorded": recorded, "cutting": cutting, "simulated": simulated},
)  # fmt: skip
