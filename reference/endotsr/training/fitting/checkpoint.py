"""Checkpoints: the complete state of a training in one file; a resumed run is bitwise equal to an uninterrupted one.

The file is an uncompressed npz without pickle: a JSON header (as bytes) and one entry per array,
`gaussians.<field>`, `first.<field>`, `second.<field>`, `statistics.<field>`, and `frames.<field>` if the model has
frame parameters. The header lists dtype, shape and SHA-256 of every array. Missing, foreign and damaged entries are
therefore reported by name.

A new file is written under a temporary name and replaces the old one by one rename. The old file is kept under a second
name (`previous_of`). A complete checkpoint exists at any time after the first. Two different ones exist after the
second, but for the moment between the two renames. If the latest is unreadable, `load_latest` reads its predecessor.
All earlier versions of the format are read (`READERS`).
"""

import contextlib
import hashlib
import json
import os
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.training.fitting.adam import AdamState
from endotsr.training.fitting.checkpoint_values import check_numbers, check_shapes
from endotsr.training.fitting.records import CheckpointHeader, Description, RngState
from endotsr.training.scene.density_control import DensityStatistics
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.training.scene.parameters import FrameParameters, trained
from endotsr.untrusted.arrays import NpzFile, RefusedArray, open_npz
from endotsr.untrusted.files import rename
from endotsr.untrusted.json import parsed
from endotsr.untrusted.names import shown

FORMAT = "endotsr checkpoint"
VERSION = 2
HEADER = "header"
LARGEST = 1 << 36  # bytes: eight million Gaussians of the preset `paper`
MOST_ITERATIONS = 1 << 53
GROUPS = {"gaussians": Gaussians, "statistics": DensityStatistics, "frames": FrameParameters}
TRAINED = {*Gaussians._fields, *FrameParameters._fields} - {"times"}


class DamagedCheckpoint(InputError):
    """A file that is not a complete checkpoint, or that has numbers no training can write."""


class Checkpoint(NamedTuple):
    """State after `iteration`."""

    gaussians: Gaussians
    adam: AdamState
    iteration: int
    rng_state: RngState  # of the bit generator, see `restore_rng`
    statistics: DensityStatistics
    header: CheckpointHeader  # entries of the caller: configuration, history
    frames: FrameParameters | None = None  # None if the model has no frame parameters


def previous_of(path: Path) -> Path:
    """Path of the predecessor of the checkpoint at `path`: `checkpoint.previous.npz` for `checkpoint.npz`."""
    return path.with_name(f"{path.stem}.previous{path.suffix}")


def save_checkpoint(
    path: Path,
    gaussians: Gaussians,
    adam: AdamState,
    iteration: int,
    rng_state: RngState,
    statistics: DensityStatistics,
    header: CheckpointHeader,
    frames: FrameParameters | None = None,
) -> None:
    """Write atomically; `rng_state` is `rng.bit_generator.state`, `header` any JSON-serialisable dictionary.

    An existing checkpoint becomes the previous one; the former previous one is removed.
    Raises: OSError if writing fails (a full disk); both earlier files are then intact and no other file remains.
    """
    path = Path(path)
    entries = _entries(gaussians, adam, statistics, frames)
    description: Description = {
        "format": FORMAT,
        "version": VERSION,
        "iteration": int(iteration),
        "rng_state": rng_state,
        "steps": adam.step,
        "header": header,
        "arrays": {key: [a.dtype.str, list(a.shape), digest(a)] for key, a in entries.items()},
    }
    text = np.frombuffer(json.dumps(description).encode(), np.uint8)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with open(temporary, "xb") as file:
            np.savez(file, allow_pickle=False, **{HEADER: text}, **entries)
            file.flush()
            os.fsync(file.fileno())
        _keep_previous(path)
        rename(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):  # the folder no longer exists
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename in (temporary, str(temporary)):
            error.filename = str(path)
        raise
    _sync_folder(path.parent)


def digest(array: NDArray) -> str:
    """SHA-256 in hex of the bytes of an array in C order."""
    return hashlib.sha256(np.ascontiguousarray(array).data if array.size else b"").hexdigest()


def _keep_previous(path: Path) -> None:
    """Link the checkpoint at `path` to its second name; the new file then replaces the first name."""
    previous = previous_of(path)
    spare = previous.with_name(f".{previous.name}.{secrets.token_hex(4)}.part")
    if not path.is_file():
        return
    try:
        os.link(path, spare)
    except OSError:  # without hard links, the file briefly has only its second name
        rename(path, previous)
        return
    try:
        rename(spare, previous)
    finally:
        spare.unlink(missing_ok=True)  # a rename onto a link to the same file leaves it


def _sync_folder(folder: Path) -> None:
    """Make the new names survive a power failure if the system supports it."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


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


def load_latest(path: Path) -> tuple[Checkpoint, str]:
    """The checkpoint at `path`, or its predecessor if it is damaged; and a message about that, or "".

    Raises: InputError of the checkpoint at `path` if there is no readable predecessor, and for an unknown version.
    """
    previous = previous_of(path)
    if not path.exists() and previous.is_file():  # stopped where the file system has no hard links
        return load_checkpoint(previous), ""
    try:
        return load_checkpoint(path), ""
    except DamagedCheckpoint as damaged:
        try:
            found = load_checkpoint(previous)
        except InputError:
            raise damaged from None
        return found, f"{damaged}; the checkpoint before it is used: {previous.name}, iteration {found.iteration}"


def load_checkpoint(path: Path) -> Checkpoint:
    """Read and check a checkpoint.

    Raises: DamagedCheckpoint with file and key: not a checkpoint, a missing or foreign entry, a dtype, shape or content
            that differs from the header, object arrays, damaged or truncated data, non-finite or out-of-range numbers.
            InputError for an unknown version.
    """
    path = Path(path)
    try:
        with open_npz(path, LARGEST) as file:
            description = _read_header(path, file)
            entries = _read_entries(path, file, description["arrays"])
    except DamagedCheckpoint:
        raise
    except _OtherVersion as error:
        raise InputError(str(error)) from None
    except InputError as error:
        raise DamagedCheckpoint(f"{error}; it is not a checkpoint, or damaged") from None
    return _assemble(path, description, entries)


class _OtherVersion(InputError):
    """A version unknown to this program."""


def _read(path: Path, file: NpzFile, key: str) -> NDArray:
    if key not in file.names:
        raise DamagedCheckpoint(f"{path}: {key}: missing")
    try:
        return file.read(key)
    except RefusedArray as error:
        raise DamagedCheckpoint(f"{path}: {key}: cannot be read: {error}") from None


def _read_header(path: Path, file: NpzFile) -> Description:
    description = parsed(_read(path, file, HEADER).tobytes(), f"{path}: {HEADER}: not JSON")
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise DamagedCheckpoint(f"{path}: {HEADER}: not a checkpoint of this program")
    version = description.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or version not in READERS:
        raise _OtherVersion(f"{path}: version: {version!r}; this program reads {', '.join(map(str, READERS))}")
    kinds = {"iteration": int, "rng_state": dict, "steps": dict, "header": dict, "arrays": dict}
    for key, kind in kinds.items():
        if not isinstance(description.get(key), kind) or isinstance(description[key], bool):
            raise DamagedCheckpoint(f"{path}: {HEADER}.{key}: {kind.__name__} expected")
    for key, count in {"iteration": description["iteration"], **description["steps"]}.items():
        if not isinstance(count, int) or isinstance(count, bool) or not 0 <= count <= MOST_ITERATIONS:
            raise DamagedCheckpoint(f"{path}: {HEADER}: {key} is no number of iterations")
    return READERS[version](cast(Description, description))


def _of_version_1(description: Description) -> Description:
    """Version 1 has no SHA-256 of the arrays; None marks an unknown digest."""
    listed = {k: [*v, None] if isinstance(v, list) else v for k, v in description["arrays"].items()}
    return {**description, "arrays": listed}


def _of_version_2(description: Description) -> Description:
    return description


READERS: dict[int, Callable[[Description], Description]] = {1: _of_version_1, VERSION: _of_version_2}
"""Version -> converter of its header to the present version."""


def _read_entries(path: Path, file: NpzFile, listed: dict[str, list]) -> dict[str, NDArray]:
    foreign = set(file.names) - set(listed) - {HEADER}
    if foreign:
        raise DamagedCheckpoint(f"{path}: {min(foreign)}: not listed in the header")
    entries = {}
    for key, expected in listed.items():
        array = _read(path, file, key)
        if not isinstance(expected, list) or [array.dtype.str, list(array.shape)] != expected[:2]:
            raise DamagedCheckpoint(
                f"{path}: {key}: {array.dtype.str} {array.shape} found, the header says {shown(expected)}"
            )
        if len(expected) != 3 or expected[2] not in (None, digest(array)):
            raise DamagedCheckpoint(f"{path}: {key}: its SHA-256 is not the one in the header")
        entries[key] = array
    return entries


def _assemble(path: Path, description: Description, entries: dict[str, NDArray]) -> Checkpoint:
    groups = _grouped(path, entries)
    first, second, steps = groups["first"], groups["second"], description["steps"]
    if not first.keys() == second.keys() == steps.keys():
        raise DamagedCheckpoint(f"{path}: steps, first, second: they name different arrays")
    gaussians, adam = Gaussians(**groups["gaussians"]), AdamState(first, second, dict(steps))
    frames = FrameParameters(**groups["frames"]) if groups["frames"] else None
    statistics = DensityStatistics(**groups["statistics"])
    try:
        check_shapes(gaussians, adam, frames)
        if statistics.visits.shape != (gaussians.count,) or statistics.gradient_sum.shape != (gaussians.count,):
            raise ValueError(f"statistics: not one entry for each of {gaussians.count} Gaussians")
        if statistics.visits.dtype != np.int64 or statistics.gradient_sum.dtype != np.float64:
            raise ValueError("statistics: use int64 visits and float64 gradient_sum")
        check_numbers(gaussians, adam, statistics, frames)
    except ValueError as error:
        raise DamagedCheckpoint(f"{path}: {error}") from None
    return Checkpoint(
        gaussians, adam, description["iteration"], description["rng_state"], statistics, description["header"], frames
    )


def _grouped(path: Path, entries: dict[str, NDArray]) -> dict[str, dict[str, NDArray]]:
    """Arrays by group and field. Raises DamagedCheckpoint for an unknown name or a missing required one."""
    known = {name: set(kind._fields) for name, kind in GROUPS.items()} | {"first": TRAINED, "second": TRAINED}
    groups: dict[str, dict[str, NDArray]] = {name: {} for name in known}
    for key, array in entries.items():
        group, _, name = key.partition(".")
        if name not in known.get(group, ()):
            raise DamagedCheckpoint(f"{path}: {key}: not known")
        groups[group][name] = array
    for group, kind in GROUPS.items():
        required = [name for name in kind._fields if name not in kind._field_defaults]
        for name in required if group != "frames" or groups["frames"] else ():
            if name not in groups[group]:
                raise DamagedCheckpoint(f"{path}: {group}.{name}: missing")
    return groups


def restore_rng(state: RngState) -> np.random.Generator:
    """The generator in the stored state (PCG64, as made by `np.random.default_rng`)."""
    generator = np.random.default_rng()
    try:
        generator.bit_generator.state = state
    except (ValueError, TypeError, KeyError, OverflowError, AttributeError) as error:
        raise InputError(f"rng_state: not the state of a PCG64 generator: {error}") from None
    return generator
