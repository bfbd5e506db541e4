"""`endotsr gradcheck`: the table of all reverse passes against finite differences."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from endotsr.cli.parts.options import parse


@dataclass
class GradcheckOptions:
    """Check reverse passes in float64 against finite differences; exit code 1 if one does not pass."""

    names: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="[NAME ...]")] = ()
    """stages to check (default: all)"""
    seed: int = 0
    """seed of inputs and directions"""
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """also write the table as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.gradcheck.command import run_gradcheck

    options = parse(GradcheckOptions, words, "gradcheck")
    return run_gradcheck(list(options.names) or None, seed=options.seed, json_path=options.json)
