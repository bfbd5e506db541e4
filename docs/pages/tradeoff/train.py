"""Train a sequence with one setting changed at a time, and measure held-out frames during each training.

    python docs/make.py tradeoff.train measure SEQUENCE [--minutes 90] [--lpips FILE]

A SEQUENCE is a sequence folder or the word `simulated`. The study is stored after every training; after an
interruption, the same command continues it. `python docs/make.py tradeoff` then writes docs/tradeoff.md.
"""

import argparse
import shutil
from pathlib import Path

import msgspec

from endotsr.cli.parts.progress import StepBar
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import PRESETS, config_from_dict
from endotsr.errors import InputError
from endotsr.method.kernels.threads import use_threads
from endotsr.results.evaluation.lpips import load_lpips_weights
from endotsr.training.runs.files import refuse_folder
from endotsr.training.runs.sources import SIMULATED, load_sequence
from pages.store.program import DOCS, LPIPS, RESULTS, Program
from pages.tradeoff.parts import training
from pages.tradeoff.training import run_training_study

TRAINING = "training.json"  # in the folder of the measurement


def run(o: argparse.Namespace) -> Path:
    """The study, printed as a table. Returns: its file. Raises: InputError."""
    if not o.minutes > 0 or (o.iterations is not None and o.iterations < 1):
        raise InputError("tradeoff.train: use --minutes > 0, --iterations >= 1")
    use_threads(o.threads)
    name = o.sequence if o.sequence == SIMULATED else Path(o.sequence).resolve().name
    out = o.out or DOCS / "_build" / "tradeoff" / name
    data = msgspec.to_builtins(PRESETS[o.preset or ("demo" if o.sequence == SIMULATED else "paper")])
    data["sequence"]["scale"] = o.scale
    refuse_folder(out)
    with StepBar("iterations") as bar:
        result = run_training_study(
            out / TRAINING,
            config_from_dict(data, "command line"),
            lambda config: load_sequence(o.sequence, config, SimulatorSettings()),
            name,
            minutes=o.minutes, iterations=o.iterations, weights=load_lpips_weights(o.lpips),
            begin=bar.begin, step=bar.step, say=bar.say,
        )  # fmt: skip
    print(training(name, result))
    return out / TRAINING


def measured(options: argparse.Namespace) -> None:
    """One study of training; without --out to docs/results/tradeoff_training_NAME.json."""
    file = run(options)
    if options.out is None:
        shutil.move(file, RESULTS / f"tradeoff_training_{file.parent.name}.json")


OPTIONS = {
    "sequence": {"metavar": "SEQUENCE"},
    "--out": {"type": Path, "metavar": "DIR", "help": "folder of the measurement (default: docs/results at its end)"},
    "--minutes": {"type": float, "default": 8.0, "help": "length of the whole study; it sets the iterations"},
    "--iterations": {"type": int, "help": "iterations of each training instead"},
    "--preset": {"choices": list(PRESETS), "help": "of the base (default: demo for `simulated`, or paper)"},
    "--scale": {"type": float, "default": 1.0, "help": "image scale of the base training"},
    "--lpips": LPIPS,
    "--threads": {"type": int, "default": 2, "help": "threads, 0 = all cores"},
}
PROGRAM = Program(__name__, measure=measured, options=OPTIONS)
