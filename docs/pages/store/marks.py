"""Generated parts of a page, between marks `<!-- ROOM:NAME:start -->` and `<!-- ROOM:NAME:end -->`.

The text between two marks is replaced; all other text is written by hand. In a notebook it is a comment.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.untrusted.names import choice
from endotsr.untrusted.writing import replace_file


def write_marked(page: Path, made: Mapping[str, str], room: str) -> None:
    """Rewrite the page atomically, with every part between marks of `room` replaced."""
    text = replaced(page.read_text(encoding="utf-8"), made, page, room)
    replace_file(page, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def replaced(text: str, made: Mapping[str, str], page: Path, room: str) -> str:
    """The text with every part between marks of `room` replaced.

    Raises: InputError with page and mark if a mark has no end or its name is not in `made`.
    """
    for name in re.findall(rf"<!-- {room}:(\w+):start -->", text):
        head, rest = text.split(f"<!-- {room}:{name}:start -->", 1)
        _, end, tail = rest.partition(f"<!-- {room}:{name}:end -->")
        if not end or name not in made:
            raise InputError(f"{page}: mark {room}:{name} has no end or no meaning; use {choice(made)}")
        lines = f"{made[name]}\n{end}"
        if page.suffix == ".py":  # a cell of text of a notebook
            lines = "\n".join(f"# {line}".rstrip() for line in lines.splitlines())
        text = f"{head}<!-- {room}:{name}:start -->\n{lines}{tail}"
    return text


def read_json(path: Path, made_by: str) -> dict[str, Any]:
    """A file of results. Raises: InputError with the file and the command that generates it."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}; made by `{made_by}`") from None
