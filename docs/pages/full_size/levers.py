"""Train `sharp`, `paper`, and `sharp` with one of its changes reverted at a time, over seeds and scenes: two tables.

    python docs/make.py full_size.levers measure [CLIP ...] [--seeds 3] [--iterations 1500] [--jobs 2]
    python docs/make.py full_size.levers measure --chain      the paths of flow alone, into the stored record

Two scenes are simulated, so their true motion is known. A CLIP is a sequence folder, read at half size. Its held-out
frames are excluded, and every eighth frame of the others is held out instead: no frame on which a preset is evaluated
is used. Every run has the length `--iterations` and the initial points of `demo`. Finished runs are kept, and a stopped
command continues with the missing runs. The paths of flow, chained from frame to frame and lifted by the prior depth
(`full_size.chain`), need no training.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.splits import every_eighth
from endotsr.config import DEMO
from endotsr.training.runs.machine import dated
from pages.full_size import chain
from pages.store import kept
from pages.store.commands import loaded
from pages.store.intervals import shown
from pages.store.program import CLIPS, Program
from pages.store.tables import means, noted, where

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


def of_run(scene: str, label: str, seed: int, iterations: int, clips: dict[str, str], rows: Rows) -> dict[str, Any]:
    """Train one run, and measure it, with trajectories if the truth is known."""
    import endotsr

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


def trained(options: argparse.Namespace, rows: Rows) -> dict[str, Any]:
    """Scene -> row -> numbers of the runs in the order of their seeds; finished runs are not repeated."""
    clips = {folder.name: str(folder.resolve()) for folder in options.clips}
    scenes, seeds = (*SIMULATED, *clips), range(options.seeds)
    runs = [(scene, label, seed) for seed in seeds for scene in scenes for label in rows]
    about = {"iterations": options.iterations, "sources": kept.sources("")}
    train = partial(of_run, iterations=options.iterations, clips=clips, rows=rows)
    found = kept.nested(kept.measured(options.record, about, runs, train, options.jobs))
    return {"seeds": options.seeds, "iterations": options.iterations, "scenes": found}


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The trainings with the paths of flow; with `--chain` the stored trainings."""
    trainings = loaded(options.record) if options.chain else dated(trained(options, CHANGES))
    paths = {scene: chain.measured(settings) for scene, settings in SIMULATED.items()}
    return trainings | {"chain": dated({"scenes": paths})}


def motion_table(result: dict[str, Any]) -> str:
    """The paths of flow and of both presets on the simulated scenes, and the motion of the tissue."""
    rows = []
    paths = result["chain"]["scenes"]
    for scene in SIMULATED:
        rows.append([f"{scene}, flow from frame to frame", moves(result, scene), *chain_cells(paths[scene])])
        for label in (PAPER, SHARP):
            cells = means(result["scenes"][scene][label], [(key, digits) for key, _, digits in MOTION])
            rows.append([f"{scene}, {label}", moves(result, scene), *cells])
    head = ["Scene and paths", "the tissue moves, mm", *(label for _, label, _ in MOTION)]
    least = min(path["followed"] for path in paths.values())
    note = (
        f"Mean ± 95 % interval; {about(result)} *Flow from frame to frame* are tracks as in (B15), to which {SHARP} "
        "fits its initial motion, before any training, from every tissue pixel with a prior depth. Flow follows a "
        f"point in {100 * least:.0f} % of the frames or more, in the mean of a scene; elsewhere the point moves with "
        f"its neighbours; {where(result['chain'])}."
    )
    return noted(head, rows, note)


def moves(result: dict[str, Any], scene: str) -> str:
    """The mean motion of the tissue."""
    return f"{result['scenes'][scene][PAPER][0]['motion_scene_units']:.3f}"


def chain_cells(path: dict[str, float]) -> list[str]:
    """The errors of the paths of flow; they have no pictures."""
    return [f"{path[key]:.{digits}f}" if key in path else "-" for key, _, digits in MOTION]


def table(result: dict[str, Any]) -> str:
    """Means over the seeds of `sharp`, and the paired differences of the other rows with 95 % intervals."""
    rows = []
    for scene, variants in result["scenes"].items():
        for label, runs in variants.items():
            cells = [cell(runs, variants[SHARP], key, digits) for key, _, digits in SHOWN]
            rows.append([scene, label, *cells])
    note = f"Difference from {SHARP} on the same seed, mean ± 95 % interval; {about(result)}"
    return noted(["Scene", "Settings", *(name for _, name, _ in SHOWN)], rows, note)


def about(result: dict[str, Any]) -> str:
    """Length, start and place of the trainings."""
    start = f"{result['iterations']} iterations from the initial points of `demo`"
    return f"{result['seeds']} seeds, {start}; {where(result)}."


def cell(runs: list[dict[str, float]], sharp: list[dict[str, float]], key: str, digits: int) -> str:
    """The mean for the row of `sharp`, the paired difference for the others, and a dash if nothing is known."""
    if key not in runs[0]:
        return "-"
    if runs is sharp:
        return f"{np.mean([run[key] for run in runs]):.{digits}f}"
    return shown([run[key] - other[key] for run, other in zip(runs, sharp, strict=True)], digits, "+")


OPTIONS = {"clips": CLIPS, "--seeds": 3, "--iterations": 1500, "--jobs": 2}
PROGRAM = Program(
    __name__, "results/README.md", {"table": table, "motion": motion_table}, "levers.json", measured,
    OPTIONS | {"--chain": {"action": "store_true", "help": "keep the trainings, measure the paths of flow alone"}},
    stamped=False,
)  # fmt: skip
