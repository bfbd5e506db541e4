"""Quantities as text, and tables of them in three forms: aligned text, Markdown, HTML.

In: column heads, and rows whose cells are text already; for HTML, the cells are HTML already. Out: one string.
"""

import html
import re
from collections.abc import Iterable, Sequence

LONGEST_VALUE = 32  # characters of a cell that stands on one line
FEW = 6  # columns after the first of a table that does not scroll on a telephone
# Pixels of such a row, of the edges of a cell, of a letter of a cell and of a head (`report.parts.STYLE`, at 390 px).
ROW, EDGES, LETTER, HEAD_LETTER = 355, 10, 7.9, 7.4


def duration(seconds: float) -> str:
    """1:02:03 or 2:03."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def memory(found: int | None) -> str:
    """Bytes of memory as text; "memory not known" where the system does not report them."""
    return f"{found / 1e9:.2f} GB" if found else "memory not known"


def fixed(value: float | None, digits: int, sign: str = "") -> str:
    """A number with fixed decimals, "-" without a value. sign = "+" shows the sign of every number."""
    return "-" if value is None else f"{value:{sign}.{digits}f}"


def plain(columns: Sequence[str], rows: Iterable[Sequence[str]], left: Sequence[int] = (0,), rule: bool = False) -> str:
    """Columns aligned by spaces, two between them, for a terminal.

    left   positions of the columns whose text begins at the left; the others end at the right
    rule   a line of dashes below the heads
    """
    lines = [tuple(columns), *(tuple(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(columns))]
    if rule:
        lines.insert(1, tuple("-" * width for width in widths))
    return "\n".join(_aligned(line, widths, left) for line in lines)


def _aligned(line: Sequence[str], widths: Sequence[int], left: Sequence[int]) -> str:
    cells = [text.ljust(w) if i in left else text.rjust(w) for i, (text, w) in enumerate(zip(line, widths))]
    return "  ".join(cells).rstrip()


def markdown(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; cells may hold Markdown without line breaks and bars."""
    body = ["| " + " | ".join(line) + " |" for line in (columns, *rows)]
    return "\n".join([body[0], "|" + "---|" * len(columns), *body[1:]])


def _is_sentence(content: str) -> bool:
    return len(re.sub("<[^>]*>", "", content)) > LONGEST_VALUE


def _cell(content: str, column: str) -> str:
    """A cell, which names its column; one with a sentence in it breaks its lines and begins at the left."""
    words = ' class="words"' if _is_sentence(content) else ""
    return f'<td{words} data-head="{html.escape(column)}">{content}</td>'


def _narrow(heads: list[str], rows: list[list[str]]) -> str:
    """The class of a table of few columns, and the widths of its columns on a telephone."""
    widths = [
        max(HEAD_LETTER * _longest(head), *(LETTER * _longest(row[k]) for row in rows), 0) + EDGES
        for k, head in enumerate(heads)
    ]
    if sum(widths) > ROW or any(_is_sentence(cell) for row in rows for cell in row):
        return " listed"
    return f' few" style="--columns:{" ".join(f"minmax(0,{width:.0f}fr)" for width in widths)}'


def _longest(content: str) -> int:
    """Letters of the longest word of a cell or a head."""
    return max(map(len, html.unescape(re.sub("<[^>]*>", " ", content)).split()), default=0)


def unbroken(name: str) -> str:
    """The name of a quantity, whose unit stays on the line of the comma: `PSNR, dB`."""
    return re.sub(r", (?=\S+$)", ",\u00a0", name)


def html_table(
    columns: Iterable[str], rows: Iterable[Iterable[str]], classes: Iterable[str] = (), caption: str = ""
) -> str:
    """A table whose every column is visible on a narrow page (see `report.parts.STYLE`).

    Up to FEW columns after the first stand there below the name of their row: side by side where none holds a sentence
    and the longest words fit, and otherwise one below the other with their heads. A table with more of them scrolls
    sideways, and its first column stays visible.

    columns, caption   text, which is escaped
    rows               cells, which are HTML already
    classes            class of each row; "" or no entry = none
    """
    names = list(columns)
    lines = [list(row) for row in rows]
    wordy = {i for line in lines for i, cell in enumerate(line) if i and _is_sentence(cell)}
    head = "".join(
        f'<th scope="col"{" class=words" if i in wordy else ""}>{html.escape(unbroken(column))}</th>'
        for i, column in enumerate(names)
    )
    kinds = list(classes)
    body = []
    for position, (first, *rest) in enumerate(lines):
        kind = f' class="{kinds[position]}"' if position < len(kinds) and kinds[position] else ""
        cells = "".join(_cell(content, column) for content, column in zip(rest, names[1:], strict=True))
        body.append(f'<tr{kind}><th scope="row">{first}</th>{cells}</tr>')
    title = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    few = _narrow(names[1:], [line[1:] for line in lines]) if 2 <= len(names) <= FEW + 1 else ""
    table = f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"
    return f'<div class="scroll{few}">{table}</div>'
