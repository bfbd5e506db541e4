"""`endotsr tradeoff train`: held-out quality against training time."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.progress import StepBar
from endotsr.config import Preset
from endotsr.errors import InputError
from endotsr.runs.files import refuse_folder
from endotsr.runs.sources import SIMULATED

TRAINING = "training.json"  # in the folder of the measurement


@dataclass
class TradeoffTrainOptions:
    """Train the same sequence with one setting changed at a time, and measure held-out frames during each training.

    DIR/training.json is written after every training; after an interruption, the same command continues the study.
    """

    sequence: Annotated[str, Option("[SEQUENCE]", positional=True)] = SIMULATED
    """sequence folder, or `simulated`"""
    out: Annotated[Path, Option("DIR")] = Path("tradeoff")
    """folder of the measurement"""
    minutes: float = 8.0
    """length of the whole study: it sets the iterations of each training, and a training that would exceed it is left
    out"""
    iterations: Annotated[int | None, Option("N")] = None
    """iterations of each training instead"""
    preset: Preset | None = None
    """settings of the base training (default: demo for `simulated`, paper for a folder)"""
    scale: float = 1.0
    """image scale of the base training"""
    lpips: Annotated[Path | None, Option("FILE")] = None
    """AlexNet LPIPS weights"""
    threads: int = 2
    """threads, 0 = all cores"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(TradeoffTrainOptions, words, "tradeoff train")
    if not options.minutes > 0:
        raise InputError(f"tradeoff train: --minutes {options.minutes:g} is not allowed; allowed: a number > 0")
    if options.iterations is not None and options.iterations < 1:
        raise InputError(f"tradeoff train: --iterations {options.iterations} is not allowed; allowed: an integer >= 1")

    from endotsr.config import PRESETS, config_from_dict
    from endotsr.evaluation.lpips import load_lpips_weights
    from endotsr.kernels.threads import use_threads
    from endotsr.runs.sources import load_sequence
    from endotsr.simulator.settings import SimulatorSettings
    from endotsr.tradeoff.training import run_training_study
    from endotsr.tradeoff.training_text import training_lines

    use_threads(options.threads)
    preset = options.preset or ("demo" if options.sequence == SIMULATED else "paper")
    data = msgspec.to_builtins(PRESETS[preset])
    data["sequence"]["scale"] = options.scale
    refuse_folder(options.out)
    with StepBar("iterations") as bar:
        result = run_training_study(
            options.out / TRAINING,
            config_from_dict(data, "command line"),
            lambda config: load_sequence(options.sequence, config, SimulatorSettings()),
            options.sequence if options.sequence == SIMULATED else Path(options.sequence).resolve().name,
            minutes=options.minutes,
            iterations=options.iterations,
            weights=load_lpips_weights(options.lpips),
            begin=bar.begin,
            step=bar.step,
            say=bar.say,
        )
    print("\n".join(training_lines(result)))
    return 0
