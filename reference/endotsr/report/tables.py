"""Tables from rows of text in three forms: aligned text, Markdown, HTML.

In: column heads, and rows whose cells are text already; for HTML, the cells are HTML already. Out: one string. The
caller formats the numbers.
"""

import html
import re
from collections.abc import Iterable, Sequence

LONGEST_VALUE = 32  # characters of a cell that stands on one line
FEW = 6  # columns of numbers that stand side by side on a telephone


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


def _cell(content: str) -> str:
    """A cell; one with a sentence in it breaks its lines and begins at the left."""
    return f'<td class="words">{content}</td>' if _is_sentence(content) else f"<td>{content}</td>"


def unbroken(name: str) -> str:
    """The name of a quantity, whose unit stays on the line of the comma: `PSNR, dB`."""
    return re.sub(r", (?=\S+$)", ",\u00a0", name)


def html_table(
    columns: Iterable[str], rows: Iterable[Iterable[str]], classes: Iterable[str] = (), caption: str = ""
) -> str:
    """A table whose every column is visible on a narrow page (see `report.parts.STYLE`).

    Up to FEW columns after the first stand below the name of their row there. A table with more of them scrolls
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
        body.append(f'<tr{kind}><th scope="row">{first}</th>{"".join(map(_cell, rest))}</tr>')
    title = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    few = f' few" style="--cells:{len(names) - 1}' if 2 <= len(names) <= FEW + 1 else ""
    table = f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"
    return f'<div class="scroll{few}">{table}</div>'
