"""`endotsr demo`: the whole method on a simulated sequence."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from endotsr.cli.parts.fields import Option, fields_of
from endotsr.cli.parts.help_page import PART_OF, help_page, terminal_width
from endotsr.cli.parts.parser import HELP_ALL, parse
from endotsr.cli.parts.result import JsonFile
from endotsr.config import DEMO
from endotsr.errors import InputError
from endotsr.training.runs.sources import SIMULATED


@dataclass
class DemoOptions:
    """Simulate a sequence, train on it with the stretched schedule, evaluate, and write a report.

    The same as `endotsr train simulated --preset demo`, with every option of `endotsr train` but those of --windows.
    """

    out: Annotated[Path, Option("RUN")]
    """run folder to create"""
    iterations: Annotated[int, Option("N")] = DEMO.training.iterations
    """exact length of the run; stretches the schedule"""
    scale: float = 1.0
    """scale of the simulated pictures; 1 = 160x128"""
    seed: int = 0
    """random seed"""
    threads: int = 0
    """threads, 0 = all cores"""
    json: JsonFile = None
    """also write the metrics as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.cli import train

    if {"-h", "--help"} & set(words):
        parse(DemoOptions, words, "demo")
    if HELP_ALL in words:
        fields = fields_of(train.TrainOptions, train.TrainOptions(settings=DEMO))
        taken = [f for f in fields if not (f.positional or f.name == "--windows" or f.help.startswith(PART_OF))]
        print(help_page(DemoOptions, taken, "demo", terminal_width()), end="")
        return 0
    words = [SIMULATED, "--preset", "demo", *words]
    if parse(train.TrainOptions, words, "demo").out is None:
        raise InputError("demo: --out RUN is missing: the run folder to create")
    return train.run(words)
