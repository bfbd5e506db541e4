"""The files of a measurement, `tradeoff.json` and `training.json`."""

import json
from pathlib import Path
from typing import Any

from endotsr.errors import InputError

FORMAT = 1  # of both; raised when a key changes its name or meaning


def read_result(file: Path) -> dict[str, Any]:
    """A measurement that was written before. Raises InputError if it cannot be read or is of another format."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be read: {error}") from None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise InputError(f"{file}: not a measurement of this version; measure again with another --out")
    return found
