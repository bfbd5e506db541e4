"""The marks by which endotsr recognises a file that it wrote, and may replace without being asked.

In: the path of a file. Out: whether its content has the mark that endotsr writes into files of this kind. The name of a
file says nothing about its origin. Films, exports and pages have a mark. The tables of a sweep have none: their folder
shows their origin. A text such as `--json FILE` has none either, and replaces any other text.
"""

import io
import zipfile
from pathlib import Path
from typing import IO, Any

from endotsr.errors import InputError

GENERATOR = {"generator": "endotsr"}  # of a glTF file
HTML = '<meta name="generator" content="endotsr">'
FILM = "film of endotsr"  # the comment of a film
SLIM = "endotsr slim model"  # the format of a slim model, in its header
HEAD = 1 << 14  # bytes; every mark but those of .mp4 and .npz stands in them
LONGEST = 1 << 26  # bytes, of the index of an .mp4 film
JSON_MARK = b'"generator": "endotsr"'
MARKS = (  # beginning of a file, and its mark
    (b"ply\n", b"\ncomment endotsr "),
    (b"glTF", JSON_MARK),
    (b"<!doctype html>", HTML.encode()),
    (b"GIF8", FILM.encode()),
    (b"\x1aE\xdf\xa3", FILM.encode()),  # WebM
)


def own(file: Path) -> bool:
    """Whether the file is empty, or has the mark of a file that endotsr wrote. Raises OSError if it cannot be read."""
    with file.open("rb") as stream:
        head = stream.read(HEAD)
        stream.seek(0)
        if head.startswith(b"PK\x03\x04"):
            return _is_slim(stream)
        if head[4:8] == b"ftyp":
            return FILM.encode() in _index(stream)
    return not head or any(head.startswith(start) and mark in head for start, mark in MARKS)


def refuse_foreign(
    file: Path | None, replace: bool | None = None, option: str = "", beside: Path | None = None
) -> None:
    """Raises InputError for an existing file that endotsr did not write. Every command and function asks here.

    replace   whether the caller may replace it; None if the caller has no such option
    option    of the command that names the file, for the message; empty in Python
    beside    for a file in a folder of results, which the user cannot name: the record or folder that endotsr creates
              before it. Where this exists, endotsr wrote the file too
    """
    if file is None or replace or not (file.is_file() or file.is_dir()) or (beside is not None and beside.exists()):
        return
    try:
        found = own(file)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
    if not found:
        named = f"{option} {file}".lstrip()
        permission = ", or --replace" if option else ", or replace=True"
        other = "use another name" if beside is None else "choose another --out"
        remedy = other + ("" if replace is None else permission)
        raise InputError(f"{named}: exists already, and does not show that endotsr wrote it; {remedy}")


def _is_slim(stream: IO[bytes]) -> bool:
    """Whether an .npz file is a slim model. A checkpoint is none: it is not written anew by a command that exports."""
    try:
        with zipfile.ZipFile(stream) as found, found.open("header.npy") as header:
            return f'"format": "{SLIM}"'.encode() in header.read(HEAD)
    except (zipfile.BadZipFile, KeyError, NotImplementedError, EOFError, RuntimeError, ValueError, OSError):
        return False


def _index(stream: IO[Any]) -> bytes:
    """The box `moov` of an .mp4 file, which holds its comment; empty if there is none."""
    place, end = 0, stream.seek(0, io.SEEK_END)
    while place + 8 <= end:
        stream.seek(place)
        head = stream.read(16)
        size, kind = int.from_bytes(head[:4]), head[4:8]
        size = int.from_bytes(head[8:16]) if size == 1 else size or end - place
        if kind == b"moov":
            stream.seek(place)
            return stream.read(min(size, LONGEST))
        if size < 8:
            return b""
        place += size
    return b""
