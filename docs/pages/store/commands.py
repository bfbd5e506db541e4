"""Commands of the package within a measurement, and what they leave."""

import json
from pathlib import Path
from typing import Any

from endotsr.cli.main import main as endotsr
from endotsr.errors import InputError


def said(*words: object) -> None:
    """Run a command of endotsr in this process. Raises: InputError if it fails."""
    command = [str(word) for word in words]
    print("endotsr", *command, flush=True)
    if endotsr(command) != 0:
        raise InputError(f"failed: endotsr {' '.join(command)}")


def loaded(file: Path) -> dict[str, Any]:
    """A JSON file that a command wrote."""
    return json.loads(file.read_text(encoding="utf-8"))


def held_out(report: Path) -> dict[str, float]:
    """Held-out means of an evaluation, a file of `evaluate --json` or a run folder."""
    return loaded(report / "metrics.json" if report.is_dir() else report)["held_out"]["mean"]
