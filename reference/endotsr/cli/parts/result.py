"""`--json FILE`, an option of every command with a result: the result for programs."""

from pathlib import Path
from typing import Annotated, Any

from endotsr.cli.parts.fields import Option
from endotsr.training.runs.files import write_json

JsonFile = Annotated[Path | None, Option("FILE", written=True)]


def write_result(file: Path | None, **result: Any) -> None:
    """Write the result as JSON if a file is given; paths become text, non-finite numbers null."""
    if file is not None:
        write_json(file, result)
