"""Train presets on simulated scenes whose true motion is known, over seeds, and write the table of the errors.

    python docs/pages/trajectories.py [--seeds 3] [--iterations 1500] [--table]

Every scene is trained with `paper` and `sharp`, both stretched to the same number of iterations and with the points of
`demo`. The result is docs/results/trajectories.json; the table stands in docs/results/README.md between
its marks. --table writes the table of the last result again.
"""

import argparse
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from marks import read_json, write_marked

import endotsr
from endotsr.config import DEMO
from endotsr.report.tables import markdown
from endotsr.runs.files import write_json
from endotsr.runs.machine import machine

RESULTS = Path(__file__).parents[1] / "results"
SCENES: dict[str, dict[str, Any]] = {
    "demo": {},
    "pull and breath": {
        "frames": 40, "seed": 7, "width": 192, "height": 144,
        "pulsation": {"on": False}, "brightening": {"on": False}, "pull": {"amplitude": 7.0},
    },
}  # fmt: skip
PRESETS = ("paper", "sharp")
SHOWN = (
    ("scene_units", "trajectory error, mm", 3),
    ("pixels", "trajectory error, px", 2),
    ("psnr_tissue", "held-out PSNR tissue, dB", 2),
    ("cross_fade", "blend of its own renders, dB", 2),
    ("flow", "optical flow, dB", 2),
)


def measured(
    scene: dict[str, Any], preset: str, seed: int, iterations: int, changed: dict[str, dict[str, Any]] | None = None
) -> dict[str, float]:
    """Train one preset, with settings changed by section, on one scene, and measure it."""
    sequence = endotsr.load_sequence("simulated", simulator=scene)
    sections: dict[str, dict[str, Any]] = {
        "training": {"seed": seed},
        "initialisation": {
            key: getattr(DEMO.initialisation, key) for key in ("first_frame_points", "other_frame_points")
        },
        "density": {"gradient_threshold": DEMO.density.gradient_threshold},
    }
    for section, values in (changed or {}).items():
        sections[section] = sections.get(section, {}) | values
    config = endotsr.make_config(preset, iterations=iterations, **sections)
    metrics = endotsr.train(sequence, config, on_message=lambda text: None).evaluate()
    return metrics["trajectories"] | {
        "psnr_tissue": metrics["held_out"]["mean"]["psnr_tissue"],
        "cross_fade": metrics["cross_fade"]["mean"]["psnr_tissue"],
        "flow": metrics["baselines"]["flow_interpolation"]["mean"]["psnr_tissue"],
    }


def table(result: dict[str, Any]) -> str:
    """Mean and standard deviation over the seeds, and what the tissue itself moves."""
    rows = []
    for scene, presets in result["scenes"].items():
        for preset, runs in presets.items():
            cells = [_over(np.array([run[key] for run in runs]), digits) for key, _, digits in SHOWN]
            rows.append([f"{scene}, `{preset}`", f"{runs[0]['motion_scene_units']:.3f}", *cells])
    about = (
        f"Mean ± standard deviation over {result['seeds']} seeds, {result['iterations']} iterations; "
        f"{result['machine']['processor']}, {result['date']}."
    )
    return (
        markdown(["Scene and preset", "the tissue moves, mm", *(label for _, label, _ in SHOWN)], rows) + "\n\n" + about
    )


def _over(values: np.ndarray, digits: int) -> str:
    return f"{values.mean():.{digits}f} ± {values.std(ddof=1) if values.size > 1 else 0:.{digits}f}"


def asked(purpose: str | None) -> argparse.Namespace:
    """The options of a command that trains on these scenes; `purpose` is the text of its module."""
    parser = argparse.ArgumentParser(description=(purpose or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=1500)
    parser.add_argument("--table", action="store_true")
    return parser.parse_args()


def main() -> None:
    """The command."""
    options = asked(__doc__)
    file = RESULTS / "trajectories.json"
    if not options.table:
        scenes = {
            name: {p: [measured(scene, p, s, options.iterations) for s in range(options.seeds)] for p in PRESETS}
            for name, scene in SCENES.items()
        }
        about = {"seeds": options.seeds, "iterations": options.iterations, "date": date.today().isoformat()}
        write_json(file, about | {"machine": machine(), "scenes": scenes})
    write_marked(RESULTS / "README.md", {"table": table(read_json(file, "docs/pages/trajectories.py"))}, "trajectories")


if __name__ == "__main__":
    main()
