"""Train `sharp` with one of its changes taken back at a time, on simulated scenes over seeds, and write the table.

    python docs/pages/levers.py [--seeds 3] [--iterations 1500] [--table]

The scenes, the points and the length are those of docs/pages/trajectories.py. Every run is kept when it ends, and a
command that was stopped goes on with the runs that are missing. The result is docs/results/levers.json; the table
stands in docs/results/README.md between its marks; --table writes it again.
"""

from datetime import date
from pathlib import Path
from typing import Any

import kept
import numpy as np
from marks import read_json, write_marked
from scipy import stats
from trajectories import SCENES, asked, measured

from endotsr.report.tables import markdown
from endotsr.runs.files import write_json
from endotsr.runs.machine import machine

RESULTS = Path(__file__).parents[1] / "results"
FILE = RESULTS / "levers.json"
WHOLE = "`sharp`"
TAKEN_BACK: dict[str, dict[str, dict[str, Any]]] = {
    WHOLE: {},
    "no tracked motion": {"initialisation": {"motion": "none"}},
    "no targets between the frames": {"training": {"bridge_fraction": 0.0}},
    "rates not annealed": {"optimiser": {"annealed_factor": 1.0}},
    "position rate of `paper`": {"optimiser": {"deformation_position_factor": 1.0}},
    "`ssim_weight` of `paper`": {"loss": {"ssim_weight": 0.1}},
    "width of `paper`": {"model": {"initial_width": 0.01}},
}
SHOWN = (("psnr_tissue", "held-out PSNR tissue, dB", 2), ("scene_units", "trajectory error, mm", 3))


def found(seeds: int, iterations: int) -> dict[str, Any]:
    """Scene -> label -> seed -> numbers of the run; runs that are kept are not trained again."""
    about = {"seeds": seeds, "iterations": iterations, "sources": kept.sources("")}
    runs = {
        f"{scene}, {label}, seed {seed}": (scene, label, seed)
        for seed in range(seeds)
        for scene in SCENES
        for label in TAKEN_BACK
    }

    def train(key: str) -> dict[str, float]:
        scene, label, seed = runs[key]
        return measured(SCENES[scene], "sharp", seed, iterations, TAKEN_BACK[label])

    answers = kept.measured(FILE, about, runs, train)
    scenes: dict[str, Any] = {}
    for key, (scene, label, seed) in runs.items():
        scenes.setdefault(scene, {}).setdefault(label, {})[str(seed)] = answers[key]
    return scenes


def table(result: dict[str, Any]) -> str:
    """Means over the seeds of `sharp`, and the paired differences of what is taken back with 95 % intervals."""
    rows = []
    if not result:
        return "Not measured yet."
    for scene, variants in result["scenes"].items():
        for label, runs in variants.items():
            pairs = [(runs[seed], variants[WHOLE][seed]) for seed in sorted(runs)]
            values = [np.array([[run[key] for run in pair] for pair in pairs]) for key, _, _ in SHOWN]
            cells = [_cell(v, label, digits) for v, (_, _, digits) in zip(values, SHOWN, strict=True)]
            rows.append([scene, label, str(len(pairs)), *cells])
    about = (
        f"Difference from `sharp` on the same seed, mean ± 95 % interval; {result['iterations']} iterations; "
        f"{result['machine']['processor']}, {result['date']}."
    )
    return markdown(["Scene", "Settings", "seeds", *(name for _, name, _ in SHOWN)], rows) + "\n\n" + about


def _cell(values: np.ndarray, label: str, digits: int) -> str:
    """`values` has shape (seeds, 2): the run, and `sharp` on that seed."""
    if label == WHOLE:
        return f"{values[:, 0].mean():.{digits}f}"
    apart = values[:, 0] - values[:, 1]
    if apart.size < 2:
        return f"{apart.mean():+.{digits}f}"
    half = stats.t.ppf(0.975, apart.size - 1) * apart.std(ddof=1) / np.sqrt(apart.size)
    return f"{apart.mean():+.{digits}f} ± {half:.{digits}f}"


def main() -> None:
    """The command."""
    options = asked(__doc__)
    if not options.table:
        about = {"seeds": options.seeds, "iterations": options.iterations, "date": date.today().isoformat()}
        scenes = found(options.seeds, options.iterations)
        write_json(FILE, about | {"machine": machine(), "scenes": scenes})
        kept.finished(FILE)
    result = read_json(FILE, "docs/pages/levers.py") if FILE.exists() else {}
    write_marked(RESULTS / "README.md", {"table": table(result)}, "levers")


if __name__ == "__main__":
    main()
