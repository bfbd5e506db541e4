"""Links added when a page is read; the sources stay plain text.

A specification page has a line of links for each of its equations below its heading. Names of the package in back
quotes become links, in pages and in the Markdown cells of notebooks. The reverse pass of a notebook gets an anchor. A
chapter ends with the subjects under which docs/references.md names works for it.
"""

import re
from collections.abc import Callable

from book_map import equations
from book_pages import DOCS, link_line
from package_names import linkable
from sphinx.application import Sphinx

CODE = re.compile(r"(?<![`}\\])`([A-Za-z_][\w.]*)(\([^`\n]*\))?`(?!`)")
FENCE = re.compile(r"^(```|~~~|\$\$)")
REVERSE = "# ## The reverse pass"
SUBJECT = re.compile(r"^\*\*([^*]+)\*\* \((chapters? [^)]*\d)\)\.", re.MULTILINE)


def linked(line: str) -> str:
    """Names of the package as links; a short name without underscore or brackets may be an ordinary word."""

    def link(match: re.Match) -> str:
        name, arguments = match[1], match[2] or ""
        target = linkable().get(name)
        if target is None or not (arguments or "_" in name or "." in name):
            return match[0]
        return f"{{py:obj}}`{name}{arguments} <{target}>`"

    return CODE.sub(link, line)


def outside_fences(lines: list[str], change: Callable[[str], str], prefix: str = "") -> list[str]:
    """Apply a change to the lines of text, not to code blocks and displays."""
    done, inside = [], False
    for line in lines:
        text = line.removeprefix(prefix)
        if FENCE.match(text):
            inside = not inside
        done.append(line if inside or FENCE.match(text) or not line.startswith(prefix) else prefix + change(text))
    return done


def specification(name: str, text: str) -> str:
    """The page with its lines of links below the heading."""
    lines = outside_fences(text.splitlines(), linked)
    rows = [link_line(row) for row in equations() if row.page == name]
    if rows:
        heading = next(k for k, line in enumerate(lines) if line.startswith("# "))
        box = ["", ":::{container} equation-links", *[part for row in rows for part in (row, "")][:-1], ":::"]
        lines[heading + 1 : heading + 1] = box
    return "\n".join(lines) + "\n"


def literature(text: str, chapter: int) -> list[str]:
    """Subjects of a page of references that name a chapter, such as "(chapters 6 to 9, 13)"; not "(every chapter)"."""
    found = []
    for subject, chapters in SUBJECT.findall(text):
        spans = [list(map(int, re.findall(r"\d+", part))) for part in chapters.split(",")]
        if any(span[0] <= chapter <= span[-1] for span in spans):
            found.append(subject)
    return found


def notebook(name: str, text: str) -> str:
    """The notebook with links in its Markdown cells, an anchor above its reverse pass, and its literature."""
    subjects = literature((DOCS / "references.md").read_text(encoding="utf-8"), int(name[:2]))
    if subjects:
        named = ", ".join(subject[0].lower() + subject[1:] if subject[1].islower() else subject for subject in subjects)
        text = f"{text.rstrip()}\n\n# %% [markdown]\n# **Literature** on {named}: {{doc}}`/references`.\n"
    parts = re.split(r"^(# %%.*)$", text, flags=re.MULTILINE)
    for k in range(1, len(parts), 2):
        if "[markdown]" in parts[k]:
            parts[k + 1] = "\n".join(outside_fences(parts[k + 1].split("\n"), linked, "# "))
    return "".join(parts).replace(REVERSE, f"# (reverse-{name})=\n{REVERSE}", 1)


def read(app: Sphinx, docname: str, source: list[str]) -> None:
    folder, _, name = docname.rpartition("/")
    if folder == "specification":
        source[0] = specification(name, source[0])
    elif folder == "notebooks" and name[:2].isdigit():
        source[0] = notebook(name, source[0])
    elif folder == "guides":
        source[0] = "\n".join(outside_fences(source[0].splitlines(), linked)) + "\n"


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
