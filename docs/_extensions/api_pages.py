"""One page per room of the package in docs/api, written for autodoc; `docstring_layout` formats the docstrings."""

import ast
import inspect
import re
from importlib import import_module
from typing import Any

from book_map import equations
from book_pages import NOTE, check_links, golden_links, notebook_links, reverse_links, write
from docstring_layout import DocstringDirective
from package_names import ROOT, definitions, modules
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

API = ROOT / "docs" / "api"
GROUPS = (
    ("Start here", "Load a sequence, train, render, evaluate, save.", ("package",)),
    (
        "The method",
        "Each forward pass has its reverse pass below it; first in plain NumPy, then compiled.",
        ("definition", "equations", "splatting", "losses", "kernels"),
    ),
    (
        "Clips",
        "From a recording to the arrays that training reads.",
        ("formats", "sequences", "flow", "masks", "prepare", "simulator", "effects", "poses", "opencv", "untrusted"),
    ),
    ("Training", "The model, its training, and the files of a run.", ("scene", "fitting", "runs")),
    ("Results", "Numbers, pages, pictures and files of a trained scene.", ("evaluation", "report", "views", "export")),
    (
        "Ports",
        "Gradients, stored numbers, and the registry of both.",
        ("operations", "gradcheck", "judge", "contract", "reference", "search"),
    ),
    ("Studies", "Measurements of this machine, and many runs.", ("bench", "tradeoff", "sweeps", "windows")),
    ("Commands", "The program `endotsr`.", ("cli",)),
)  # in the order of the storeys
ROLE = re.compile(r"\{([\w:]+)\}(?=`)")


STOREYS = ("method", "clips", "training", "results", "port", "studies")  # doors with rooms behind them


def room_of(name: str) -> str:
    """The room of a dotted module: the part below its storey, or the first part below the package."""
    parts = name.split(".")[1:]
    inner = parts[1:] if parts and parts[0] in STOREYS else parts
    if not inner or (inner == parts and len(parts) == 1 and modules()[name].name != "__init__.py"):
        return "package"
    return inner[0]


def rooms() -> dict[str, list[str]]:
    """Modules with public definitions, by room of the package."""
    found: dict[str, list[str]] = {}
    for name in dict.fromkeys(dotted.rpartition(".")[0] for dotted in definitions()):
        found.setdefault(room_of(name), []).append(name)
    return found


def room_page(room: str, names: list[str]) -> str:
    """All modules of a room on one page: few pages build fast, and the browser can search them."""
    lines = [NOTE + f"# {room}", ""]
    for name in names:
        lines += [f"## {name}", "", "```{eval-rst}", f".. automodule:: {name}", "   :members:"]
        lines += ["   :member-order: bysource", "```", ""]
    return "\n".join(lines)


def summary(room: str) -> str:
    """The first sentence of the docstring of a room, or of the package for modules without a room."""
    names = ["endotsr"] if room == "package" else [f"endotsr.{room}", *(f"endotsr.{s}.{room}" for s in STOREYS)]
    tree = ast.parse(next(modules()[name] for name in names if name in modules()).read_text(encoding="utf-8"))
    first = (ast.get_docstring(tree) or "").split("\n\n")[0].replace("\n", " ")
    return re.split(r"(?<=\.)\s", first)[0]


def index_page() -> str:
    """The rooms in the order of use. Raises: ExtensionError for a room without a group."""
    lines = [NOTE + "# API", "", "Every public function of `endotsr`: shapes, units, edges, errors, and its source."]
    lines += ["A program that uses the package starts with {doc}`/guides/python`.", ""]
    known = [room for _, _, names in GROUPS for room in names]
    if sorted(known) != sorted(rooms()):
        raise ExtensionError(f"rooms without one group in api_pages.GROUPS: {sorted({*known} ^ {*rooms()})}")
    for title, sentence, names in GROUPS:
        lines += [f"## {title}", "", sentence, ""]
        lines += [f"- {{doc}}`{room}`: {summary(room)}" for room in names]
        lines += ["", "```{toctree}", ":hidden:", "", *names, "```", ""]
    return "\n".join(lines)


def write_api(app: Sphinx) -> None:
    API.mkdir(exist_ok=True)
    write(API / "index.md", index_page())
    for room, names in rooms().items():
        write(API / f"{room}.md", room_page(room, names))
    for stale in {file.stem for file in API.glob("*.md")} - {*rooms(), "index"}:
        (API / f"{stale}.md").unlink()


def field_comments(dotted: str) -> list[str]:
    """`name  comment` of the commented fields of a class, from its source."""
    module, _, name = dotted.rpartition(".")
    if module not in modules():
        return []
    text = modules()[module].read_text(encoding="utf-8")
    node = next((n for n in ast.parse(text).body if isinstance(n, ast.ClassDef) and n.name == name), None)
    body = node.body if node else []  # a type alias is not a class
    fields = [n for n in body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)]
    comments = [
        (ast.unparse(n.target), text.splitlines()[(n.end_lineno or n.lineno) - 1].partition("#")[2].strip())
        for n in fields
    ]
    return [f"{field}  {comment}" for field, comment in comments if comment]


def book_line(dotted: str) -> str:
    """Links to the derivation, check and golden cases of a function; "" unless it implements an equation."""
    for row in equations():
        if dotted in row.functions:
            parts = (f"reverse {reverse_links(row)}", f"check {check_links(row)}", f"golden cases {golden_links(row)}")
            return ROLE.sub(
                r":\1:", f"Equation {{eq}}`eq-{row.label}`; {'; '.join(parts)}; notebook {notebook_links(row)}."
            )
    return ""


def process(app: Sphinx, what: str, name: str, found: Any, options: Any, lines: list[str]) -> None:
    """Pass the docstring on unchanged; the directive builds the nodes."""
    fields = field_comments(name) if what in ("class", "exception") else []
    text = [*lines, "", *fields]
    lines[:] = [".. docstring::", "", *(f"   {line}" for line in text), "", book_line(name)]


def skip(app: Sphinx, what: str, name: str, found: Any, skipped: bool, options: Any) -> bool | None:
    """Skip fields, which are in the table of their class."""
    is_field = what == "class" and not (inspect.isfunction(found) or isinstance(found, property | classmethod))
    return True if is_field else None


def module_of_source(app: Sphinx | None, module: str, name: str) -> str | None:
    """The documented module of an alias such as `dict[str, float]`, whose module is `builtins`; None for others."""
    found = getattr(import_module(module), name.partition(".")[0], None)
    return None if str(getattr(found, "__module__", "")).startswith("endotsr") else module


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("docstring", DocstringDirective)
    app.connect("builder-inited", write_api)
    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-skip-member", skip)
    app.connect("viewcode-follow-imported", module_of_source)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
