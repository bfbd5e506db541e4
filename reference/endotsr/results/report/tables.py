"""Quantities as text, and tables in three formats: aligned text, Markdown, HTML.

In: column heads, and rows of cells as text (for HTML tables: as HTML). Out: one string.
"""

import html
import re
from collections.abc import Iterable, Sequence

LONGEST_VALUE = 32  # characters of a cell without line breaks
FEW = 6  # maximum columns after the first for a table that fits on a phone without scrolling
# Pixels of a row on a phone, of a cell's padding, of a letter in a cell and in a head (`report.parts.STYLE`, 390 px).
ROW, EDGES, LETTER, HEAD_LETTER = 355, 10, 7.9, 7.4


def duration(seconds: float) -> str:
    """A duration as h:mm:ss or m:ss."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def memory(found: int | None) -> str:
    """Bytes of memory as text; "memory unknown" for None."""
    return f"{found / 1e9:.2f} GB" if found else "memory unknown"


def fixed(value: float | None, digits: int, sign: str = "") -> str:
    """A number with fixed decimals; "-" for None. sign = "+" also shows a positive sign."""
    return "-" if value is None else f"{value:{sign}.{digits}f}"


def plain(columns: Sequence[str], rows: Iterable[Sequence[str]], left: Sequence[int] = (0,), rule: bool = False) -> str:
    """A table for a terminal: columns aligned and separated by two spaces.

    left   positions of the left-aligned columns; the others are right-aligned
    rule   add a line of dashes below the heads
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
    """A Markdown table; cells may contain Markdown, but no line breaks or bars."""
    body = ["| " + " | ".join(line) + " |" for line in (columns, *rows)]
    return "\n".join([body[0], "|" + "---|" * len(columns), *body[1:]])


def _is_sentence(content: str) -> bool:
    return len(re.sub("<[^>]*>", "", content)) > LONGEST_VALUE


def _cell(content: str, column: str) -> str:
    """A cell with the name of its column; a cell with a sentence is left-aligned and wraps."""
    words = ' class="words"' if _is_sentence(content) else ""
    return f'<td{words} data-head="{html.escape(column)}">{content}</td>'


def _narrow(heads: list[str], rows: list[list[str]]) -> str:
    """The CSS class of a table of few columns, and its column widths on a phone."""
    widths = [
        max(HEAD_LETTER * _longest(head), *(LETTER * _longest(row[k]) for row in rows), 0) + EDGES
        for k, head in enumerate(heads)
    ]
    if sum(widths) > ROW or any(_is_sentence(cell) for row in rows for cell in row):
        return " listed"
    return f' few" style="--columns:{" ".join(f"minmax(0,{width:.0f}fr)" for width in widths)}'


def _longest(content: str) -> int:
    """Number of letters of the longest word in a cell or head."""
    return max(map(len, html.unescape(re.sub("<[^>]*>", " ", content)).split()), default=0)


def unbroken(name: str) -> str:
    """The name of a quantity with a non-breaking space before its unit: `PSNR, dB`."""
    return re.sub(r", (?=\S+$)", ",\u00a0", name)


def html_table(columns: Iterable[str], rows: Iterable[Iterable[str]], classes: Iterable[str] = ()) -> str:
    """A table that is readable on a narrow page (see `report.parts.STYLE`).

    There, up to FEW columns after the first are shown below the name of their row: next to each other if they have no
    sentences and their longest words fit, else below each other with their heads. A table with more columns scrolls
    horizontally with a fixed first column.

    columns   text; is escaped
    rows      cells as HTML
    classes   CSS class of each row; "" or no entry = none
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
    few = _narrow(names[1:], [line[1:] for line in lines]) if 2 <= len(names) <= FEW + 1 else ""
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"
    return f'<div class="scroll{few}">{table}</div>'
