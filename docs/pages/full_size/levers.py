"""Train `sharp` with changed settings, over seeds and scenes, and write the tables.

    python docs/make.py full_size.levers changes [CLIP ...] [--seeds 3] [--iterations 1500] [--jobs 2]
    python docs/make.py full_size.levers weights [CLIP ...]    several weights of the similarity, for the rulings
    python docs/make.py full_size.levers changes --table       rewrite the tables of the last result

`changes` trains `sharp`, `paper`, and `sharp` with one of its changes reverted at a time.
Two scenes are simulated, so their true motion is known. A CLIP is a sequence folder, read at half size. Its held-out
frames are excluded, and every eighth frame of the others is held out instead: no frame on which a preset is evaluated
is used. Every run has the length `--iterations` and the initial points of `demo`. Finished runs are kept, and a stopped
command continues with the missing runs. The tables are written between their marks in a page.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.splits import every_eighth
from endotsr.config import DEMO
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.store import kept
from pages.store.intervals import shown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
SIMULATED: dict[str, dict[str, Any]] = {
    "demo": {},
    "pull and breath": {
        "frames": 40, "seed": 7, "width": 192, "height": 144,
        "pulsation": {"on": False}, "brightening": {"on": False}, "pull": {"amplitude": 7.0},
    },
}  # fmt: skip
POINTS = {key: getattr(DEMO.initialisation, key) for key in ("first_frame_points", "other_frame_points")}
SHARP, PAPER = "`sharp`", "`paper`"
Rows = dict[str, dict[str, dict[str, Any]]]  # row of a table -> what is changed in the settings of `sharp`, by section
CHANGES: Rows = {
    SHARP: {},
    PAPER: {},
    "no tracked motion": {"initialisation": {"motion": "none"}},
    "no targets between the frames": {"training": {"bridge_fraction": 0.0}},
    "rates not annealed": {"optimiser": {"annealed_factor": 1.0}},
    "position rate of `paper`": {"optimiser": {"deformation_position_factor": 1.0}},
    "`ssim_weight` of `paper`": {"loss": {"ssim_weight": 0.1}},
    "width of `paper`": {"model": {"initial_width": 0.01}},
}
THRESHOLD = {"density": {"gradient_threshold": 4e-4}}  # of all rows: a larger weight makes more Gaussians
FORMER = "0.2"  # the weight that the others are compared with
WEIGHTS: Rows = {
    **{weight: {"loss": {"ssim_weight": float(weight)}, **THRESHOLD} for weight in (FORMER, "0.5", "0.7", "0.9")},
    "0.7, `lambda_lap` 3": {"loss": {"ssim_weight": 0.7, "lambda_lap": 3.0}, **THRESHOLD},
}
SHOWN = (("psnr_tissue", "held-out PSNR tissue, dB", 2), ("scene_units", "trajectory error, mm", 3))
MOTION = (
    ("scene_units", "trajectory error, mm", 3),
    ("pixels", "trajectory error, px", 2),
    ("psnr_tissue", "held-out PSNR tissue, dB", 2),
    ("cross_fade", "blend of its own renders, dB", 2),
    ("flow", "optical flow, dB", 2),
)


def scene_of(name: str, clips: dict[str, str]) -> Sequence:
    """A simulated scene, or the training frames of a clip {name: folder}, split among themselves."""
    import endotsr

    if name in SIMULATED:
        return endotsr.load_sequence("simulated", simulator=SIMULATED[name])
    return inner(endotsr.load_sequence(clips[name], scale=0.5))


def inner(sequence: Sequence) -> Sequence:
    """The training frames only, with every eighth held out; they keep their times."""
    own = sequence.train_index
    train, test = every_eighth(len(own))
    return replace(
        sequence,
        images=sequence.images[own], masks=sequence.masks[own], depth=sequence.depth[own], times=sequence.times[own],
        cameras=[sequence.cameras[i] for i in own], names=[sequence.names[i] for i in own],
        train_index=train, test_index=test,
    )  # fmt: skip


def measured(
    key: str, runs: dict[str, tuple[str, str, int]], iterations: int, clips: dict[str, str], rows: Rows
) -> dict[str, Any]:
    """Train one run (scene, row, seed), and measure it, with trajectories if the truth is known."""
    import endotsr

    scene, label, seed = runs[key]
    sections: dict[str, dict[str, Any]] = {
        "training": {"seed": seed},
        "initialisation": POINTS,
        "density": {"gradient_threshold": DEMO.density.gradient_threshold},
    }
    for section, values in rows[label].items():
        sections[section] = sections.get(section, {}) | values
    settings: dict[str, Any] = {"iterations": iterations, **sections}
    config = endotsr.make_config("paper" if label == PAPER else "sharp", **settings)
    metrics = endotsr.train(scene_of(scene, clips), config, on_message=lambda text: None).evaluate()
    return (metrics["trajectories"] or {}) | {
        "psnr_tissue": metrics["held_out"]["mean"]["psnr_tissue"],
        "cross_fade": metrics["cross_fade"]["mean"]["psnr_tissue"],
        "flow": metrics["baselines"]["flow_interpolation"]["mean"]["psnr_tissue"],
    }


def found(file: Path, rows: Rows, clips: dict[str, str], seeds: int, iterations: int, jobs: int) -> dict[str, Any]:
    """Scene -> row -> numbers of the runs in the order of their seeds; finished runs are not repeated."""
    about, scenes = {"iterations": iterations, "sources": kept.sources("")}, (*SIMULATED, *clips)
    runs = {
        f"{scene}, {label}, seed {seed}": (scene, label, seed)
        for seed in range(seeds)
        for scene in scenes
        for label in rows
    }
    train = partial(measured, runs=runs, iterations=iterations, clips=clips, rows=rows)
    answers = kept.measured(file, about, runs, train, jobs)
    return {
        scene: {label: [answers[f"{scene}, {label}, seed {seed}"] for seed in range(seeds)] for label in rows}
        for scene in scenes
    }


def motion_table(result: dict[str, Any]) -> str:
    """Both presets on the simulated scenes: means with intervals, and the motion of the tissue."""
    rows = []
    for scene in SIMULATED:
        for label in (PAPER, SHARP):
            runs = result["scenes"][scene][label]
            cells = [shown([run[key] for run in runs], digits) for key, _, digits in MOTION]
            rows.append([f"{scene}, {label}", f"{runs[0]['motion_scene_units']:.3f}", *cells])
    head = ["Scene and preset", "the tissue moves, mm", *(label for _, label, _ in MOTION)]
    return markdown(head, rows) + f"\n\nMean ± 95 % interval; {_about(result)}"


def table(result: dict[str, Any]) -> str:
    """Means over the seeds of `sharp`, and the paired differences of the other rows with 95 % intervals."""
    rows = []
    for scene, variants in result["scenes"].items():
        for label, runs in variants.items():
            cells = [cell(runs, variants[SHARP], key, digits) for key, _, digits in SHOWN]
            rows.append([scene, label, *cells])
    about = f"Difference from {SHARP} on the same seed, mean ± 95 % interval; {_about(result)}"
    return markdown(["Scene", "Settings", *(name for _, name, _ in SHOWN)], rows) + "\n\n" + about


def weights_table(result: dict[str, Any]) -> str:
    """Paired differences from the former weight, with 95 % intervals: held-out PSNR and trajectory error."""
    columns = [
        (f"{name}, {words.rsplit(', ', 1)[1]}", scene, key, digits)
        for name, scene in result["scenes"].items()
        for key, words, digits in SHOWN
        if key in scene[FORMER][0]
    ]
    rows = [
        [label, *(cell(scene[label], scene[FORMER], key, digits) for _, scene, key, digits in columns)]
        for label in WEIGHTS
    ]
    about = f"The first row is a level, the others are differences; {_about(result)}"
    return markdown(["$w$", *(column[0] for column in columns)], rows) + "\n\n" + about


def _about(result: dict[str, Any]) -> str:
    where = f"{result['machine']['processor']}, {result['date']}"
    return f"{result['seeds']} seeds, {result['iterations']} iterations; {where}."


def cell(runs: list[dict[str, float]], sharp: list[dict[str, float]], key: str, digits: int) -> str:
    """The mean for the row of `sharp`, the paired difference for the others, and a dash if nothing is known."""
    if key not in runs[0]:
        return "-"
    if runs is sharp:
        return f"{np.mean([run[key] for run in runs]):.{digits}f}"
    return shown([run[key] - other[key] for run, other in zip(runs, sharp, strict=True)], digits, "+")


class Study(NamedTuple):
    """Compared rows, and the locations of their tables."""

    rows: Rows
    file: Path  # of the result
    page: Path
    room: str  # of its marks
    tables: dict[str, Callable[[dict[str, Any]], str]]  # by mark


RULINGS, RESULTS = DOCS / "specification" / "rulings.md", DOCS / "results"
STUDIES = {
    "changes": Study(
        CHANGES, RESULTS / "levers.json", RESULTS / "README.md", "levers", {"table": table, "motion": motion_table}
    ),
    "weights": Study(WEIGHTS, RESULTS / "similarity.json", RULINGS, "similarity", {"table": weights_table}),
}


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("study", choices=STUDIES)
    parser.add_argument("clips", nargs="*", type=Path, metavar="CLIP")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=1500)
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time; the numbers do not depend on it")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    study = STUDIES[options.study]
    if not options.table:
        clips = {folder.name: str(folder.resolve()) for folder in options.clips}
        scenes = found(study.file, study.rows, clips, options.seeds, options.iterations, options.jobs)
        about = {"seeds": options.seeds, "iterations": options.iterations, "date": date.today().isoformat()}
        write_json(study.file, about | {"machine": machine(), "scenes": scenes})
        kept.finished(study.file)
    result = read_json(study.file, f"docs/pages/full_size/levers.py {options.study}")
    write_marked(study.page, {name: made(result) for name, made in study.tables.items()}, study.room)
