"""The source of a sequence (a folder or `simulated`) and its record in a run folder."""

import dataclasses
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from endotsr.clips.sequences.sequence import IN_MEMORY, Sequence
from endotsr.clips.sequences.splits import split_frames
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.training.runs.files import refuse_inside
from endotsr.training.runs.folder import RunFolder
from endotsr.training.runs.machine import machine, now, versions
from endotsr.training.runs.records import InputPart, RunRecord
from endotsr.untrusted.sections import checked

if TYPE_CHECKING:
    from endotsr.method.kernels.arrays import FloatArray

SIMULATED = "simulated"  # the simulated sequence; a folder of this name is written `./simulated`
ARRAYS = ("images", "masks", "depth", "times")


def load_sequence(source: str, config: Config, simulator: SimulatorSettings) -> Sequence:
    """The complete sequence, checked, in arrays as in `FrameStore`. Raises InputError for unusable input."""
    if source == SIMULATED:
        return _simulated(simulated_settings(simulator, config), config)
    if source == IN_MEMORY:
        raise InputError("the run was trained on arrays in memory; use a folder with the same frames")
    from endotsr.clips.sequences.read import read_sequence

    return read_sequence(Path(source), config.sequence, config.raster.near)


def _simulated(settings: SimulatorSettings, config: Config) -> Sequence:
    """The simulated sequence with the split of the sequence settings; the default keeps the simulator's split."""
    from endotsr.clips.simulator.simulate import simulate

    wanted = config.sequence
    if wanted.split == "every_eighth":
        return simulate(settings).sequence
    train, test = split_frames(settings.frames, wanted.split, wanted.block_length)  # may raise, so before simulating
    return dataclasses.replace(simulate(settings).sequence, train_index=train, test_index=test)


def simulated_settings(simulator: SimulatorSettings, config: Config) -> SimulatorSettings:
    """The simulator's settings at the scale of the sequence settings. Raises InputError for a choice of frames."""
    wanted = config.sequence
    if wanted.frames:
        raise InputError(
            "simulated: --frames selects files of a folder; use a folder of `endotsr simulate SCENE --frames N`"
        )
    changes = {
        "width": round(simulator.width * wanted.scale),
        "height": round(simulator.height * wanted.scale),
    }
    return checked(msgspec.to_builtins(simulator) | changes, SimulatorSettings, "command line", "simulator.")


def start_record(
    command: list[str], source: str, sequence: Sequence, config: Config, simulator: SimulatorSettings, threads: int
) -> RunRecord:
    """The entries of run.json at the start of a run.

    command   command line of the run, one string per word
    threads   kernel threads in use
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
        "input": input_record(source, sequence, config, simulator),
        "resumed": [],
    }


def input_record(source: str, sequence: Sequence, config: Config, simulator: SimulatorSettings) -> InputPart:
    """The entry `input` of run.json: shape, split, notes of the reader, hashes of arrays and files."""
    record: InputPart = {
        "source": source if source in (SIMULATED, IN_MEMORY) else str(Path(source).resolve()),
        "frames": sequence.count,
        "width": sequence.width,
        "height": sequence.height,
        "training_frames": len(sequence.train_index),
        "held_out_frames": len(sequence.test_index),
        "tissue_fraction": sequence.tissue_fraction,
        "static_camera": sequence.static_camera,
        "notes": list(sequence.notes),
        "arrays_sha256": _digests(sequence),
    }
    if source == SIMULATED:
        record["simulator"] = msgspec.to_builtins(simulator)
    elif source != IN_MEMORY:
        from endotsr.clips.sequences.read import file_hashes

        record["files_sha256"] = file_hashes(Path(source), config.sequence)
    return record


def _digests(sequence: Sequence) -> dict[str, str]:
    """SHA-256 of `ARRAYS` and of the cameras."""
    import numpy as np

    poses = np.array([[*c.rotation.ravel(), *c.translation, c.fx, c.fy, c.cx, c.cy] for c in sequence.cameras])
    return {name: digest(getattr(sequence, name)) for name in ARRAYS} | {"cameras": digest(poses)}


def digest(array) -> str:
    """SHA-256 of the bytes of an array, frame by frame to avoid a copy of a long clip."""
    digest = hashlib.sha256()
    for frame in array:
        digest.update(frame.tobytes())
    return digest.hexdigest()


def check_same_input(run: RunFolder, sequence: Sequence, source: str) -> None:
    """Raises InputError if the sequence differs from the one the run was started on."""
    remembered = run.record().get("input", {}).get("arrays_sha256", {})
    found = _digests(sequence)
    for name in (*ARRAYS, *({"cameras"} & remembered.keys())):
        if remembered.get(name) != found[name]:
            raise InputError(
                f"{source}: {name} differ from those the run {run.path} was trained on (sha256 in run.json); "
                "use the clip as it was then, or a new training"
            )


def run_source(folder: RunFolder) -> tuple[str, SimulatorSettings]:
    """Source and simulator settings of a run's sequence. Raises InputError if run.json lacks the source."""
    record = folder.record("input.source", "input.arrays_sha256").get("input", {})
    where = str(folder.path / "run.json")
    simulator = checked(record.get("simulator", {}), SimulatorSettings, where, "input.simulator.")
    return str(record.get("source")), simulator


def current_source(folder: RunFolder, source: str | None = None) -> tuple[str, SimulatorSettings]:
    """`source`, or without it the recorded location of a run's sequence; and the simulator's settings.

    Raises: InputError if run.json lacks the source, or if nothing is at the recorded location.
    """
    recorded, simulator = run_source(folder)
    if not source and recorded not in (SIMULATED, IN_MEMORY) and not Path(recorded).exists():
        raise InputError(
            f"{recorded}: the clip of the run {folder.path} is no longer there; state its current place: "
            "--sequence SEQUENCE, to continue a training `endotsr train SEQUENCE`"
        )
    return source or recorded, simulator


def refuse_inside_data(out: Path, folder: RunFolder) -> None:
    """Raises InputError if `out` is inside the sequence folder of a run."""
    source = folder.record().get("input", {}).get("source")
    if source not in (None, SIMULATED, IN_MEMORY):
        refuse_inside(out, Path(source), "the sequence of the run,")


def load_run_sequence(folder: RunFolder, source: str | None = None) -> Sequence:
    """The training sequence of a run, read from its recorded location or from `source`.

    Raises: InputError if it cannot be read, or differs from the one the run was trained on.
    """
    source, simulator = current_source(folder, source)
    sequence = load_sequence(source, folder.config(), simulator)
    check_same_input(folder, sequence, source)
    return sequence


def true_positions_of(
    source: str, simulator: SimulatorSettings, config: Config, sequence: Sequence
) -> "Callable[[int, int], FloatArray] | None":
    """The true motion of a simulated sequence, see `SimulatedSequence`; None for other sequences.

    Raises: InputError if the recorded truth of a folder is unusable.
    """
    if source == IN_MEMORY:
        return None
    if source != SIMULATED:
        from endotsr.clips.simulator.recorded import recorded_positions

        return recorded_positions(Path(source), sequence)
    from endotsr.clips.simulator.simulate import simulate

    return simulate(simulated_settings(simulator, config)).true_positions
