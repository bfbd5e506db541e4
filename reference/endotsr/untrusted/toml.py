"""TOML of settings and sequences: size-limited reading, and writing of plain values."""

import tomllib
from pathlib import Path
from typing import Any

import msgspec

from endotsr.errors import InputError
from endotsr.untrusted.files import read_text
from endotsr.untrusted.json import Keys

LARGEST_FILE = 1 << 20  # bytes


def read_toml(path: Path) -> Keys:
    """The tables of a TOML file, not validated. Raises InputError naming the file."""
    text = read_text(Path(path), LARGEST_FILE)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{path}: not valid TOML: it is nested too deeply") from None
    except ValueError as error:  # invalid TOML, and dates or integers beyond the range of Python
        raise InputError(f"{path}: not valid TOML: {error}") from None


def toml_text(data: Keys) -> str:
    """TOML of plain values and one level of sections. Keys outside a section whose value is None are omitted.

    Keys are bare, and no value inside a section is None.
    """
    lines, sections = [], []
    for key, value in data.items():
        if isinstance(value, dict):
            sections += ["", f"[{key}]", *(f"{k} = {_toml_value(v)}" for k, v in value.items())]
        elif value is not None:
            lines.append(f"{key} = {_toml_value(value)}")
    return "\n".join(lines + sections) + "\n"


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # A JSON string is a valid TOML basic string, except for the character DEL, which TOML wants escaped.
        return msgspec.json.encode(value).decode().replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple):
        return "[\n" + "".join(f"    {_toml_value(row)},\n" for row in value) + "]"  # a matrix: one line per row
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    return repr(value)


def by_key(settings: Any) -> Keys:
    """`section.key` -> value of plain tables, and `key` -> value outside a section. {} for anything else."""
    found = {}
    for name, values in settings.items() if isinstance(settings, dict) else ():
        inside = isinstance(values, dict)
        found |= {f"{name}.{key}": value for key, value in values.items()} if inside else {name: values}
    return found
