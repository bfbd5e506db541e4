"""Layout of the package's docstrings: aligned columns become tables, `Edges:` and similar notes become fields.

A docstring has a summary, rows `name  (shape)  text` with two or more spaces between the columns, then `Reverse:`,
`Edges:`, `Raises:`, `Oracle:`. Nodes are built directly, because characters of a formula must not be parsed as markup.
Names in back quotes that the package defines and equation numbers become links.
"""

import re
from collections.abc import Iterable, Iterator

from docutils import nodes
from package_names import equation_pages, linkable
from sphinx import addnodes
from sphinx.environment import BuildEnvironment
from sphinx.util.docutils import SphinxDirective

KEYS = ("Reverse", "Edges", "Raises", "Oracle", "Source", "Draws", "Its mask")
NOTE = re.compile(rf"^({'|'.join(KEYS)}):\s*(.*)$")
ROW = re.compile(r"^(\S.*?)\s{2,}(\S.*)$")
SHAPE = re.compile(r"^(\([^()]*\)(?: bool)?)(?:\s{2,}(\S.*))?$")
# `code`, or an equation number after the word "equation", or a number of the base model alone
INLINE = re.compile(
    r"`(?P<code>[^`]+)`|(?P<bare>\b[a-z]+_\w+\b)"
    r"|(?:(?<=quation )|(?<=quations ))\((?P<paper>\d+[a-z]?)\)"
    r"|\((?P<alone>[BM]\d+)\)|(?P<base>\b[BM]\d+\b)"
)


class DocstringDirective(SphinxDirective):
    """Formats the content of the directive as a docstring."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        return [node for block in blocks(self.content) for node in render(block, self.env)]


def blocks(lines: Iterable[str]) -> Iterator[list[str]]:
    """Runs of lines between blank lines."""
    run: list[str] = []
    for line in [*lines, ""]:
        if line.strip():
            run.append(line.rstrip())
        elif run:
            yield run
            run = []


def render(lines: list[str], env: BuildEnvironment) -> Iterator[nodes.Element]:
    """Nodes of one block: a formula if it is indented, else paragraphs, rows and notes in order."""
    if lines[0].startswith("    "):
        yield literal(lines)
        return
    for kind, entries in grouped(lines):
        if kind == "row":
            yield table(entries, env)
        elif kind == "note":
            yield field_list(entries, env)
        else:
            yield from paragraphs(entries, env)


def grouped(lines: list[str]) -> Iterator[tuple[str, list[list[str]]]]:
    """Groups of entries of the same kind; an entry is a first line with its continuation lines."""
    group: list[list[str]] = []
    kind = ""
    for line in lines:
        found = kind_of(line, kind)
        if found == "more":
            group[-1].append(line)
            continue
        if found != kind and group:
            yield kind, group
            group = []
        kind = found
        group.append([line])
    if group:
        yield kind, group


def kind_of(line: str, before: str) -> str:
    """`row`, `note` or `text`; `more` for a continuation line."""
    if before and line.startswith(" "):
        return "more"
    if NOTE.match(line):
        return "note"
    if before == "note":
        return "more"
    if ROW.match(line) and not line.split("  ")[0].endswith((".", ",", ";")):
        return "row"
    return "more" if before == "text" else "text"


def literal(lines: list[str]) -> nodes.literal_block:
    indent = min(len(line) - len(line.lstrip()) for line in lines)
    text = "\n".join(line[indent:] for line in lines)
    return nodes.literal_block(text, text, language="text")


def paragraphs(entries: list[list[str]], env: BuildEnvironment) -> Iterator[nodes.Element]:
    """Text, with any following indented lines as a formula."""
    for entry in entries:
        split = next((k for k, line in enumerate(entry) if line.startswith("    ")), len(entry))
        yield nodes.paragraph("", "", *inline(" ".join(line.strip() for line in entry[:split]), env))
        if split < len(entry):
            yield literal(entry[split:])


def table(entries: list[list[str]], env: BuildEnvironment) -> nodes.table:
    """Rows `name, shape, text`; the column of shapes is omitted if no row has one."""
    rows = []
    for first, *more in entries:
        name, rest = ROW.match(first).groups()  # type: ignore[union-attr]
        shape = SHAPE.match(rest)
        text = (shape.group(2) or "") if shape else rest
        rows.append((name, shape.group(1) if shape else "", " ".join([text, *(line.strip() for line in more)])))
    columns = (0, 1, 2) if any(row[1] for row in rows) else (0, 2)
    group = nodes.tgroup(
        "", *(nodes.colspec(colwidth=width) for width in (3, 3, 10)[: len(columns)]), cols=len(columns)
    )
    body = nodes.tbody()
    for row in rows:
        cells = nodes.row()
        for column in columns:
            content = (
                inline(row[column], env) if column == 2 else [nodes.literal("", row[column])] if row[column] else []
            )
            cells += nodes.entry("", nodes.paragraph("", "", *content))
        body += cells
    group += body
    return nodes.table("", group, classes=["docstring"])


def field_list(entries: list[list[str]], env: BuildEnvironment) -> nodes.field_list:
    fields = nodes.field_list()
    for first, *more in entries:
        name, text = NOTE.match(first).groups()  # type: ignore[union-attr]
        text = " ".join([text, *(line.strip() for line in more)])
        body = nodes.field_body("", nodes.paragraph("", "", *inline(text, env)))
        fields += nodes.field("", nodes.field_name("", name), body)
    return fields


def inline(text: str, env: BuildEnvironment) -> list[nodes.Node]:
    """Text with its links: names defined by the package, and equation numbers."""
    found: list[nodes.Node] = []
    end = 0
    for match in INLINE.finditer(text):
        found.append(nodes.Text(text[end : match.start()]))
        end = match.end()
        number = match["paper"] or match["alone"] or match["base"]
        if number:
            found.append(equation(number, match[0], env))
        elif match["code"] or match["bare"] in linkable():
            found.append(code(match["code"] or match["bare"], env))
        else:
            found.append(nodes.Text(match["bare"]))
    return [*found, nodes.Text(text[end:])]


def code(text: str, env: BuildEnvironment) -> nodes.Node:
    """A literal, linked to the object of that name if it exists."""
    content = nodes.literal("", text, classes=["py"])
    target = linkable().get(text.removesuffix("()"))
    return xref("py", "obj", target, content, env) if target else content


def equation(number: str, text: str, env: BuildEnvironment) -> nodes.Node:
    """A link to the display, shown as its number in brackets."""
    if number.lower() not in equation_pages():
        return nodes.Text(text)
    return xref("math", "eq", f"eq-{number.lower()}", nodes.Text(text), env)


def xref(domain: str, kind: str, target: str, content: nodes.Node, env: BuildEnvironment) -> addnodes.pending_xref:
    node = addnodes.pending_xref(
        "", refdomain=domain, reftype=kind, reftarget=target, refdoc=env.docname, refexplicit=True, refwarn=True
    )
    node += content
    return node
