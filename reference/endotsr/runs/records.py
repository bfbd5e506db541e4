"""run.json: at the start of a run, and what that of another person may say.

Every key that is there must have the type and the range below. A key may be missing: whoever needs it names it
(`RunFolder.record`), because earlier versions wrote fewer.
"""

from pathlib import Path
from typing import Annotated, Any

import msgspec

from endotsr.config import Config
from endotsr.runs.machine import machine, now, versions
from endotsr.untrusted.json import Count, Fraction, Side, Text, typed

Seconds = Annotated[float, msgspec.Meta(ge=0, le=1e12)]


class _Part(msgspec.Struct, kw_only=True):
    """Part of a record; keys that are not listed are left alone."""


class InputPart(_Part, kw_only=True):
    """`input` of run.json."""

    source: Text | msgspec.UnsetType = msgspec.UNSET
    frames: Count | msgspec.UnsetType = msgspec.UNSET
    width: Side | msgspec.UnsetType = msgspec.UNSET
    height: Side | msgspec.UnsetType = msgspec.UNSET
    training_frames: Count | msgspec.UnsetType = msgspec.UNSET
    held_out_frames: Count | msgspec.UnsetType = msgspec.UNSET
    tissue_fraction: Fraction | msgspec.UnsetType = msgspec.UNSET
    static_camera: bool | msgspec.UnsetType = msgspec.UNSET
    notes: list[Text] = []
    arrays_sha256: dict[Text, Text] = {}
    files_sha256: dict[Text, Text] = {}
    simulator: dict[str, Any] = {}


class MachinePart(_Part, kw_only=True):
    """`machine` of run.json."""

    processor: Text | msgspec.UnsetType = msgspec.UNSET
    cores: Count | msgspec.UnsetType = msgspec.UNSET
    memory_bytes: Count | None = None
    system: Text | msgspec.UnsetType = msgspec.UNSET


class RunRecord(_Part, kw_only=True):
    """run.json."""

    status: Text | None = None
    command: list[Text] = []
    started: Text | None = None
    finished: Text | None = None
    seconds: Seconds = 0.0
    iterations_done: Count | None = None
    lambda_lap: Annotated[float, msgspec.Meta(ge=0, le=1e30)] | None = None
    peak_memory_bytes: Count | None = None
    seed: Count | None = None
    threads: Count | None = None
    versions: dict[Text, Text] = {}
    machine: MachinePart = msgspec.field(default_factory=MachinePart)
    input: InputPart = msgspec.field(default_factory=InputPart)
    resumed: list[dict[str, Any]] = []


REPORTED = (
    *(f"input.{key}" for key in ("source", "frames", "width", "height", "training_frames", "held_out_frames")),
    *("input.tissue_fraction", "input.notes", "input.arrays_sha256", "versions", "seconds"),
    *(f"machine.{key}" for key in ("processor", "cores", "memory_bytes", "system")),
)
"""Keys of run.json that a report needs."""


def new_record(command: list[str], config: Config, threads: int, source: dict[str, Any]) -> dict[str, Any]:
    """The entries of run.json at the start of a run.

    command   command line of the run, one string a word
    threads   kernel threads in use
    source    `input_record` of the sequence
    """
    return {
        "status": "running",
        "command": command,
        "started": now(),
        "finished": None,
        "seconds": 0.0,
        "iterations_done": 0,
        "lambda_lap": None,
        "peak_memory_bytes": None,
        "seed": config.training.seed,
        "threads": threads,
        "versions": versions(),
        "machine": machine(),
        "input": source,
        "resumed": [],
    }


def check_run_record(record: dict[str, Any], path: Path) -> None:
    """Raises InputError naming file and key if run.json holds a value of another type or range."""
    typed(record, RunRecord, path)
