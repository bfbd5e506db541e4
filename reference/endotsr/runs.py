"""The run folder: everything that says what was run, on what, how it went and what came out.

    config.toml      resolved settings; `load_config` reads back an equal Config
    run.json         command, versions, seed, threads, machine, input hashes, times, peak memory, status
    sequence.json    cameras, times, names, split: what rendering needs when the pictures are elsewhere
    log.jsonl        one line an iteration
    checkpoint.npz   the latest checkpoint
    metrics.json  report.html  renders/  test/ours_<iteration>/{renders,gt,masks}/    from `endotsr evaluate`

A run folder appears complete under its name or not at all, files are replaced whole, and a log that is resumed
is cut at the checkpoint. Knows file names and JSON; knows nothing of models or pictures.
"""

import contextlib
import datetime
import errno
import importlib.metadata
import json
import math
import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from endotsr import __version__
from endotsr.config import Config, config_to_toml, load_config
from endotsr.errors import InputError

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "opencv-contrib-python-headless", "scikit-image", "msgspec")


@dataclass(frozen=True)
class RunFolder:
    """A run folder that exists; see the module docstring for its files."""

    path: Path

    @property
    def checkpoint(self) -> Path:
        """The latest checkpoint."""
        return self.path / "checkpoint.npz"

    @property
    def log(self) -> Path:
        """One JSON object an iteration."""
        return self.path / "log.jsonl"

    def config(self) -> Config:
        """The resolved settings of the run."""
        return load_config(self.path / "config.toml")

    def record(self, *needed: str) -> dict[str, Any]:
        """run.json as it is now. Raises InputError if one of the `needed` keys (`input.source`) is not there."""
        return _read_json(self.path / "run.json", needed)

    def sequence_record(self, *needed: str) -> dict[str, Any]:
        """sequence.json. Raises InputError if one of the `needed` keys is not there."""
        return _read_json(self.path / "sequence.json", needed)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Inside, this process alone trains the run; the system lets go of the lock of a process that was killed.

        Raises: InputError if another process holds it. Without effect where the system or the disk knows no locks.
        """
        with self.log.open("ab") as file:
            _lock(file, self.path)
            yield

    def remove_leftovers(self) -> None:
        """Temporary files of a process that was killed."""
        for pattern in (".*.part", ".partial-*"):
            for file in self.path.glob(pattern):
                shutil.rmtree(file) if file.is_dir() else file.unlink(missing_ok=True)

    def update(self, **entries: Any) -> None:
        """Replace or add entries of run.json."""
        write_json(self.path / "run.json", self.record() | entries)


def _lock(file: IO[bytes], path: Path) -> None:
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"{path}: another process trains this run; let it end, or stop it") from None
    except OSError:
        return


def refuse_existing(path: Path) -> None:
    """Raises InputError if a new folder cannot be made here: something exists, or its parent takes no folder."""
    path = Path(path)
    if (path / "run.json").exists():
        raise InputError(
            f"{path}: holds a run already; choose another --out, or continue it with "
            f"`endotsr train --out {path} --resume`"
        )
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already; choose another --out")
    refuse_folder(path)


def refuse_folder(path: Path) -> None:
    """Raises InputError if this is no folder and cannot become one; makes nothing."""
    if path.is_dir():
        return
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already and is not a folder; choose another --out")
    above = next(parent for parent in path.absolute().parents if parent.exists())
    if not above.is_dir():
        raise InputError(f"{path}: cannot be created: {above} is not a folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be created: no permission to write in {above}")


def refuse_unwritable(*files: Path | None) -> None:
    """Raises InputError if one of the files (None = not asked for) cannot be written; called before the work."""
    for file in filter(None, files):
        above = file.parent
        if file.is_dir():
            raise InputError(f"{file}: cannot be written: it is a folder; allowed: the name of a file")
        if not above.is_dir():
            raise InputError(f"{file}: cannot be written: {above} is not a folder; allowed: a file in one that exists")
        if not os.access(file if file.exists() else above, os.W_OK):
            raise InputError(f"{file}: cannot be written: no permission")


def create_run(path: Path, config: Config, record: dict[str, Any], sequence_record: dict[str, Any]) -> RunFolder:
    """A new run folder, filled beside its final name and then renamed: it never exists half-written.

    Raises:  InputError if `path` exists or the file system refuses (nothing stays behind).
    """
    path = Path(path)
    refuse_existing(path)
    try:
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
        with replacing_folder(path) as folder:
            (folder / "config.toml").write_text(config_to_toml(config), encoding="utf-8")
            write_json(folder / "run.json", record)
            write_json(folder / "sequence.json", sequence_record)
            (folder / "log.jsonl").touch()
    except OSError as error:
        raise InputError(os_error_line(error, path)) from None
    return RunFolder(path)


def open_run(path: Path) -> RunFolder:
    """An existing run folder. Raises InputError if there is none."""
    path = Path(path)
    if not path.is_dir():
        raise InputError(f"{path}: run folder not found")
    for name in ("config.toml", "run.json", "sequence.json"):
        if not (path / name).is_file():
            raise InputError(f"{path}: not a run folder: {name} is missing")
    return RunFolder(path)


class RunLog:
    """log.jsonl opened for appending after iteration `kept`; later and broken lines are cut off first."""

    def __init__(self, path: Path, kept: int) -> None:
        self.seconds = 0.0  # sum over the kept lines
        self._end = self._cut(path, kept)
        self._file: IO[bytes] = path.open("ab")

    def _cut(self, path: Path, kept: int) -> int:
        end = 0
        if path.exists():
            with path.open("r+b") as file:
                for line in file:
                    entry = _entry(line)
                    if entry is None or entry["iteration"] > kept:
                        break
                    end += len(line)
                    self.seconds += entry.get("seconds") or 0.0
                file.truncate(end)
        return end

    def append(self, entry: dict[str, Any]) -> None:
        """One line, flushed. On an error of the file system the log keeps its last whole line."""
        line = (json.dumps(_finite(entry), separators=(", ", ": ")) + "\n").encode()
        try:
            self._file.write(line)
            self._file.flush()
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file.fileno(), self._end)
            raise
        self._end += len(line)

    def close(self) -> None:
        """Close the file; what it could not take is dropped."""
        with contextlib.suppress(OSError):
            self._file.close()


def _entry(line: bytes) -> dict[str, Any] | None:
    with contextlib.suppress(ValueError):
        entry = json.loads(line)
        if line.endswith(b"\n") and isinstance(entry, dict) and "iteration" in entry:
            return entry
    return None


def write_json(path: Path, data: Any) -> None:
    """JSON with numbers that are not finite as null, replaced whole."""
    text = json.dumps(_finite(data), indent=2, ensure_ascii=False) + "\n"
    replace_file(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file beside `path`, then put it in place of `path` in one step.

    Raises: OSError of the file system, with `path` in place of the temporary name, which nobody gave.
    """
    temporary = path.with_name(f".partial-{path.name}")  # keeps the ending, which writers look at
    try:
        write(temporary)
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):  # of a folder that is missing or is none
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename in (temporary, str(temporary)):
            error.filename = str(path)
        raise


@contextlib.contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """A temporary folder beside `path` that takes its place when the block ends well, and vanishes otherwise."""
    temporary = path.with_name(f".partial-{os.getpid()}-{path.name}")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    try:
        yield temporary
        if path.exists():
            shutil.rmtree(path)
        os.rename(temporary, path)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def _read_json(path: Path, needed: tuple[str, ...] = ()) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path}: holds {type(data).__name__}; allowed: an object with keys, as the run wrote it")
    for dotted in needed:
        value: Any = data
        for key in dotted.split("."):
            if not isinstance(value, dict) or key not in value:
                raise InputError(f"{path}: {dotted} is missing; the file is not as the run wrote it")
            value = value[key]
    return data


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if isinstance(data, Path):
        return str(data)
    if hasattr(data, "tolist"):  # NumPy scalars and arrays
        return _finite(data.tolist())
    return None if isinstance(data, float) and not math.isfinite(data) else data


def os_error_line(error: OSError, where: object = None) -> str:
    """One line for what the file system refused; `where` stands in for a file that the error does not name."""
    place = error.filename or where
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    reason = "the disk is full" if full else error.strerror or str(error)
    return f"{place}: {reason}" if place else reason


def versions() -> dict[str, str]:
    """Versions of this package, Python and the libraries that numbers depend on."""
    found = {"endotsr": __version__, "python": platform.python_version()}
    for name in LIBRARIES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def machine() -> dict[str, Any]:
    """Processor, cores this process may use, memory and system, as far as the system tells."""
    processor = platform.processor() or platform.machine()
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                processor = line.split(":", 1)[1].strip()
                break
    memory = None
    with contextlib.suppress(AttributeError, ValueError, OSError):
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"processor": processor, "cores": cores, "memory_bytes": memory, "system": platform.platform()}


def peak_memory_bytes() -> int | None:
    """Largest resident memory of this process so far; None where the system does not tell."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def now() -> str:
    """The time in UTC, to the second."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
