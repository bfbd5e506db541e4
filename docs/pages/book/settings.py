"""Complete the tables of docs/specification/settings.md from `endotsr.config`: python docs/make.py book.settings

A key without a row gets one: its default and meaning as the code has them, and the equation of the first page of the
specification that names it. The page of the objective names the settings of all terms and comes last. Every default is
written again, and the row of a key that is gone is removed.
"""

import re
import sys
from pathlib import Path

import msgspec

from endotsr.cli.parts.fields import Field, fields_of
from endotsr.config import PAPER, Config
from endotsr.untrusted.writing import replace_text

FOLDER = Path(__file__).parents[2] / "specification"
PAGE = FOLDER / "settings.md"
OBJECTIVE = "06_objective"
RULE = "|---|---|---|---|\n"


def equation_of(key: str) -> str:
    """A link to the equation whose page names the key; "-" without one."""
    for page in sorted(FOLDER.glob("[0-9b]*_*.md"), key=lambda page: (page.stem == OBJECTIVE, page.name)):
        text = page.read_text(encoding="utf-8")
        if f"`{key}`" in text and (label := re.search(r"^\$\$ \((eq-\w+)\)$", text, re.MULTILINE)):
            return f"{{eq}}`{label[1]}`"
    return "-"


def value_of(cell: str) -> object:
    """A default as the page shows it; a text stands for itself."""
    try:
        return msgspec.json.decode(cell)
    except msgspec.DecodeError:
        return cell


def row_of(field: Field, stored: dict[str, list[str]]) -> str:
    """The row of a key: the stored one with the default of the code, else a new one."""
    default = list(field.default) if isinstance(field.default, tuple) else field.default
    old, *rest = stored.get(field.key) or ["", field.help, equation_of(field.key)]
    shown = default if isinstance(default, str) and default else msgspec.json.encode(default).decode()
    return f"| {' | '.join((f'`{field.key}`', old if old and value_of(old) == default else shown, *rest))} |\n"


def completed(text: str) -> str:
    """The page with one row per key, in the order of the code."""
    stored = {
        key: [default, *rest]
        for key, default, *rest in re.findall(r"^\| `(\S+)` \| (.*?) \| (.*) \| (\S+) \|$", text, re.MULTILINE)
    }
    for section in Config.__struct_fields__:
        rows = "".join(row_of(f, stored) for f in fields_of(Config, PAPER) if f.key.startswith(f"{section}."))
        head, mark, tail = text.partition(f"## `{section}`\n\n| Key | Default | Meaning | Equation |\n{RULE}")
        text = text if not mark else head + mark + rows + re.sub(r"^(?:\|.*\n)*", "", tail, count=1)
    return text


def main(words: list[str]) -> None:
    """The command."""
    if words:
        sys.exit(__doc__)
    replace_text(PAGE, completed(PAGE.read_text(encoding="utf-8")))
