"""Folders of a sequence that appear whole or not at all, with errors of one line."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from endotsr.errors import InputError
from endotsr.untrusted.writing import replacing_folder


@contextmanager
def new_folder(path: Path, mark: str = "") -> Iterator[Path]:
    """A temporary folder beside `path` that becomes `path` after the block, or vanishes if the block fails.

    mark     a file that a folder of this program holds: such a folder is replaced; "" = none is

    Raises:  InputError if something else is there, or if it cannot be written.
    """
    if not mark or not path.exists():
        refuse_existing(path)
    elif not (path / mark).is_file() or path.is_symlink():
        raise InputError(f"{path}: is not replaced: it holds no {mark}; choose another --out")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing_folder(path, replace=bool(mark)) as folder:
            yield folder
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def refuse_existing(path: Path) -> None:
    """Raises InputError if something is there, unless it is an empty folder."""
    if path.is_dir() and not any(path.iterdir()):
        path.rmdir()
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already; choose another --out")
