"""Measure the cost of accuracy in time, and write docs/tradeoff.md.

    python docs/make.py tradeoff render [SCENE ...]         the simulated scene, then SPLATS.npz or run folders
    python docs/make.py tradeoff scene SCENE ...            trained scenes alone
    python docs/make.py tradeoff train SEQUENCE [OPTIONS]   trainings; `train --help` lists OPTIONS
    python docs/make.py tradeoff draw DIR                   pictures of a measurement of `endotsr tradeoff --out DIR`
    python docs/make.py tradeoff                            rewrite pictures and page from the files

Run it on an otherwise idle machine. An interrupted `train` continues: its file is kept in docs/_build/tradeoff until
the study is complete. A SEQUENCE is a sequence folder or the word `simulated`.
"""

import shutil
import sys
from pathlib import Path
from typing import Any, cast

from endotsr.cli.parts.progress import StepBar
from endotsr.cli.tradeoff import RESULT, TradeoffOptions, chosen_scene
from endotsr.errors import InputError
from endotsr.method.kernels.threads import use_threads
from endotsr.studies.tradeoff.results import Measurement, read_format, read_measurement
from endotsr.studies.tradeoff.study import described
from endotsr.training.runs.files import write_json
from pages.store.marks import read_json, write_marked
from pages.tradeoff import stop as tradeoff_stop
from pages.tradeoff.figures import draw, draw_training
from pages.tradeoff.parts import fragments
from pages.tradeoff.study import run_whole_study
from pages.tradeoff.train import TRAINING
from pages.tradeoff.train import run as run_training

DOCS = Path(__file__).parents[2]
PAGE, RESULTS = DOCS / "tradeoff.md", DOCS / "results"
COMMAND = "python docs/make.py tradeoff render"
WORK = DOCS / "_build" / "tradeoff"


def measure(name: str, options: TradeoffOptions) -> None:
    """One scene, simulated, of a run, or from a file of Gaussians, to docs/results/NAME.json."""
    use_threads(options.threads)
    with StepBar("settings") as bar:
        found = run_whole_study(chosen_scene(options), begin=bar.begin, step=bar.step)
    write_json(RESULTS / f"{name}.json", described(cast(Measurement, found)))


def measure_trained(scene: Path) -> None:
    """A run folder or a file of Gaussians, to docs/results/tradeoff_NAME.json."""
    options = TradeoffOptions(run=scene) if scene.is_dir() else TradeoffOptions(splats=scene)
    measure(f"tradeoff_{scene.stem.removesuffix('_splats')}", options)


def draw_measured(folder: Path) -> None:
    """Draw the pictures of the measurements in a folder, into that folder. Raises: InputError if there is none."""
    drawn = []
    if (folder / RESULT).exists():
        drawn += draw(read_measurement(folder / RESULT), folder)
    if (folder / TRAINING).exists():
        drawn += draw_training(read_format(folder / TRAINING), folder, "training")
    if not drawn:
        raise InputError(f"{folder}: holds no measurement; make one with `endotsr tradeoff --out {folder}`")
    print(*(folder / f"{stem}.png" for stem in drawn), sep="\n")


def train(sequence: str, words: list[str]) -> None:
    """One study of training to docs/results/tradeoff_training_NAME.json."""
    name = Path(sequence).name
    out = WORK / name
    run_training([sequence, "--out", str(out), *words])
    shutil.copy(out / TRAINING, RESULTS / f"tradeoff_training_{name}.json")
    shutil.rmtree(out)


def read_scenes() -> dict[str, dict[str, Any]]:
    """The measurements of trained scenes, by name."""
    return {name: found for name, found in _read("tradeoff_").items() if not name.startswith("training_")}


def read_trainings() -> dict[str, dict[str, Any]]:
    """The studies of training, by the name of their sequence."""
    return _read("tradeoff_training_")


def _read(start: str) -> dict[str, dict[str, Any]]:
    """JSON files of docs/results with this prefix, by the rest of their names."""
    return {p.stem.removeprefix(start): read_json(p, COMMAND) for p in sorted(RESULTS.glob(f"{start}*.json"))}


def write_page() -> None:
    """Write the pictures of the page, and its generated parts."""
    result, trainings = read_measurement(RESULTS / "tradeoff.json"), read_trainings()
    draw(result, RESULTS)
    for name, study in trainings.items():
        draw_training(study, RESULTS, f"tradeoff_training_{name}")
    write_marked(PAGE, parts(), "tradeoff")


def parts() -> dict[str, str]:
    """Every generated part of the page by name."""
    result, stop = (
        read_json(RESULTS / "tradeoff.json", COMMAND),
        read_json(tradeoff_stop.FILE, "python docs/make.py tradeoff.stop"),
    )
    return fragments(result, read_scenes(), read_trainings()) | {"stop": tradeoff_stop.sentences(stop)}


def main(words: list[str]) -> None:
    """The command."""
    try:
        if words[:1] == ["draw"] and len(words) == 2:
            return draw_measured(Path(words[1]))
        if words[:1] == ["render"]:
            measure("tradeoff", TradeoffOptions())
        if words[:1] in (["render"], ["scene"]):
            for scene in words[1:]:
                measure_trained(Path(scene))
        elif words[:1] == ["train"] and len(words) > 1:
            train(words[1], words[2:])
        elif words:
            sys.exit(__doc__)
        write_page()
    except InputError as error:
        sys.exit(f"error: {error}")
