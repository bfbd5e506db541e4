"""The output of `endotsr COMMAND --help`: usage, description, and options by section.

In: the fields of a command and the width of the terminal. Out: text in two columns, like argparse. A name too long for
the first column has its own line.
"""

import inspect
import shutil
import textwrap
from itertools import groupby
from types import NoneType
from typing import Annotated, Any, get_args, get_origin

from endotsr.cli.parts.fields import REQUIRED, Field
from endotsr.untrusted.sections import allowed_values

WIDEST = 120  # maximum characters per line
GAP = 2  # characters between name and help, and before the name
OPTIONS = "options:"
COMMON = (
    ("-h, --help", "print this help; --help-all prints every option"),
    ("-q, --quiet", "print only errors"),
    ("--log-file FILE", "also write the output to a file"),
)  # of every command
FEW_SETTINGS = 12  # up to this number of settings in sections, the short help shows all
OFTEN_SET = (
    "sequence.split",
    "sequence.excluded_value",
    "model.appearance",
    "model.spectral_motion",
    "model.laplacian",
    "loss.lambda_lap",
    "training.precision",
)
PART_OF = "with --windows: "
UNBROKEN = "\u00a0"  # a space without a line break in textwrap


def terminal_width() -> int:
    """Characters per line of help: the width of the terminal, at most WIDEST."""
    return min(shutil.get_terminal_size(fallback=(100, 24)).columns, WIDEST)


def short_fields(fields: list[Field]) -> list[Field]:
    """The options of the short help: all of a command with few settings, else those outside sections and OFTEN_SET.

    The short help omits options that require another one; their help begins with PART_OF.
    """
    settings = [field for field in fields if field.in_section]
    if len(settings) <= FEW_SETTINGS:
        return fields
    alone = [field for field in fields if not field.help.startswith(PART_OF)]
    return [field for field in alone if not field.in_section or field.key in OFTEN_SET]


def help_page(options: type, fields: list[Field], command: str, width: int, hidden: int = 0) -> str:
    """The help of a command in lines of at most `width` characters.

    hidden   number of options omitted from `fields`; the last line explains how to list them
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
    """Title and members of each group: positional arguments, options outside sections, then each section."""
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
    """A name, and its help starting at `column`; a longer name has its own line."""
    lines = textwrap.wrap(text, max(width - column, 20), break_on_hyphens=False) or [""]
    first = " " * GAP + name
    if len(first) + GAP <= column:
        first = f"{first:<{column}}{lines.pop(0)}".rstrip()
    return "\n".join([first, *(" " * column + line for line in lines)]).replace(UNBROKEN, " ")


def _limits(kind: Any) -> str:
    """The range of a number, `a number > 0`; "" without a range. The metavar shows choices."""
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
