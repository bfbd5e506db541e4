"""Measure the cost of accuracy in time, and write docs/tradeoff.md.

    python docs/make.py tradeoff measure render [SCENE ...]     the simulated scene, then SPLATS.npz or run folders
    python docs/make.py tradeoff measure scene SCENE ...        trained scenes alone

Run it on an otherwise idle machine. `tradeoff.train` and `tradeoff.stop` make the other records of the page.
"""

import argparse
from pathlib import Path
from typing import Any, cast

from endotsr.cli.parts.progress import StepBar
from endotsr.cli.tradeoff import TradeoffOptions, chosen_scene
from endotsr.method.kernels.threads import use_threads
from endotsr.studies.tradeoff.results import Measurement, read_measurement
from endotsr.studies.tradeoff.study import described
from endotsr.training.runs.files import write_json
from pages.store.commands import loaded
from pages.store.program import RESULTS, Program
from pages.tradeoff import stop as tradeoff_stop
from pages.tradeoff.figures import draw, draw_training
from pages.tradeoff.parts import fragments
from pages.tradeoff.study import run_whole_study


def measure(name: str, options: TradeoffOptions) -> None:
    """One scene, simulated, of a run, or from a file of Gaussians, to docs/results/NAME.json."""
    use_threads(options.threads)
    with StepBar("settings") as bar:
        found = run_whole_study(chosen_scene(options), begin=bar.begin, step=bar.step)
    write_json(RESULTS / f"{name}.json", described(cast(Measurement, found)))


def measured(options: argparse.Namespace) -> None:
    """The simulated scene, and trained scenes to docs/results/tradeoff_NAME.json."""
    if options.what == "render":
        measure("tradeoff", TradeoffOptions())
    for scene in options.scenes:
        chosen = TradeoffOptions(run=scene) if scene.is_dir() else TradeoffOptions(splats=scene)
        measure(f"tradeoff_{scene.stem.removesuffix('_splats')}", chosen)


def read_scenes() -> dict[str, dict[str, Any]]:
    """The measurements of trained scenes, by name."""
    return {name: found for name, found in _read("tradeoff_").items() if not name.startswith("training_")}


def read_trainings() -> dict[str, dict[str, Any]]:
    """The studies of training, by the name of their sequence."""
    return _read("tradeoff_training_")


def _read(start: str) -> dict[str, dict[str, Any]]:
    """JSON files of docs/results with this prefix, by the rest of their names."""
    return {file.stem.removeprefix(start): loaded(file) for file in sorted(RESULTS.glob(f"{start}*.json"))}


def pictures(result: dict[str, Any]) -> None:
    """The pictures of the page."""
    draw(read_measurement(RESULTS / "tradeoff.json"), RESULTS)
    for name, study in read_trainings().items():
        draw_training(study, RESULTS, f"tradeoff_training_{name}")


def parts() -> dict[str, str]:
    """Every generated part of the page by name."""
    stop = {"stop": tradeoff_stop.sentences(tradeoff_stop.PROGRAM.read())}
    return fragments(loaded(RESULTS / "tradeoff.json"), read_scenes(), read_trainings()) | stop


PROGRAM = Program(
    __name__, "tradeoff.md", parts, "", measured,
    {"what": {"choices": ["render", "scene"]}, "scenes": {"nargs": "*", "type": Path, "metavar": "SCENE"}}, pictures,
)  # fmt: skip
