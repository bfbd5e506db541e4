"""Names from a file that become the name of a file, and text from a file that a terminal shows."""

import os
import re
import unicodedata

from endotsr.errors import INVISIBLE, InputError, visible

LONGEST_NAME = 200  # bytes in UTF-8: file systems allow 255, and endings such as `_comparison.png` are appended
ALLOWED = f"allowed: the name of one file, without folders and control characters, at most {LONGEST_NAME} bytes"
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{k}" for port in ("COM", "LPT") for k in "0123456789¹²³")}
SEPARATORS = "/\\"  # of any system: a run folder may be read on another one
REFUSED_ON_WINDOWS = '<>:"|?*'


def file_name(name: object, where: str) -> str:
    """`name` if it can be the name of a file in the folder that the caller chose; every name from a file passes here.

    where    the file and the key that hold the name, for the message

    Raises: InputError for anything but text, for an empty or a hidden name, `..`, an absolute path or any separator,
            control characters, a name of a device (`NUL`, `con.png`), a final dot or space, and over 200 bytes.
    """
    reason = _obstacle(name)
    if reason:
        raise InputError(f"{where}: {shown(name)} {reason}; {ALLOWED}")
    return str(name)


def relative_path(path: object, where: str) -> str:
    """`path` if every part of it, between forward slashes, can be the name of a file: it cannot leave its folder.

    Raises: InputError as `file_name` does for the first part that cannot.
    """
    if not isinstance(path, str):
        return file_name(path, where)
    for part in path.split("/"):
        file_name(part, where)
    return path


def _obstacle(name: object) -> str:
    """The reason why this is no name of a file; empty if it is one."""
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
    """The value in quotation marks for a message: control characters as escapes, cut after `longest` letters."""
    text = repr(value)
    return plain_line(text if len(text) <= longest else f"{text[:longest]}...")


def plain_line(text: str) -> str:
    """Text on one line, `visible`; every run of spaces, tabs and ends of lines becomes one space."""
    return visible(re.sub(r"[ \t\n\r\f\v]+", " ", text).strip())
