"""Atomic writing of files and folders, under unpredictable temporary names that cannot be linked in advance.

In: a path, and a function or block that writes. Out: the file or folder, in place of an older one.
"""

import contextlib
import errno
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
FULL = (errno.ENOSPC, errno.EDQUOT)  # errors of a full disk
LINK = "is a link; use a folder, or a name that is free"


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
        _name(error, temporary, path)
        raise


def replace_text(path: Path, text: str) -> None:
    """Replace a text file in one step. Raises OSError as `replace_file`."""
    replace_file(path, lambda temporary: temporary.write_text(text, encoding="utf-8", newline="\n"))


@contextlib.contextmanager
def replacing_folder(path: Path, *, replace: bool = True, then: Callable[[], object] = lambda: None) -> Iterator[Path]:
    """A temporary folder next to `path`. It is renamed to `path` after the block, or removed if the block fails.

    replace   False: InputError is raised if something has appeared at `path` in the meantime, which is kept
    then      called after the renaming, to write what describes the new folder; if it fails or is interrupted, the old
              folder is put back

    The old folder is deleted only after all this. Errors name `path` instead of the temporary folder.
    """
    if path.is_symlink():
        raise InputError(f"{path}: {LINK}")
    temporary, old, placed = _beside(path), _beside(path), False
    try:
        temporary.mkdir()
        yield temporary
        if not replace and os.path.lexists(path):
            raise InputError(f"{path}: exists already; choose another --out")
        if path.exists():
            rename(path, old)
        rename(temporary, path)
        placed = True
        then()
    except BaseException as error:
        if placed or old.exists():
            _put_back(path, temporary, old)
        shutil.rmtree(temporary, ignore_errors=True)
        _name(error, temporary, path)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _put_back(path: Path, temporary: Path, old: Path) -> None:
    """Undo the renamings of `replacing_folder`."""
    if path.exists():
        rename(path, temporary)
    if old.exists():
        rename(old, path)


def _name(error: BaseException, temporary: Path, path: Path) -> None:
    """Let an error name a file or folder as the user knows it, and not the temporary one that took its place."""
    if isinstance(error, InputError):
        error.args = tuple(str(part).replace(str(temporary), str(path)) for part in error.args)
    elif isinstance(error, OSError):
        if error.filename is None and error.errno in FULL:  # of writing to an open file
            error.filename = str(path)
        elif isinstance(error.filename, str | Path):
            error.filename = str(error.filename).replace(str(temporary), str(path))


@contextlib.contextmanager
def new_folder(path: Path, mark: str = "", written: tuple[str, ...] = ()) -> Iterator[Path]:
    """A temporary folder next to `path`. It becomes `path` after the block, or is removed if the block fails.

    mark     an existing folder that contains this file is replaced; "": no folder is replaced
    written  names in such a folder, in lower case; with any other one it is kept, because that would be lost. Hidden
             names (`.NAME`) and files of the system do not count, and are lost

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
    """Raises InputError for a folder with other entries than these, hidden ones and files of the system."""
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


def refuse_existing(path: Path, remedy: str = "") -> None:
    """Raises InputError if the path exists, unless it is an empty folder, which is removed; `remedy` ends its line."""
    if path.is_symlink():
        raise InputError(f"{path}: {LINK}")
    if path.is_dir() and not any(path.iterdir()):
        path.rmdir()
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already; choose another --out{remedy}")


def _beside(path: Path) -> Path:
    return path.with_name(f".partial-{secrets.token_hex(4)}-{path.name}")
