"""The run folder: settings, input, log, checkpoint and results of one run.

    config.toml      resolved settings; `load_config` reads back an equal Config
    run.json         command, versions, seed, threads, machine, input hashes, times, peak memory, status
    sequence.json    cameras, times, names, split: enough to render without the pictures
    log.jsonl        one line per iteration
    checkpoint.npz   the latest checkpoint; checkpoint.previous.npz is the one before it
    diverged.npz     the state before an iteration that was not finite
    training.html    progress page; redirects to report.html once it exists
    run.lock         empty; locked by the process that trains the run
    evaluate.lock    empty; locked by the process that evaluates the run
    metrics.json  report.html  renders/  test/ours_<iteration>/{renders,gt,masks}/    from `endotsr evaluate`

Folders and files are created and replaced atomically. Resuming truncates the log at the checkpoint. This module handles
file names and JSON; it is independent of models and pictures.
"""

import contextlib
import os
import shlex
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import msgspec

from endotsr.clips.sequences.record import RUN_FILES, SequenceRecord, read_sequence_record
from endotsr.config import Config, config_to_toml, load_config, with_fixed_length
from endotsr.errors import InputError
from endotsr.training.runs.files import os_error_line, read_json, refuse_folder, refuse_link, warn, write_json
from endotsr.training.runs.records import RunRecord, checked_run_record
from endotsr.untrusted.names import plain_line
from endotsr.untrusted.writing import leftover_notes, replacing_folder

EVALUATE_LOCK = "evaluate.lock"
POLL = 0.5  # seconds between two attempts to take a lock


class RunBusy(InputError):
    """Another process holds the lock of a run."""


@dataclass(frozen=True)
class RunFolder:
    """An existing run folder; the module docstring lists its files."""

    path: Path

    @property
    def checkpoint(self) -> Path:
        """The latest checkpoint."""
        return self.path / "checkpoint.npz"

    @property
    def previous(self) -> Path:
        """The checkpoint before the latest one."""
        return self.path / "checkpoint.previous.npz"

    @property
    def has_checkpoint(self) -> bool:
        """Whether there is a checkpoint, the latest or the previous one."""
        return os.path.lexists(self.checkpoint) or self.previous.exists()

    @property
    def log(self) -> Path:
        """One JSON object per iteration."""
        return self.path / "log.jsonl"

    @property
    def lock(self) -> Path:
        """The file that is locked during training."""
        return self.path / "run.lock"

    def config(self) -> Config:
        """The resolved settings of the run. Its length is `training.iterations`, also in runs of earlier versions."""
        return with_fixed_length(load_config(self.path / "config.toml"))

    def record(self, *needed: str) -> RunRecord:
        """run.json, read and checked. Raises InputError if a `needed` key, such as `input.source`, is missing."""
        path = self.path / "run.json"
        return checked_run_record(read_json(path, needed), path)

    def sequence_record(self) -> SequenceRecord:
        """sequence.json, read and checked. Raises InputError as `checked_record`."""
        return read_sequence_record(self.path / "sequence.json")

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the lock of the run for the block. The system releases the lock of a killed process.

        The lock has its own, empty file, because Windows lets no other process read a locked file. On a disk without
        locks it has no effect. Raises: RunBusy, an InputError, if another process holds the lock.
        """
        for file in (self.log, self.lock):
            refuse_link(file)
        with self.lock.open("ab") as file:
            if not lock_taken(file):
                raise RunBusy(f"{self.path}: another process trains this run; wait until it ends, or stop it")
            yield

    @contextlib.contextmanager
    def evaluating(self, *, wait: bool = False) -> Iterator[None]:
        """Hold the lock of the evaluation for the block, as `locked`: two would write the same files in turn.

        wait    wait until the other process ends, in place of RunBusy
        """
        refuse_link(self.path / EVALUATE_LOCK)
        with (self.path / EVALUATE_LOCK).open("ab") as file:
            while not lock_taken(file):
                if not wait:
                    raise RunBusy(f"{self.path}: another process evaluates this run; wait until it ends, or stop it")
                time.sleep(POLL)
            yield

    def remove_leftovers(self) -> list[str]:
        """Remove the temporary files of killed processes. The caller holds both locks. Returns a sentence on them."""
        found = [file for pattern in (".*.part", ".partial-*", "test/.partial-*") for file in self.path.glob(pattern)]
        for file in found:
            folder = file.is_dir() and not file.is_symlink()
            shutil.rmtree(file) if folder else file.unlink(missing_ok=True)
        names = ", ".join(sorted(plain_line(str(file.relative_to(self.path))) for file in found))
        return [f"{self.path}: removed what a stopped command left: {names}"] if found else []

    def update(self, entries: RunRecord) -> None:
        """Add or replace entries of run.json."""
        write_json(self.path / "run.json", {**self.record(), **entries})


def lock_taken(file: IO[bytes]) -> bool:
    """Try to lock an open file; False if another process holds the lock. True on a disk without locks.

    `flock` on POSIX systems, `LockFileEx` on Windows. The system releases the lock with the file or the process.
    """
    from filelock import lock_descriptor

    try:
        return lock_descriptor(file.fileno(), blocking=False)
    except OSError:  # some network disks
        return True


def resume_command(run: Path, options: str = "") -> str:
    """The command that continues a run, as a shell takes it; `options` are those that are no settings of the run."""
    return " ".join(["endotsr train --out", shlex.quote(str(run)), "--resume", *([options] if options else [])])


def refuse_existing(path: Path) -> None:
    """Raises InputError if a new folder cannot be created at `path`, or if something exists there."""
    path = Path(path)
    if (path / "run.json").exists():
        raise InputError(
            f"{path}: already contains a run; choose another --out, or continue it with `{resume_command(path)}`"
        )
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already; choose another --out")
    refuse_folder(path)


def create_run(path: Path, config: Config, record: RunRecord, sequence_record: SequenceRecord) -> RunFolder:
    """Create a run folder under a temporary name, then rename it: it is complete or does not exist.

    Raises:  InputError if `path` exists or on an error of the file system; nothing is left behind.
    """
    path = Path(path)
    refuse_existing(path)
    for note in leftover_notes(path):
        warn(note)
    try:
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
        with replacing_folder(path, replace=False) as folder:
            (folder / "config.toml").write_text(config_to_toml(config), encoding="utf-8", newline="\n")
            write_json(folder / "run.json", record)
            write_json(folder / "sequence.json", msgspec.to_builtins(sequence_record))
            (folder / "log.jsonl").touch()
    except OSError as error:
        raise InputError(os_error_line(error, path)) from None
    return RunFolder(path)


def open_run(path: Path) -> RunFolder:
    """An existing run folder. Raises InputError if there is none."""
    path = Path(path)
    if not all((path / name).is_file() for name in RUN_FILES):
        from endotsr.training.runs.no_run import why_no_run

        raise InputError(f"{path}: {why_no_run(path)}")
    return RunFolder(path)
