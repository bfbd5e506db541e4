"""Folders and files of a sequence that appear whole or not at all."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from endotsr.errors import InputError


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A temporary folder beside `path` that becomes `path` after the block, or vanishes if the block fails.

    Raises:  InputError if `path` exists already or cannot be made.
    """
    refuse_existing(path)
    temporary = path.with_name(f".partial-{os.getpid()}-{path.name}")
    shutil.rmtree(temporary, ignore_errors=True)
    try:
        temporary.mkdir(parents=True)
        yield temporary
        os.rename(temporary, path)
    except OSError as error:
        shutil.rmtree(temporary, ignore_errors=True)
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


@contextmanager
def replaced_folder(path: Path, mark: str) -> Iterator[Path]:
    """As `new_folder`, for a folder that may exist: it stays until the block is done, and goes then.

    mark   a file that a folder of this program holds

    Raises:  InputError if something else is there.
    """
    if not path.exists():
        with new_folder(path) as folder:
            yield folder
        return
    if not (path / mark).is_file() or path.is_symlink():
        raise InputError(f"{path}: is not replaced: it holds no {mark}; choose another --out")
    old = path.with_name(f".old-{os.getpid()}-{path.name}")
    fresh = path.with_name(f".fresh-{os.getpid()}-{path.name}")
    with new_folder(fresh) as folder:
        yield folder
    os.rename(path, old)
    os.rename(fresh, path)
    shutil.rmtree(old, ignore_errors=True)


def refuse_existing(path: Path) -> None:
    """Raises InputError if something is there, unless it is an empty folder."""
    if path.is_dir() and not any(path.iterdir()):
        path.rmdir()
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already; choose another --out")


def replace_text(path: Path, text: str) -> None:
    """Replace a text file in one step."""
    temporary = path.with_name(f".partial-{os.getpid()}-{path.name}")
    try:
        temporary.write_text(text, encoding="utf-8", newline="\n")
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
