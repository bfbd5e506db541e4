"""Checks of output paths before a computation, and JSON files."""

import errno
import json
import math
import os
import secrets
import sys
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.untrusted import json as json_files
from endotsr.untrusted.json import Keys
from endotsr.untrusted.marks import refuse_foreign
from endotsr.untrusted.names import choice, plain_line
from endotsr.untrusted.writing import replace_text

OF_A_RUN = frozenset(
    (
        "checkpoint.npz",
        "checkpoint.previous.npz",
        "config.toml",
        "log.jsonl",
        "metrics.json",
        "run.json",
        "sequence.json",
    )
)  # files that commands read again
PAGES = {  # a file that makes its folder one of results, and the names of its pages
    "run.json": ("report.html", "view.html", "training.html"),
    "windows.json": ("report.html", "view.html"),
    "tradeoff.json": ("tradeoff.html",),
}
PAGE_ENDINGS = (".html", ".htm")
ENDINGS = {
    "--json": (".json",),
    "--html": PAGE_ENDINGS,
    "--csv": (".csv",),
    "--draw": PAGE_ENDINGS,
    "--badge": (".svg",),
}  # by option
OF_OTHERS = (".pdf", ".png", ".jpg", ".jpeg", ".webp", ".gif", ".mp4", ".npz", ".npy", ".ply", ".toml")
KNOWN_ENDINGS = frozenset((*OF_OTHERS, *(ending for own in ENDINGS.values() for ending in own)))
HEAD = 4096  # bytes; a zero byte there is the sign of a picture, a video or an array: text in UTF-8 has none


def refuse_folder(path: Path) -> None:
    """Raises InputError if `path` is no folder and cannot be created; leaves nothing behind."""
    if path.is_dir():
        return
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already and is not a folder; choose another --out")
    above = next(parent for parent in path.absolute().parents if parent.exists())
    if not above.is_dir():
        raise InputError(f"{path}: cannot be created: {above} is not a folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be created: no permission to write in {above}")
    probe = above / f".partial-{secrets.token_hex(4)}-{path.name}"
    try:  # permissions do not reveal a read-only disk or /proc; an attempt does
        probe.mkdir()
        probe.rmdir()
    except OSError as error:
        raise InputError(f"{path}: cannot be created: {above}: {error.strerror}") from None


def refuse_inside(path: Path, data: Path, what: str) -> None:
    """Raises InputError if `path` is inside the folder `data`; `what` describes `data` in the message."""
    inner, outer = Path(path).resolve(), Path(data).resolve()
    if outer.is_dir() and inner.is_relative_to(outer):
        raise InputError(f"{path}: is inside {what} {data}; choose an --out outside of it")


def refuse_nested(source: Path, out: Path, written: tuple[str, ...], other: str = "") -> None:
    """Raises InputError if `out` is `source` or inside it, or if `source` would be replaced together with `out`.

    written   names of what is replaced in `out`; `new_folder` refuses a folder with any other name
    other     more advice for a source that would be replaced
    """
    refuse_inside(out, source, "the source")
    inner, outer = Path(source).resolve(), Path(out).resolve()
    if inner.is_relative_to(outer) and inner.relative_to(outer).parts[:1] in [(name,) for name in written]:
        raise InputError(f"{source}: is inside {out}, which would be replaced; choose another --out{other}")


def refuse_link(path: Path) -> None:
    """Raises InputError if `path` is a link, or exists and is no regular file: writing could change another file."""
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise InputError(f"{path}: is a link or no regular file; use the file that the run wrote")


def refuse_unwritable(*files: Path | None) -> None:
    """Raises InputError if one of the files (None = not requested) cannot be written."""
    for file in filter(None, files):
        above = file.parent
        if file.is_dir():
            raise InputError(f"{file}: cannot be written: it is a folder; use the name of a file")
        if not above.is_dir():
            raise InputError(f"{file}: cannot be written: {above} is not a folder; use a file in one that exists")
        # A file is written beside its place and renamed, so its folder has to be writable too.
        if not all(os.access(path, os.W_OK) for path in (above, file) if path.exists()):
            raise InputError(f"{file}: cannot be written: no permission")
        _refuse_input(file)


def refuse_replacing(file: Path, replace: bool, option: str = "") -> None:
    """Raises InputError if a film, an export or a page cannot be written, or would replace a file of the user.

    Commands and Python functions ask here. replace, option: as in `refuse_foreign`
    """
    refuse_unwritable(file)
    refuse_foreign(file, replace, option)


def refuse_no_text(file: Path) -> None:
    """Raises InputError if a file that will contain text exists and is read by commands, or is of another kind."""
    _refuse_input(file)
    if file.is_file():
        with file.open("rb") as stream:
            if b"\0" in stream.read(HEAD):
                raise InputError(f"{file}: would be replaced, but is no text file; use another name")


def refuse_texts(files: dict[str, Path | None]) -> None:
    """Raises InputError if a file of text cannot be written, or two options (the keys) name one file."""
    options: dict[Path, str] = {}
    for option, file in files.items():
        if file is not None:
            refuse_unwritable(file)
            refuse_no_text(file)
            _refuse_other_kind(option, file)
            if options.setdefault(file.resolve(), option) != option:
                raise InputError(f"{option} {file}: is also the file of {options[file.resolve()]}; use another name")


def _refuse_other_kind(option: str, file: Path) -> None:
    """Raises InputError for the ending of another kind of file; one that names no kind, such as `.txt`, is allowed."""
    own, ending = ENDINGS.get(option, ()), file.suffix.lower()
    if own and ending in KNOWN_ENDINGS and ending not in own:
        raise InputError(f"{option} {file}: {ending} is the ending of another kind of file; use {choice(own)}")


def _refuse_input(file: Path) -> None:
    """Raises InputError if this file exists and makes its folder a clip or a run, or is a page of its folder."""
    of_a_run = all((file.parent / name).is_file() for name in ("run.json", "config.toml"))
    for mark, names in PAGES.items():
        if file.is_file() and file.name in names and (file.parent / mark).is_file():
            raise InputError(f"{file}: would be replaced, but belongs to the folder of {mark}; use another name")
    if file.is_file() and (file.name == "sequence.toml" or (of_a_run and file.name in OF_A_RUN)):
        raise InputError(f"{file}: would be replaced, but other commands read it; use another name")


def refuse_read_only(folder: Path) -> None:
    """Raises InputError if no file can be written in an existing folder."""
    if folder.is_dir() and not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{folder}: cannot be written: no permission; use a folder that can be, such as a copy")


def refuse_linked(folder: Path) -> None:
    """Raises InputError for a link in place of a folder that would be replaced."""
    if folder.is_symlink():
        raise InputError(
            f"{folder}: is a link, and only a folder is replaced; put a copy of its folder in its place, or delete the"
            " link"
        )


def write_json(path: Path, data: Any) -> None:
    """Write JSON atomically, with null for every number that is not finite."""
    replace_text(path, json.dumps(finite(data), indent=2, ensure_ascii=False) + "\n")


def read_json(path: Path, needed: tuple[str, ...] = ()) -> Keys:
    """A JSON object. Raises InputError if it cannot be read or lacks a `needed` key, such as "input.source"."""
    data = json_files.read_json(path)
    for dotted in needed:
        value: Any = data
        for key in dotted.split("."):
            if not isinstance(value, dict) or key not in value:
                raise InputError(f"{path}: {dotted} is missing; the file is not as the run wrote it")
            value = value[key]
    return data


def warn(line: str) -> None:
    """Print one line of warning on standard error."""
    print(f"endotsr: warning: {plain_line(line)}", file=sys.stderr, flush=True)


def finite(data: Any) -> Any:
    """Plain data for JSON: paths as text, NumPy values as Python values, None for numbers that are not finite."""
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
    """An error of the file system in one line; `where` replaces a missing file name."""
    place = error.filename or where
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    reason = "the disk is full" if full else error.strerror or str(error)
    return f"{place}: {reason}" if place else reason
