"""`--json FILE`, which every command that prints a result has: the same result for programs."""

from pathlib import Path
from typing import Annotated, Any

from endotsr.cli.parts.fields import Option
from endotsr.runs.files import write_json

JsonFile = Annotated[Path | None, Option("FILE", written=True)]


def write_result(file: Path | None, **result: Any) -> None:
    """Write the result as JSON if a file is named; paths become text, and numbers that are not finite null."""
    if file is not None:
        write_json(file, result)
