"""The tables of the presets in README.md and docs/guides/which_preset.md: time, memory and quality.

The records are docs/results/minutes.json (`bench.minutes`), for whole commands waiting.json (`bench.waiting`), for the
compilation bench_start.json (`bench measure start`), and for the simulated clip those of `book.running_clip` and of
`full_size`.
"""

from statistics import mean
from typing import Any

import numpy as np

from endotsr.config import PRESETS
from endotsr.results.report.tables import duration, markdown
from pages.book import running_clip
from pages.full_size import page as full_size
from pages.full_size.text import LABELS, PREDICTIONS, mean_psnr
from pages.store.commands import loaded
from pages.store.program import RESULTS, Program
from pages.store.tables import noted

MEASURED = (("PSNR full, dB", "psnr_full", 1.0, 2), ("LPIPS [0,1]", "lpips", 1.0, 4))  # head, key, unit, digits
SIZES = (("GB", "peak_memory_bytes", 1e9, 1), ("Gaussians", "gaussians", 1.0, 0))


def table(columns: tuple[tuple[str, str, float, int], ...] = MEASURED) -> str:
    """One row per preset, the fastest first, means over the seeds; then the clip and the machine."""
    found = loaded(RESULTS / "minutes.json")
    presets = {name: runs for name, runs in found["rows"].items() if name in PRESETS}
    rows = sorted((mean(run["seconds"] for run in runs), name, runs) for name, runs in presets.items())
    cells = [
        [
            f"`{name}`",
            f"{seconds / 60:.1f}",
            *(f"{mean(run[key] for run in of) / unit:.{digits}f}" for _, key, unit, digits in columns),
            str(len(of)),
        ]
        for seconds, name, of in rows
    ]
    runs = [run for of in presets.values() for run in of]
    machines, threads = sorted({run["processor"] for run in runs}), sorted({run["threads"] for run in runs})
    clip = found["clip"]
    about = (
        f"{clip['name']}, {clip['frames']} frames of {clip['size']}, every eighth held out; "
        f"{' or '.join(map(str, threads))} threads of {', '.join(machines)}, {max(run['date'] for run in runs)}. The "
        "time is that of the iterations; it holds for this class of machine."
    )
    return noted(("Preset", "Training, minutes", *(head for head, *_ in columns), "Seeds"), cells, about)


def whole() -> str:
    """The time of whole commands, warm, and what a cold start adds."""
    start, rows = loaded(RESULTS / "bench_start.json"), loaded(RESULTS / "waiting.json")["rows"]
    rows = [row for row in rows if row["clock"] == "processor" and row["seed"] == 0]
    named = ", ".join(f"`{r['preset']}` on {r['clip']} ({r['frames']} frames) {duration(r['whole'])}" for r in rows)
    threads, machines = sorted({row["threads"] for row in rows}), sorted({row["machine"]["processor"] for row in rows})
    added = start["cold"]["first iteration"] - start["warm"]["first iteration"]
    return (
        "Whole commands, from reading the clip to its report, with LPIPS, in processor time of "
        f"{' or '.join(map(str, threads))} thread of {', '.join(machines)}, in minutes: {named}. With two threads the "
        f"iterations take less time on the clock. The first training on a machine compiles, which takes {added:.0f} s "
        "there on two cores."
    )


def recorded() -> str:
    """Time, memory and quality of each preset on the recorded clip: the table of README.md with the sizes."""
    return table((*SIZES, *MEASURED))


def simulated() -> str:
    """PSNR of the presets that were trained on the simulated clip, and of what needs no model."""
    seeds: dict[str, Any] = running_clip.means(running_clip.PROGRAM.read())
    model, paper = seeds["model"], mean_psnr(full_size.PROGRAM.read()["paper_eighth"], "model")
    rows = [["`quick`", f"{model.mean():.2f}", f"{model.size}"], ["`paper`", f"{paper:.2f}", "1"]]
    rows += [[LABELS[name], f"{np.mean(seeds[name]):.2f}", "-"] for name in PREDICTIONS[1:]]
    return markdown(("Prediction", "PSNR tissue, dB", "Seeds"), rows)


PROGRAM = Program(
    __name__, ("../README.md", "guides/which_preset.md"),
    {"table": table, "whole": whole, "recorded": recorded, "simulated": simulated},
)  # fmt: skip
