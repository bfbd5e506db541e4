"""Files that are replaced whole, and checks of output paths before the work begins."""

import contextlib
import errno
import json
import math
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from endotsr.errors import InputError


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
    """Raises InputError if one of the files (None = not requested) cannot be written; called before the work."""
    for file in filter(None, files):
        above = file.parent
        if file.is_dir():
            raise InputError(f"{file}: cannot be written: it is a folder; allowed: the name of a file")
        if not above.is_dir():
            raise InputError(f"{file}: cannot be written: {above} is not a folder; allowed: a file in one that exists")
        if not os.access(file if file.exists() else above, os.W_OK):
            raise InputError(f"{file}: cannot be written: no permission")


def write_json(path: Path, data: Any) -> None:
    """Write JSON with null for every number that is not finite; the file is replaced whole."""
    text = json.dumps(finite(data), indent=2, ensure_ascii=False) + "\n"
    replace_file(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file beside `path`, then put it in place of `path` in one step.

    Raises: OSError of the file system, with `path` in place of the temporary name.
    """
    temporary = path.with_name(f".partial-{path.name}")  # keeps the ending, by which writers choose the format
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
    """A temporary folder beside `path` that is renamed to `path` after the block, or removed if the block fails."""
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


def read_json(path: Path, needed: tuple[str, ...] = ()) -> dict[str, Any]:
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


def finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [finite(value) for value in data]
    if isinstance(data, Path):
        return str(data)
    if hasattr(data, "tolist"):  # NumPy scalars and arrays
        return finite(data.tolist())
    return None if isinstance(data, float) and not math.isfinite(data) else data


def os_error_line(error: OSError, where: object = None) -> str:
    """One line for an error of the file system; `where` is used if the error names no file."""
    place = error.filename or where
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    reason = "the disk is full" if full else error.strerror or str(error)
    return f"{place}: {reason}" if place else reason
