"""`--json FILE`, an option of every command with a result: the result for programs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from endotsr.cli.parts.fields import Option
from endotsr.training.runs.files import write_json
from endotsr.untrusted.marks import GENERATOR

REPLACE = Option(foreign=True)  # of a switch `replace`
JsonFile = Annotated[Path | None, Option("FILE", written=True)]


def write_result(file: Path | None, **result: Any) -> None:
    """Write the result as JSON if a file is given; paths become text, non-finite numbers null."""
    write_marked(file, result)


def write_marked(file: Path | None, result: Mapping[str, Any]) -> None:
    """As `write_result`. The first key says that endotsr wrote the file, which a later command may then replace."""
    if file is not None:
        write_json(file, {**GENERATOR, **result})
