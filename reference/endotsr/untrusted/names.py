"""File names and displayed text that come from a file."""

import os
import re
import unicodedata
from collections.abc import Iterable

from endotsr.errors import INVISIBLE, InputError, visible

LONGEST_NAME = 200  # bytes in UTF-8: file systems allow 255, and suffixes such as `_comparison.png` are appended
ALLOWED = f"use the name of one file, without folders and control characters, at most {LONGEST_NAME} bytes"
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{k}" for port in ("COM", "LPT") for k in "0123456789¹²³")}
SEPARATORS = "/\\"  # of every system: a run folder may be read on another one
DECIMAL_COMMA = re.compile(r"(?:^|[\s;])-?\d+,\d+(?=$|[\s;])", re.MULTILINE)  # 0,25 between spaces or semicolons
REFUSED_ON_WINDOWS = '<>:"|?*'


def counted(count: int, noun: str) -> str:
    """A count with its noun, for a message: `1 frame`, `2 frames`."""
    return f"{count} {noun}{'s' * (count != 1)}"


def choice(words: Iterable[str]) -> str:
    """Alternatives in words: `a`, `a or b`, `one of a, b, c`."""
    listed = list(words)
    return " or ".join(listed) if len(listed) < 3 else f"one of {', '.join(listed)}"


def file_name(name: object, where: str) -> str:
    """`name` if it is a safe name for a file in a folder that the caller chose. Every name from a file passes here.

    where    file and key that contain the name, for the message

    Raises: InputError for anything but text, an empty or hidden name, `..`, an absolute path or any separator, control
            characters, a device name (`NUL`, `con.png`), a final dot or space, and more than 200 bytes. On Windows also
            for a character that its file names cannot have.
    """
    reason = _obstacle(name)
    if reason:
        raise InputError(f"{where}: {shown(name)} {reason}; {ALLOWED}")
    return str(name)


def relative_path(path: object, where: str) -> str:
    """`path` if every part between forward slashes is a safe file name. Such a path cannot leave its folder.

    Raises: InputError as `file_name` does, for the first unsafe part.
    """
    if not isinstance(path, str):
        return file_name(path, where)
    for part in path.split("/"):
        file_name(part, where)
    return path


def _obstacle(name: object) -> str:
    """The reason why this is not a safe file name; empty if it is."""
    if not isinstance(name, str):
        return f"is {type(name).__name__}, not text"
    if any(unicodedata.category(letter) in INVISIBLE for letter in name):
        return "contains a control character"
    if len(name.encode()) > LONGEST_NAME:
        return f"has {len(name.encode())} bytes"
    if any(letter in SEPARATORS for letter in name):
        return "is a path"
    if not name or name.startswith("."):
        return "is empty or begins with a dot"
    if name[-1] in ". ":
        return "ends with a dot or a space"
    if name.split(".")[0].rstrip().upper() in DEVICES:
        return "is the name of a device"
    if os.name == "nt" and any(letter in REFUSED_ON_WINDOWS for letter in name):
        return "contains a character that file names cannot hold here"
    return ""


def shown(value: object, longest: int = 80) -> str:
    """The value in quotation marks for a message: control characters escaped, truncated after `longest` characters."""
    text = repr(value)
    return plain_line(text if len(text) <= longest else f"{text[:longest]}...")


def plain_line(text: str) -> str:
    """`visible` text on one line; every run of spaces, tabs and ends of lines becomes one space."""
    return visible(re.sub(r"[ \t\n\r\f\v]+", " ", text).strip())


def decimal_commas(text: str) -> str:
    """The end of a message about numbers that cannot be read, if they seem to have decimal commas; else nothing."""
    return "; the numbers seem to have decimal commas: write decimal points" if DECIMAL_COMMA.search(text) else ""
