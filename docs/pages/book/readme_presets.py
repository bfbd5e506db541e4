"""Write the table of presets of README.md, time and quality on one clip: python docs/make.py book.readme_presets

The record is docs/results/minutes.json (`python docs/make.py bench.minutes`).
"""

import sys
from pathlib import Path
from statistics import mean
from typing import Any

from endotsr.config import PRESETS
from endotsr.results.report.tables import markdown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
PAGE, RECORD = DOCS.parent / "README.md", DOCS / "results" / "minutes.json"
HEADS = ("Preset", "Training, minutes", "PSNR full, dB", "LPIPS [0,1]", "Seeds")
MEASURED = (("psnr_full", 2), ("lpips", 4))  # metric, digits


def table(found: dict[str, Any]) -> str:
    """One row per preset, the fastest first, with the machine."""
    rows = sorted((mean(run["seconds"] for run in runs), name, runs) for name, runs in found["rows"].items())
    cells = [
        [
            f"`{name}`",
            f"{seconds / 60:.1f}",
            *(f"{mean(run[k] for run in of):.{d}f}" for k, d in MEASURED),
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
    return f"{markdown(HEADS, cells)}\n\n{about}"


def parts() -> dict[str, str]:
    """The generated part of README.md."""
    return {"table": table(read_json(RECORD, "python docs/make.py bench.minutes"))}


def main(words: list[str]) -> None:
    """The command."""
    if words:
        sys.exit(__doc__)
    write_marked(PAGE, parts(), "presets")
