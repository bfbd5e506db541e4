"""The shape of the package, read from its sources: python tests/house.py [FOLDER OF ANOTHER CHECKOUT]

Prints the lines of every room of the package, of the method, and of the programs beside it that are not installed;
the numbers of settings and commands; the longest signature; long functions; and every import that runs up or round in
a circle. `test_layout.py` asserts what must stay true.
"""

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
# The doors of the package from the ground up: storeys with their rooms, and single modules. A storey imports itself and
# what stands before it; inside a storey, a room imports itself and the rooms before it.
STOREYS: dict[str, tuple[str, ...]] = {
    "errors": (),
    "untrusted": (),
    "config": (),
    "definition": (),
    "method": ("kernels", "equations", "losses", "splatting"),
    "clips": ("opencv", "poses", "formats", "sequences", "flow", "masks", "prepare", "simulator", "effects"),
    "training": ("scene", "fitting", "runs"),
    "results": ("evaluation", "report", "export", "views"),
    "port": ("operations", "gradcheck", "judge", "contract", "reference", "search"),
    "studies": ("bench", "tradeoff", "sweeps", "windows"),
    "api": (),
    "cli": (),
    "__main__": (),
}
ROOMS = tuple(room for storey, rooms in STOREYS.items() for room in (storey, *(f"{storey}.{name}" for name in rooms)))
METHOD = (
    "definition", "method.kernels", "method.equations", "method.losses", "method.splatting", "training.scene",
    "training.fitting",
)  # fmt: skip
# What the method may know beside itself.
GROUND = ("errors", "untrusted", "config", "clips.opencv", "clips.sequences", "clips.flow")
BESIDE = ("golden", "docs/pages", "tests")  # folders of programs that run in the repository and are not installed
LONGEST_FUNCTION = 40  # lines
MOST_POSITIONAL = 12
LARGEST_GOLDEN = 12_000_000  # bytes of golden/, which every clone and every port carries


class Function(NamedTuple):
    """A function of the package."""

    name: str  # dotted, below the package
    lines: int
    positional: int  # parameters that may be given by position


@cache
def modules(root: Path = ROOT) -> dict[str, ast.Module]:
    """Syntax trees by dotted name below the package; `""` is the package itself."""
    package = root / "reference" / "endotsr"
    found = {}
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = ast.parse(file.read_text(encoding="utf-8"))
    return found


@cache
def imports(root: Path = ROOT) -> frozenset[tuple[str, str]]:
    """(module, module that it imports), imports inside functions included."""
    known, found = modules(root), set()
    for name, tree in known.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "endotsr":
                base = (node.module or "").removeprefix("endotsr").lstrip(".")
                for alias in node.names:
                    inner = f"{base}.{alias.name}".lstrip(".")
                    found.add((name, inner if inner in known else base))
            elif isinstance(node, ast.Import):
                for alias in node.names:
                    if alias.name.split(".")[0] == "endotsr":
                        found.add((name, alias.name.removeprefix("endotsr").lstrip(".")))
    return frozenset(found)


def room(module: str) -> str:
    """The storey and room of a dotted name, `method.splatting`; the storey alone where it has no rooms."""
    parts = module.split(".")
    return ".".join(parts[:2]) if STOREYS.get(parts[0]) else parts[0]


def storey(module: str) -> str:
    """The first part of a dotted name: the door."""
    return module.split(".")[0]


def upward(root: Path = ROOT) -> list[str]:
    """Imports that run up; those of the package's own face (version, docstring) are none."""
    rank = {name: k for k, name in enumerate(ROOMS)}
    pairs = [(a, b) for a, b in imports(root) if a and b]
    return sorted(f"{a} -> {b}" for a, b in pairs if rank.get(room(b), -1) > rank.get(room(a), len(rank)))


def circles(root: Path = ROOT) -> list[list[str]]:
    """Groups of modules that import one another, directly or through others."""
    below: dict[str, set[str]] = {}
    for a, b in imports(root):
        if a and b:
            below.setdefault(a, set()).add(b)

    def reached(start: str) -> set[str]:
        seen, todo = set(), [start]
        while todo:
            for other in below.get(todo.pop(), set()) - seen:
                seen.add(other)
                todo.append(other)
        return seen

    reach = {name: reached(name) for name in below}
    groups = {tuple(sorted(b for b in reach[a] if a in reach.get(b, set()))) for a in below if a in reach[a]}
    return [list(group) for group in sorted(groups)]


def names_of(node: ast.Import | ast.ImportFrom) -> list[str]:
    """The modules that an import statement names."""
    return [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]


def functions(root: Path = ROOT) -> Iterator[Function]:
    """Every function, methods and inner ones included; the docstring does not count as length."""
    for name, tree in modules(root).items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                a = node.args
                count = len(a.posonlyargs) + len(a.args)
                first = node.body[1] if ast.get_docstring(node) and len(node.body) > 1 else node.body[0]
                lines = (node.end_lineno or node.lineno) - first.lineno + 1
                yield Function(f"{name}.{node.name}", lines, count)


def lines_of(root: Path = ROOT) -> dict[str, int]:
    """Lines of every room."""
    package, found = root / "reference" / "endotsr", {}
    for file in package.rglob("*.py"):
        parts = file.relative_to(package).with_suffix("").parts
        inner = ".".join(parts[:2])
        name = inner if inner in ROOMS else parts[0]
        found[name] = found.get(name, 0) + _count(file)
    return found


def lines_beside(root: Path = ROOT) -> dict[str, int]:
    """Lines of the programs that are not installed, ports of other authors left out."""
    found = {}
    for name in BESIDE:
        files = [file for file in (root / name).rglob("*.py") if "ports" not in file.parts]
        found[name] = sum(map(_count, files))
    return found


def _count(file: Path) -> int:
    return len(file.read_text(encoding="utf-8").splitlines())


def untyped(root: Path = ROOT) -> dict[str, int]:
    """Lines that name `dict[str, Any]`, by room: data whose keys the reader must look up elsewhere."""
    package, found = root / "reference" / "endotsr", {}
    for file in package.rglob("*.py"):
        count = sum("dict[str, Any]" in line for line in file.read_text(encoding="utf-8").splitlines())
        if count:
            first = file.relative_to(package).parts[0].removesuffix(".py")
            found[first] = found.get(first, 0) + count
    return found


def settings(root: Path = ROOT) -> list[str]:
    """Every key of the configuration, as section.name; one that stands outside the sections by its name alone."""
    sections = {node.name: node for node in modules(root)["config"].body if isinstance(node, ast.ClassDef)}
    fields = lambda section: [node for node in section.body if isinstance(node, ast.AnnAssign)]
    found = []
    for field in fields(sections["Config"]):
        name, section = ast.unparse(field.target), sections.get(ast.unparse(field.annotation))
        found += [f"{name}.{ast.unparse(key.target)}" for key in fields(section)] if section else [name]
    return found


def commands(root: Path = ROOT) -> list[str]:
    """The words that may follow `endotsr`."""
    for node in modules(root)["cli.parts.commands"].body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "COMMANDS":
            return list(ast.literal_eval(node.value))
    raise ValueError("cli/parts/commands.py has no table COMMANDS")


def golden_bytes(root: Path = ROOT) -> int:
    """Bytes of the golden vectors and their makers."""
    files = (file for file in (root / "golden").rglob("*") if file.is_file() and "__pycache__" not in file.parts)
    return sum(file.stat().st_size for file in files)


def main(root: Path) -> None:
    """Print the measures."""
    lines, found = lines_of(root), list(functions(root))
    rank = {name: k for k, name in enumerate(ROOMS)}
    for name in sorted(lines, key=lambda name: rank.get(name, len(rank))):
        print(f"    {lines[name]:6d} {name}")
    method = sum(lines[name] for name in METHOD)
    print(f"lines of the wheel: {sum(lines.values())}, of the method ({', '.join(METHOD)}): {method}")
    print("lines beside it, not installed:", ", ".join(f"{name} {n}" for name, n in lines_beside(root).items()))
    print(f"golden: {golden_bytes(root)} of at most {LARGEST_GOLDEN} bytes")
    print(f"modules at the root: {sum(1 for file in (root / 'reference' / 'endotsr').glob('*.py'))}")
    print(f"settings: {len(settings(root))}; commands: {len(commands(root))}")
    widest = max(found, key=lambda f: f.positional)
    wide = [f for f in found if f.positional > MOST_POSITIONAL]
    print(f"longest signature: {widest.positional} positional parameters ({widest.name})")
    print(f"functions with more than {MOST_POSITIONAL}: {len(wide)}")
    for f in sorted(wide, key=lambda f: -f.positional):
        print(f"    {f.positional:4d} {f.name}")
    long = [f for f in found if f.lines > LONGEST_FUNCTION]
    print(f"functions above {LONGEST_FUNCTION} lines: {len(long)}")
    for f in sorted(long, key=lambda f: -f.lines):
        print(f"    {f.lines:4d} {f.name}")
    print(f"functions of exactly {LONGEST_FUNCTION} lines: {sum(f.lines == LONGEST_FUNCTION for f in found)}")
    loose = untyped(root)
    print(f"lines with dict[str, Any]: {sum(loose.values())}:", ", ".join(f"{name} {n}" for name, n in loose.items()))
    up, round_ = upward(root), circles(root)
    print("imports that run up:", len(up), *up, sep="\n    ")
    print("circles:", len(round_), *round_, sep="\n    ")


if __name__ == "__main__":
    from endotsr.cli.parts.closed_pipe import until_closed

    sys.exit(until_closed(lambda: main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT)))
