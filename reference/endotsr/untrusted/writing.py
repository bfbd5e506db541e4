"""Atomic writing of files and folders, under unpredictable temporary names that cannot be linked in advance.

In: a path, and a function or block that writes. Out: the file or folder, in place of an older one.
"""

import contextlib
import glob
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from endotsr.errors import InputError
from endotsr.untrusted.files import rename
from endotsr.untrusted.names import plain_line

OF_SYSTEMS = ("thumbs.db", "ehthumbs.db", "desktop.ini", "@eadir")  # written by systems into folders of pictures
MOST_NAMED = 5


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` fill a temporary file in the folder of `path`, then rename it to `path` in one step.

    Raises: OSError of the file system, naming `path` instead of the temporary file.
    """
    temporary = _beside(path)  # keeps the extension, by which writers choose the format
    try:
        write(temporary)
        rename(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):  # a missing parent, or one that is not a folder
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename in (temporary, str(temporary)):
            error.filename = str(path)
        raise


def replace_text(path: Path, text: str) -> None:
    """Replace a text file in one step. Raises OSError as `replace_file`."""
    replace_file(path, lambda temporary: temporary.write_text(text, encoding="utf-8", newline="\n"))


@contextlib.contextmanager
def replacing_folder(path: Path, *, replace: bool = True) -> Iterator[Path]:
    """A temporary folder next to `path`. It is renamed to `path` after the block, or removed if the block fails.

    replace   False: InputError is raised if a folder has appeared at `path` in the meantime; that folder is kept

    The old folder is deleted only after the new one has been renamed.
    """
    if path.is_symlink():
        raise InputError(f"{path}: is a link; allowed: a folder, or a name that is free")
    temporary, old = _beside(path), _beside(path)
    temporary.mkdir()
    try:
        yield temporary
        if not replace and os.path.lexists(path):
            raise InputError(f"{path}: exists already; choose another --out")
        if path.exists():
            rename(path, old)
        rename(temporary, path)
    except BaseException:
        if old.exists() and not path.exists():
            rename(old, path)
        shutil.rmtree(temporary, ignore_errors=True)
        raise
    shutil.rmtree(old, ignore_errors=True)


@contextlib.contextmanager
def new_folder(path: Path, mark: str = "", written: tuple[str, ...] = ()) -> Iterator[Path]:
    """A temporary folder next to `path`. It becomes `path` after the block, or is removed if the block fails.

    mark     an existing folder that contains this file is replaced; "": no folder is replaced
    written  names in such a folder; with any other one it is kept, because that would be lost

    Raises:  InputError if `path` is anything else, or cannot be written.
    """
    if not mark or not path.exists() or (path.is_dir() and not any(path.iterdir())):
        refuse_existing(path)
    elif not (path / mark).is_file() or path.is_symlink():
        raise InputError(f"{path}: is not replaced: it holds no {mark}; choose another --out")
    else:
        _refuse_others(path, (mark, *written))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing_folder(path, replace=bool(mark)) as folder:
            yield folder
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def _refuse_others(path: Path, written: tuple[str, ...]) -> None:
    """Raises InputError for a folder with other entries than these. Files of the system do not count."""
    others = sorted(entry.name for entry in path.iterdir() if entry.name.lower() not in (*written, *OF_SYSTEMS))
    others = [name for name in others if not name.startswith(".")]
    if others:
        more = f" and {len(others) - MOST_NAMED} more" if len(others) > MOST_NAMED else ""
        named = ", ".join(plain_line(name) for name in others[:MOST_NAMED])
        raise InputError(
            f"{path}: is not replaced: it also holds {named}{more}, which would be lost; move it elsewhere, or choose"
            " another --out"
        )


def leftover_notes(path: Path) -> list[str]:
    """A note on folders and files that a killed process left beside `path` in place of writing it."""
    found = sorted(plain_line(file.name) for file in path.parent.glob(f".partial-*-{glob.escape(path.name)}"))
    if not found:
        return []
    return [
        f"{', '.join(found)} in {path.absolute().parent}: left by a command that was stopped while it wrote"
        f" {path.name}; it is not used, and can be deleted if no command writes there now"
    ]


def refuse_existing(path: Path) -> None:
    """Raises InputError if the path exists, unless it is an empty folder, which is removed."""
    if path.is_dir() and not any(path.iterdir()):
        path.rmdir()
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already; choose another --out")


def _beside(path: Path) -> Path:
    return path.with_name(f".partial-{secrets.token_hex(4)}-{path.name}")
