"""The sequence that pictures show: the one of a run, or one that is named with its settings."""

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from endotsr.config import PAPER, Section, SequenceConfig
from endotsr.errors import InputError
from endotsr.runs.folder import open_run

if TYPE_CHECKING:
    from endotsr.sequences.sequence import Sequence


class ShownSettings(Section, frozen=True, kw_only=True):
    """The settings of a sequence, as options `--sequence.scale` and so on."""

    sequence: SequenceConfig = SequenceConfig()


SHOWN = ShownSettings()


def shown_sequence(command: str, run: Path | None, source: str | None, settings: ShownSettings) -> "Sequence":
    """The sequence of `run` (at `source`, if it has moved), or the sequence `source` read with these settings.

    Raises: InputError if neither is named, or if settings are given that the run has fixed.
    """
    from endotsr.runs.sources import load_run_sequence, load_sequence
    from endotsr.simulator.settings import SimulatorSettings

    if run is not None:
        if settings != SHOWN:
            raise InputError(f"{command}: --sequence.* with {run} is not allowed: the settings of a run are fixed")
        return load_run_sequence(open_run(run), source)
    if source is None:
        raise InputError(f"{command}: --sequence is missing: the sequence that the pictures show, or a run folder")
    return load_sequence(source, msgspec.structs.replace(PAPER, sequence=settings.sequence), SimulatorSettings())
