"""Link targets: the public names of the package, the equation labels of the specification, the notebooks."""

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "reference" / "endotsr"
SPECIFICATION = ROOT / "docs" / "specification"
NOTEBOOKS = ROOT / "notebooks"
DEFINITION = "endotsr.definition."  # a short name means the compiled function
LABEL = re.compile(r"^\$\$ \(eq-([\w-]+)\)$", re.MULTILINE)


def module_name(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def modules() -> dict[str, Path]:
    """Public modules by dotted name."""
    return {module_name(file): file for file in sorted(PACKAGE.rglob("*.py"))}


@cache
def definitions() -> dict[str, str]:
    """Dotted name -> short name of every public function and class."""
    found = {}
    for name, file in modules().items():
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name[0] != "_":
                found[f"{name}.{node.name}"] = node.name
    return found


@cache
def linkable() -> dict[str, str]:
    """Text in back quotes -> dotted target: full names, and short names defined by one module only."""
    compiled = {dotted: name for dotted, name in definitions().items() if not dotted.startswith(DEFINITION)}
    count = Counter(compiled.values())
    short = {name: dotted for dotted, name in compiled.items() if count[name] == 1}
    documented = {dotted.rpartition(".")[0] for dotted in definitions()}
    return {**short, **{dotted: dotted for dotted in definitions()}, **{name: name for name in documented}}


@cache
def equation_pages() -> dict[str, str]:
    """Equation label -> name of its page of the specification, in reading order."""
    pages = sorted(SPECIFICATION.glob("*.md"), key=lambda page: (page.stem[0] == "m", page.stem[0] == "b", page.stem))
    return {label: page.stem for page in pages for label in LABEL.findall(page.read_text(encoding="utf-8"))}


def markdown_of(notebook: Path) -> str:
    """The Markdown cells of a notebook in the percent format, comment signs removed."""
    lines = notebook.read_text(encoding="utf-8").splitlines()
    return "\n".join(line.removeprefix("#").removeprefix(" ") for line in lines if line.startswith("#"))


@cache
def notebooks_of(label: str) -> tuple[str, ...]:
    """Names of the notebooks whose introduction announces the equation, in reading order."""
    mention = f"{{eq}}`eq-{label}`"
    found = [file.stem for file in sorted(NOTEBOOKS.glob("*.py")) if mention in markdown_of(file).split("\n## ")[0]]
    return tuple(found)
