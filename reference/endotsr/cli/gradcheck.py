"""`endotsr gradcheck`: all reverse passes compared with finite differences."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse


@dataclass
class GradcheckOptions:
    """Compare reverse passes in float64 with finite differences; exit code 1 if a check fails."""

    names: Annotated[tuple[str, ...], Option("[NAME ...]", positional=True)] = ()
    """operations to check (default: all)"""
    seed: int = 0
    """seed of inputs and directions"""
    definition: bool = False
    """check the definition in plain NumPy instead of the compiled functions"""
    json: Annotated[Path | None, Option("FILE")] = None
    """also write the table as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.port.gradcheck.command import run_gradcheck

    options = parse(GradcheckOptions, words, "gradcheck")
    return run_gradcheck(list(options.names) or None, options.seed, options.json, options.definition)
