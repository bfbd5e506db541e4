"""Cells of the chapters: tests and set-up are folded away, and aligned text becomes a table.

A code cell without tags is folded under one line: with assertions, the line counts them; without, and if it prints
nothing, it is a set-up. The code of a figure is folded too. Outputs stay in view. The table of a gradient check, which
the cells print as aligned text, becomes a table of the page. The sources stay plain notebooks.
"""

import ast
import json
import re

from docutils import nodes
from sphinx.application import Sphinx

CELL = re.compile(r"^(# %%.*)$", re.MULTILINE)
PROMPTS = ("code_prompt_show", "code_prompt_hide")
RULE = re.compile(r"^-+(?: {2,}-+)+$")  # below the head of an aligned table


def assertions(body: str) -> tuple[int, int, bool]:
    """Number of assertions of a cell, of its statements at the top level that contain none, and whether it calls."""
    tree = ast.parse(body)

    def asserts(node: ast.AST) -> bool:
        named = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        return isinstance(node, ast.Assert) or (named and node.func.attr.startswith("assert_"))

    count = sum(asserts(node) for node in ast.walk(tree))
    others = sum(not any(map(asserts, ast.walk(node))) for node in tree.body)
    return count, others, any(isinstance(node, ast.Expr | ast.For) for node in tree.body)


def folded(text: str) -> str:
    """The notebook with its cells of assertions folded."""
    parts = CELL.split(text)
    for k in range(1, len(parts), 2):
        head, body = parts[k].strip(), parts[k + 1]
        line = None
        if head == '# %% tags=["hide-input"]':
            line = "Code of the figure" if "plt.show()" in body else "Code"
        elif head == "# %%" and "plt.show()" not in body:
            line = line_of(*assertions(body))
        if line:
            parts[k] = f'# %% tags=["hide-input"] mystnb={json.dumps(dict.fromkeys(PROMPTS, line))}'
    return "".join(parts)


def line_of(count: int, others: int, calls: bool) -> str | None:
    """The line under which a cell is folded, or None for one that stays open."""
    number = f"{count} assertion" + "s" * (count != 1)
    if count:
        return f"Checked: {number}" if others <= 2 * count else f"Code, with {number}"
    return None if calls else "Set-up"


def aligned_table(lines: list[str]) -> nodes.table:
    """A table of the page from aligned text: head, rule, rows; the rule says where the columns begin and end."""
    spans = [match.span() for match in re.finditer("-+", lines[1])]
    ends = [begin for begin, _ in spans[1:]] + [None]
    rows = [[line[begin:end].strip() for (begin, _), end in zip(spans, ends)] for line in (lines[0], *lines[2:])]
    group = nodes.tgroup("", *(nodes.colspec(colwidth=1) for _ in spans), cols=len(spans))
    head, body = nodes.thead(), nodes.tbody()
    for cells in rows:
        entries = (nodes.entry("", nodes.paragraph(text=cell)) for cell in cells)
        (body if head.children else head).append(nodes.row("", *entries))
    group += [head, body]
    return nodes.table("", group, classes=["aligned"])


def with_tables(text: str) -> list[str | nodes.table]:
    """The parts of an output: text, and the tables in it."""
    lines, parts, begin = text.split("\n"), [], 0
    for k in range(1, len(lines)):
        if k <= begin or not RULE.match(lines[k]):
            continue
        end = next((j for j in range(k + 1, len(lines)) if not lines[j].strip()), len(lines))
        parts += ["\n".join(lines[begin : k - 1]), aligned_table(lines[k - 1 : end])]
        begin = end
    return [part for part in (*parts, "\n".join(lines[begin:])) if not isinstance(part, str) or part.strip()]


def tables(app: Sphinx, tree: nodes.document) -> None:
    """Replace aligned tables in the outputs of a chapter."""
    for block in list(tree.findall(nodes.literal_block)):
        parts = with_tables(block.astext()) if "output" in block["classes"] else []
        if any(isinstance(part, nodes.table) for part in parts):
            again = []
            for part in parts:
                if isinstance(part, str):
                    copy = block.copy()
                    copy.rawsource, copy.children = part, [nodes.Text(part)]
                    part = copy
                again.append(part)
            block.replace_self(again)


def read(app: Sphinx, docname: str, source: list[str]) -> None:
    folder, _, name = docname.rpartition("/")
    if folder == "notebooks" and name[:2].isdigit():
        source[0] = folded(source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", read)
    app.connect("doctree-read", tables)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
