"""Checkpoints: the whole state of a training in one file, so that a resumed run equals an uninterrupted one bit by bit.

The file is an uncompressed npz without pickle: a JSON header (as bytes) and one entry per array,
`gaussians.<field>`, `first.<field>`, `second.<field>`, `statistics.<field>`, and `frames.<field>` if the model has
parameters of frames. The header lists dtype and shape of every array, so that a missing, foreign or damaged entry is
reported by name. The file is written beside the old one and replaces it by one rename, so that one whole checkpoint
remains at any time.
"""

import json
import os
import zipfile
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.fitting.adam import AdamState
from endotsr.scene.density_control import DensityStatistics
from endotsr.scene.gaussians import Gaussians, arrays
from endotsr.scene.parameters import FrameParameters, trained

FORMAT = "endotsr checkpoint"
VERSION = 1
HEADER = "header"
GROUPS = {"gaussians": Gaussians, "statistics": DensityStatistics, "frames": FrameParameters}
TRAINED = {*Gaussians._fields, *FrameParameters._fields} - {"times"}


class Checkpoint(NamedTuple):
    """State after `iteration`."""

    gaussians: Gaussians
    adam: AdamState
    iteration: int
    rng_state: dict[str, Any]  # of the bit generator, see `restore_rng`
    statistics: DensityStatistics
    header: dict[str, Any]  # entries of the caller: configuration, history
    frames: FrameParameters | None = None  # None if the model has no parameters of frames


def save_checkpoint(
    path: Path,
    gaussians: Gaussians,
    adam: AdamState,
    iteration: int,
    rng_state: dict[str, Any],
    statistics: DensityStatistics,
    header: dict[str, Any],
    frames: FrameParameters | None = None,
) -> None:
    """Write atomically; `rng_state` is `rng.bit_generator.state`, `header` any JSON-able dictionary.

    Raises: OSError if it cannot be written (a full disk); the previous file is then intact and nothing else is left.
    """
    path = Path(path)
    entries = _entries(gaussians, adam, statistics, frames)
    description = {
        "format": FORMAT,
        "version": VERSION,
        "iteration": int(iteration),
        "rng_state": rng_state,
        "steps": adam.step,
        "header": header,
        "arrays": {key: [a.dtype.str, list(a.shape)] for key, a in entries.items()},
    }
    text = np.frombuffer(json.dumps(description).encode(), np.uint8)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(temporary, "wb") as file:
            np.savez(file, allow_pickle=False, **{HEADER: text}, **entries)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _entries(
    gaussians: Gaussians, adam: AdamState, statistics: DensityStatistics, frames: FrameParameters | None
) -> dict[str, NDArray]:
    groups = {
        "gaussians": arrays(gaussians),
        "first": adam.first,
        "second": adam.second,
        "statistics": statistics._asdict(),
        "frames": {} if frames is None else {"times": frames.times} | trained(frames),
    }
    return {f"{group}.{name}": array for group, named in groups.items() for name, array in named.items()}


def load_checkpoint(path: Path) -> Checkpoint:
    """Read and check a checkpoint.

    Raises: InputError naming the file and the key: not a checkpoint, another version, a missing or foreign entry,
            dtype or shape other than the header says, object arrays, damaged or truncated data.
    """
    path = Path(path)
    try:
        opened = np.load(path, allow_pickle=False)
        if not isinstance(opened, np.lib.npyio.NpzFile):
            raise InputError(f"{path}: not a checkpoint but a single array")
        with opened as file:
            description = _read_header(path, file)
            entries = _read_entries(path, file, description["arrays"])
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    except (zipfile.BadZipFile, ValueError, EOFError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not a checkpoint, or cut short: {error}") from None
    return _assemble(path, description, entries)


def _read(path: Path, file: Any, key: str) -> NDArray:
    if key not in file.files:
        raise InputError(f"{path}: {key}: missing")
    try:
        return file[key]
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: {key}: cannot be read: {error}") from None


def _read_header(path: Path, file: Any) -> dict[str, Any]:
    raw = _read(path, file, HEADER)
    try:
        description = json.loads(raw.tobytes())
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: {HEADER}: not JSON: {error}") from None
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise InputError(f"{path}: {HEADER}: not a checkpoint of this program")
    if description.get("version") != VERSION:
        raise InputError(f"{path}: version: {description.get('version')!r}; this program reads {VERSION}")
    kinds = {"iteration": int, "rng_state": dict, "steps": dict, "header": dict, "arrays": dict}
    for key, kind in kinds.items():
        if not isinstance(description.get(key), kind):
            raise InputError(f"{path}: {HEADER}.{key}: {kind.__name__} expected")
    return description


def _read_entries(path: Path, file: Any, listed: dict[str, Any]) -> dict[str, NDArray]:
    foreign = set(file.files) - set(listed) - {HEADER}
    if foreign:
        raise InputError(f"{path}: {min(foreign)}: not listed in the header")
    entries = {}
    for key, expected in listed.items():
        array = _read(path, file, key)
        if [array.dtype.str, list(array.shape)] != expected:
            raise InputError(f"{path}: {key}: {array.dtype.str} {array.shape} found, the header says {expected}")
        entries[key] = array
    return entries


def _assemble(path: Path, description: dict[str, Any], entries: dict[str, NDArray]) -> Checkpoint:
    groups = _grouped(path, entries)
    first, second, steps = groups["first"], groups["second"], description["steps"]
    if not first.keys() == second.keys() == steps.keys():
        raise InputError(f"{path}: steps, first, second: they name different arrays")
    gaussians, adam = Gaussians(**groups["gaussians"]), AdamState(first, second, dict(steps))
    frames = FrameParameters(**groups["frames"]) if groups["frames"] else None
    statistics = DensityStatistics(**groups["statistics"])
    try:
        check_lengths(gaussians, adam, frames)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    if statistics.visits.shape != (gaussians.count,) or statistics.gradient_sum.shape != (gaussians.count,):
        raise InputError(f"{path}: statistics: not one entry for each of {gaussians.count} Gaussians")
    return Checkpoint(
        gaussians, adam, description["iteration"], description["rng_state"], statistics, description["header"], frames
    )


def _grouped(path: Path, entries: dict[str, NDArray]) -> dict[str, dict[str, NDArray]]:
    """Arrays by group and field. Raises InputError for an unknown name or a missing required one."""
    known = {name: set(kind._fields) for name, kind in GROUPS.items()} | {"first": TRAINED, "second": TRAINED}
    groups: dict[str, dict[str, NDArray]] = {name: {} for name in known}
    for key, array in entries.items():
        group, _, name = key.partition(".")
        if name not in known.get(group, ()):
            raise InputError(f"{path}: {key}: not known")
        groups[group][name] = array
    for group, kind in GROUPS.items():
        required = [name for name in kind._fields if name not in kind._field_defaults]
        for name in required if group != "frames" or groups["frames"] else ():
            if name not in groups[group]:
                raise InputError(f"{path}: {group}.{name}: missing")
    return groups


def check_lengths(gaussians: Gaussians, adam: AdamState, frames: FrameParameters | None = None) -> None:
    """Raise ValueError if an array or a moment has not one column for each Gaussian, or for each training frame."""
    for what, named, count in (
        ("Gaussians", arrays(gaussians), gaussians.count),
        ("training frames", trained(frames), 0 if frames is None else frames.times.size),
    ):
        for name, array in named.items():
            moments = {f"first {name}": adam.first.get(name), f"second {name}": adam.second.get(name)}
            for label, found in ({name: array} | moments).items():
                if found is not None and found.shape != (*array.shape[:-1], count):
                    raise ValueError(f"{label}: {found.shape} for {count} {what}")


def restore_rng(state: dict[str, Any]) -> np.random.Generator:
    """The generator in the stored state (PCG64, as made by `np.random.default_rng`)."""
    generator = np.random.default_rng()
    try:
        generator.bit_generator.state = state
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f"rng_state: not the state of a PCG64 generator: {error}") from None
    return generator
