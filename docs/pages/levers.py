"""Train `sharp` with one of its changes taken back at a time, on simulated scenes over seeds, and write the table.

    python docs/pages/levers.py [--seeds 3] [--iterations 1500] [--table]

The scenes, the points and the length are those of docs/pages/trajectories.py. Every run is kept in
docs/results/levers.json when it ends, and a command that was stopped goes on with the runs that are missing. The table
stands in docs/results/README.md between its marks; --table writes it again.
"""

from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from marks import read_json, write_marked
from scipy import stats
from trajectories import SCENES, asked, measured

from endotsr.report.tables import markdown
from endotsr.runs.files import write_json
from endotsr.runs.machine import machine

RESULTS = Path(__file__).parents[1] / "results"
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


def run_missing(result: dict[str, Any], file: Path) -> None:
    """Train what `result` does not hold yet; the file is written after every run."""
    for seed in range(result["seeds"]):
        for scene, settings in SCENES.items():
            for label, changed in TAKEN_BACK.items():
                runs = result["scenes"].setdefault(scene, {}).setdefault(label, {})
                if str(seed) not in runs:
                    runs[str(seed)] = measured(settings, "sharp", seed, result["iterations"], changed)
                    write_json(file, result)


def table(result: dict[str, Any]) -> str:
    """Means over the seeds of `sharp`, and the paired differences of what is taken back with 95 % intervals."""
    rows = []
    if not result:
        return "Not measured yet."
    for scene, variants in result["scenes"].items():
        for label, runs in variants.items():
            pairs = [(runs[seed], variants[WHOLE][seed]) for seed in sorted(runs) if seed in variants[WHOLE]]
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
    file = RESULTS / "levers.json"
    about = {"seeds": options.seeds, "iterations": options.iterations}
    result = read_json(file, "docs/pages/levers.py") if file.exists() else {}
    if not options.table:
        if {key: result.get(key) for key in about} != about:
            result = {"scenes": {}}
        result |= about | {"date": date.today().isoformat(), "machine": machine()}
        run_missing(result, file)
    write_marked(RESULTS / "README.md", {"table": table(result)}, "levers")


if __name__ == "__main__":
    main()
