"""The types of run.json, which is untrusted input.

Every present key must have the type and range below. Any key may be missing, because earlier versions wrote fewer;
`RunFolder.record` checks for those that a reader needs.
"""

from pathlib import Path
from typing import Annotated, TypedDict, cast

import msgspec

from endotsr.training.runs.machine import MachinePart
from endotsr.untrusted.json import Count, Fraction, Keys, Side, Text, typed

Seconds = Annotated[float, msgspec.Meta(ge=0, le=1e12)]


class InputPart(TypedDict, total=False):
    """The entry `input` of run.json."""

    source: Text
    frames: Count
    width: Side
    height: Side
    training_frames: Count
    held_out_frames: Count
    tissue_fraction: Fraction
    static_camera: bool
    notes: list[Text]
    arrays_sha256: dict[Text, Text]
    files_sha256: dict[Text, Text]
    simulator: Keys


class ResumedEntry(TypedDict, total=False):
    """One entry of `resumed`."""

    after_iteration: Count
    started: Text
    threads: Count


class ExtendedEntry(TypedDict, total=False):
    """One entry of `extended`."""

    iterations: Count
    before: Count
    time: Text


class StartPart(TypedDict, total=False):
    """The entry `start` of run.json, for a run that began with the state of another run."""

    configuration: Text  # in a sweep: the configuration and iteration of the initial state
    iteration: Count
    carried_from: Text  # in a recording: the neighbouring window
    shared_frames: Count
    iterations_saved: Count


class RunRecord(TypedDict, total=False):
    """run.json."""

    status: Text | None
    command: list[Text]
    started: Text | None
    finished: Text | None
    seconds: Seconds
    iterations_done: Count | None
    lambda_lap: Annotated[float, msgspec.Meta(ge=0, le=1e30)] | None
    peak_memory_bytes: Count | None
    seed: Count | None
    threads: Count | None
    versions: dict[Text, Text]
    machine: MachinePart
    input: InputPart
    resumed: list[ResumedEntry]
    extended: list[ExtendedEntry]
    start: StartPart
    effects: Keys  # verdicts and plan of `--effects auto`


REPORTED = (
    *(f"input.{key}" for key in ("source", "frames", "width", "height", "training_frames", "held_out_frames")),
    *("input.tissue_fraction", "input.notes", "input.arrays_sha256", "versions", "seconds"),
    *(f"machine.{key}" for key in ("processor", "cores", "memory_bytes", "system")),
)
"""Keys of run.json that a report needs."""


def checked_run_record(record: Keys, path: Path) -> RunRecord:
    """The checked content of run.json. Raises InputError naming file and key for a wrong type or range."""
    typed(record, RunRecord, path)
    return cast(RunRecord, record)  # keeps the keys of other versions
