"""The page that `endotsr COMMAND --help` prints: usage, description, and the options by section.

In: the fields of a command and the width of the terminal. Out: text. Two columns, as argparse lays them out; a name
that is too long for the first column has a line of its own.
"""

import inspect
import shutil
import textwrap
from itertools import groupby
from types import NoneType
from typing import Annotated, Any, get_args, get_origin

from endotsr.cli.parts.fields import REQUIRED, Field
from endotsr.config import allowed_values

WIDEST = 120  # characters of a line; longer lines are hard to read on a wide terminal
GAP = 2  # characters between name and help, and before the name
OPTIONS = "options:"
COMMON = (
    ("-h, --help", "print this help; --help-all prints every option"),
    ("-q, --quiet", "print nothing but errors"),
    ("--log-file FILE", "also write everything that is printed to a file"),
)  # of every command
FEW_SETTINGS = 12  # settings of sections up to which the short help shows all of them
OFTEN_SET = (
    "sequence.split",
    "sequence.excluded_value",
    "model.appearance",
    "model.spectral_motion",
    "model.laplacian",
    "loss.lambda_lap",
    "training.precision",
)
PART_OF = "of windows: "
UNBROKEN = "\u00a0"  # a space at which textwrap does not break


def terminal_width() -> int:
    """Characters of a line of help: those of the terminal, at most WIDEST."""
    return min(shutil.get_terminal_size(fallback=(100, 24)).columns, WIDEST)


def short_fields(fields: list[Field]) -> list[Field]:
    """The options that people set: all of a command with few settings, else those outside of sections and OFTEN_SET.

    Options that only mean something beside another one, whose help begins with PART_OF, are left to the whole help.
    """
    settings = [field for field in fields if field.in_section]
    if len(settings) <= FEW_SETTINGS:
        return fields
    alone = [field for field in fields if not field.help.startswith(PART_OF)]
    return [field for field in alone if not field.in_section or field.key in OFTEN_SET]


def help_page(options: type, fields: list[Field], command: str, width: int, hidden: int = 0) -> str:
    """The help of a command, in lines of at most `width` characters.

    hidden   options that are left out of `fields`; the last line says how to see them
    """
    needed = [field for field in fields if field.positional or field.default is REQUIRED]
    usage = " ".join(["endotsr", command, *(_required_name(field) for field in needed), "[OPTIONS]"])
    longest = max(len(_shown_name(field)) for field in fields)
    column = min(longest + 2 * GAP, width // 3)  # where the help begins
    blocks = [f"usage: {usage}"]
    blocks += [textwrap.fill(text, width) for text in (inspect.getdoc(options) or "").split("\n\n")]
    for title, members in _groups(fields, width):
        rows = [_row(name, text, column, width) for name, text in COMMON] if title == OPTIONS else []
        rows += [_row(_shown_name(field), _explained(field), column, width) for field in members]
        blocks.append("\n".join([title, *rows]))
    if hidden:
        blocks.append(f"`endotsr {command} --help-all` lists {hidden} more settings.")
    return "\n\n".join(blocks) + "\n"


def _groups(fields: list[Field], width: int) -> list[tuple[str, list[Field]]]:
    """Title and members: positional arguments, options outside of sections, then one group for each section."""
    arguments = [field for field in fields if field.positional]
    options = [field for field in fields if not field.positional and not field.in_section]
    groups = [("arguments:", arguments)] if arguments else []
    groups.append((OPTIONS, options))
    inside = [field for field in fields if field.in_section]
    for (name, section), members in groupby(inside, key=lambda field: (field.key.rpartition(".")[0], field.section)):
        about = (inspect.getdoc(section) or "").split("\n\n")[0]
        title = textwrap.fill(f"{name}: {' '.join(about.split())}", width, subsequent_indent=" " * GAP)
        groups.append((title, list(members)))
    return groups


def _required_name(field: Field) -> str:
    return field.name if field.positional else f"{field.name} {field.metavar}"


def _shown_name(field: Field) -> str:
    if field.positional:
        return field.name
    if field.switch:
        section, dot, key = field.name.removeprefix("--").rpartition(".")
        return f"--{section}{dot}[no-]{key}"
    return f"{field.name} {field.metavar}"


def _explained(field: Field) -> str:
    details = [text.replace(" ", UNBROKEN) for text in (_limits(field.kind), _default(field)) if text]
    return f"{field.help} ({'; '.join(details)})".lstrip() if details else field.help


def _row(name: str, text: str, column: int, width: int) -> str:
    """A name and its help from `column` on; a longer name has a line of its own."""
    lines = textwrap.wrap(text, max(width - column, 20), break_on_hyphens=False) or [""]
    first = " " * GAP + name
    if len(first) + GAP <= column:
        first = f"{first:<{column}}{lines.pop(0)}".rstrip()
    return "\n".join([first, *(" " * column + line for line in lines)]).replace(UNBROKEN, " ")


def _limits(kind: Any) -> str:
    """The range of a number that has one: `a number > 0`; choices are shown by the metavar."""
    parts = [part for part in get_args(kind) if part is not NoneType] if get_origin(kind) is not Annotated else [kind]
    limited = any(get_origin(part) is Annotated for part in parts)
    return allowed_values(kind) if limited else ""


def _default(field: Field) -> str:
    if field.default is REQUIRED:
        return "required"
    if field.default is None or field.default in ("", ()):
        return ""
    value = field.default
    if isinstance(value, bool):
        return f"default: {str(value).lower()}"
    return f"default: {' '.join(map(str, value)) if isinstance(value, tuple) else value}"
