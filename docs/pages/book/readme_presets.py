"""Write the table of presets of README.md, time and quality on one clip: python docs/make.py book.readme_presets

The records are docs/results/minutes.json (`python docs/make.py bench.minutes`), for whole commands waiting.json
(`bench.waiting`), and for the compilation bench_start.json (`bench measure start`).
"""

import sys
from pathlib import Path
from statistics import mean
from typing import Any

from endotsr.config import PRESETS
from endotsr.results.report.tables import duration, markdown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
PAGE, RECORD = DOCS.parent / "README.md", DOCS / "results" / "minutes.json"
WHOLE, START = DOCS / "results" / "waiting.json", DOCS / "results" / "bench_start.json"
MEASURED = (("PSNR full, dB", "psnr_full", 1.0, 2), ("LPIPS [0,1]", "lpips", 1.0, 4))  # head, key, unit, digits
SIZES = (("GB", "peak_memory_bytes", 1e9, 1), ("Gaussians", "gaussians", 1.0, 0))


def table(found: dict[str, Any], columns: tuple[tuple[str, str, float, int], ...] = MEASURED) -> str:
    """One row per preset, the fastest first, means over the seeds; then the clip and the machine."""
    rows = sorted((mean(run["seconds"] for run in runs), name, runs) for name, runs in found["rows"].items())
    cells = [
        [
            f"`{name}`",
            f"{seconds / 60:.1f}",
            *(f"{mean(run[key] for run in of) / unit:.{digits}f}" for _, key, unit, digits in columns),
            str(len(of)),
        ]
        for seconds, name, of in rows
        if name in PRESETS
    ]
    runs = [run for name, of in found["rows"].items() if name in PRESETS for run in of]
    machines, threads = sorted({run["processor"] for run in runs}), sorted({run["threads"] for run in runs})
    clip = found["clip"]
    about = (
        f"{clip['name']}, {clip['frames']} frames of {clip['size']}, every eighth held out; "
        f"{' or '.join(map(str, threads))} threads of {', '.join(machines)}, {max(run['date'] for run in runs)}. The "
        "time is that of the iterations; it holds for this class of machine."
    )
    heads = ("Preset", "Training, minutes", *(head for head, *_ in columns), "Seeds")
    return f"{markdown(heads, cells)}\n\n{about}"


def whole(rows: list[dict[str, Any]], start: dict[str, Any]) -> str:
    """The time of whole commands, warm, and what a cold start adds."""
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


def parts() -> dict[str, str]:
    """The generated parts of README.md."""
    rows, start = read_json(WHOLE, "python docs/make.py bench.waiting add CLIP")["rows"], read_json(START, "bench")
    return {"table": table(read_json(RECORD, "python docs/make.py bench.minutes")), "whole": whole(rows, start)}


def main(words: list[str]) -> None:
    """The command."""
    if words:
        sys.exit(__doc__)
    write_marked(PAGE, parts(), "presets")
