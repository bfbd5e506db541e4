"""Train a sequence with one setting changed at a time, and measure held-out frames during each training.

OUT/training.json is written after every training; after an interruption, the same command continues the study.
"""

import argparse
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
from pages.tradeoff.text import training_lines
from pages.tradeoff.training import run_training_study

TRAINING = "training.json"  # in the folder of the measurement


def options(words: list[str]) -> argparse.Namespace:
    """The options of a study of training."""
    parser = argparse.ArgumentParser(prog="tradeoff.py train", description=__doc__)
    parser.add_argument("sequence", help="sequence folder, or `simulated`")
    parser.add_argument("--out", type=Path, required=True, help="folder of the measurement")
    parser.add_argument("--minutes", type=float, default=8.0, help="length of the whole study; it sets the iterations")
    parser.add_argument("--iterations", type=int, help="iterations of each training instead")
    parser.add_argument("--preset", choices=list(PRESETS), help="of the base (default: demo for `simulated`, or paper)")
    parser.add_argument("--scale", type=float, default=1.0, help="image scale of the base training")
    parser.add_argument("--lpips", type=Path, help="AlexNet LPIPS weights")
    parser.add_argument("--threads", type=int, default=2, help="threads, 0 = all cores")
    found = parser.parse_args(words)
    if not found.minutes > 0 or (found.iterations is not None and found.iterations < 1):
        raise InputError("tradeoff.py train: allowed: --minutes > 0, --iterations >= 1")
    return found


def run(words: list[str]) -> None:
    """The study, printed as a table. Raises: InputError."""
    o = options(words)
    use_threads(o.threads)
    data = msgspec.to_builtins(PRESETS[o.preset or ("demo" if o.sequence == SIMULATED else "paper")])
    data["sequence"]["scale"] = o.scale
    refuse_folder(o.out)
    with StepBar("iterations") as bar:
        result = run_training_study(
            o.out / TRAINING,
            config_from_dict(data, "command line"),
            lambda config: load_sequence(o.sequence, config, SimulatorSettings()),
            o.sequence if o.sequence == SIMULATED else Path(o.sequence).resolve().name,
            minutes=o.minutes, iterations=o.iterations, weights=load_lpips_weights(o.lpips),
            begin=bar.begin, step=bar.step, say=bar.say,
        )  # fmt: skip
    print("\n".join(training_lines(result)))
