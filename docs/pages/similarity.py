"""Train `sharp` with several weights of the similarity, over seeds and scenes, and write the table of the rulings.

    python docs/pages/similarity.py CLIP [--jobs 2]
    python docs/pages/similarity.py --table    write the table of the last result again

Scenes, held-out frames and points are those of `levers.py`; no frame that a preset is judged by takes part. Every run
is kept when it ends. The result is docs/results/similarity.json.
"""

import argparse
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import kept
import levers
from marks import read_json, write_marked

from endotsr.report.tables import markdown
from endotsr.runs.files import write_json
from endotsr.runs.machine import machine

FILE, PAGE = levers.RESULTS / "similarity.json", Path(__file__).parents[1] / "specification" / "rulings.md"
THRESHOLD = {"density": {"gradient_threshold": 4e-4}}  # of all rows: a larger weight makes more Gaussians
FORMER = "0.2"  # the weight that the others are compared with
CHANGES: dict[str, dict[str, dict[str, Any]]] = {
    **{weight: {"loss": {"ssim_weight": float(weight)}, **THRESHOLD} for weight in (FORMER, "0.5", "0.7", "0.9")},
    "0.7, `lambda_lap` 3": {"loss": {"ssim_weight": 0.7, "lambda_lap": 3.0}, **THRESHOLD},
}
SEEDS, ITERATIONS = 3, 1500


def measured(key: str, runs: dict[str, tuple[str, str, int]], clips: dict[str, str]) -> dict[str, float]:
    """One run (scene, row of `CHANGES`, seed) of `levers.measured`."""
    return levers.measured(key, runs, ITERATIONS, clips, CHANGES)


def table(result: dict[str, Any]) -> str:
    """Paired differences from the former weight, with 95 % intervals: held-out PSNR and trajectory error."""
    columns = [
        (f"{name}, {words.rsplit(', ', 1)[1]}", scene, key, digits)
        for name, scene in result["scenes"].items()
        for key, words, digits in levers.SHOWN
        if key in scene[FORMER][0]
    ]
    rows = [
        [label, *(levers.cell(scene[label], scene[FORMER], key, digits) for _, scene, key, digits in columns)]
        for label in CHANGES
    ]
    about = f"{SEEDS} seeds, {ITERATIONS} iterations; {result['machine']['processor']}, {result['date']}."
    return (
        markdown(["$w$", *(column[0] for column in columns)], rows)
        + f"\n\nThe first row is a level, the others are differences; {about}"
    )


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("clips", nargs="*", type=Path, metavar="CLIP")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time; the numbers do not depend on it")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    if not options.table:
        clips = {folder.name: str(folder.resolve()) for folder in options.clips}
        names, seeds = (*levers.SIMULATED, *clips), range(SEEDS)
        runs = {f"{n}, {label}, seed {s}": (n, label, s) for s in seeds for n in names for label in CHANGES}
        found = kept.measured(
            FILE, {"sources": kept.sources("")}, runs, partial(measured, runs=runs, clips=clips), options.jobs
        )
        scenes = {n: {label: [found[f"{n}, {label}, seed {s}"] for s in seeds] for label in CHANGES} for n in names}
        write_json(FILE, {"date": date.today().isoformat(), "machine": machine(), "scenes": scenes})
        kept.finished(FILE)
    write_marked(PAGE, {"table": table(read_json(FILE, "docs/pages/similarity.py"))}, "similarity")


if __name__ == "__main__":
    main()
