"""Flip one sign of the package at a time and run the notebooks that use it: one of them must fail.

The whole run by hand (hours): python tests/kernel_signs.py [module ...], for example method.equations.deformation
A sample, the same each time: python tests/kernel_signs.py --sample 10; a small one runs in the tests.
Each flip lives in a forked process: the module and all that import it are loaded anew there, compiled without the
disk cache.
"""

import ast
import hashlib
import importlib
import importlib.util
import os
import signal
import sys
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import notebook_signs

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "reference" / "endotsr"
# What the notebooks transcribe: the equations and the rooms that are made of them.
ROOMS = ("method.equations", "method.losses", "method.splatting")
SINGLE = (
    "training.fitting.adam",
    "training.fitting.objective",
    "training.fitting.schedules",
    "training.scene.density_control",
    "training.scene.initialisation",
)


@cache
def package_imports() -> dict[str, set[str]]:
    """Dotted module -> modules of the package that it imports."""
    found = {}
    for file in PACKAGE.rglob("*.py"):
        name = ".".join(("endotsr", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
        nodes = [n for n in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(n, ast.ImportFrom)]
        used = {n.module for n in nodes if n.module} | {f"{n.module}.{a.name}" for n in nodes for a in n.names}
        found[name] = {other for other in used if other.startswith("endotsr")}
    return found


@cache
def dependents(module: str) -> frozenset[str]:
    """The module and all that reach it by imports."""
    found, grown = {module}, True
    while grown:
        more = {name for name, uses in package_imports().items() if uses & found} - found
        grown = bool(more)
        found |= more
    return frozenset(found)


def notebooks_for(module: str) -> list[Path]:
    """Notebooks that import the module or what depends on it; the nearest first, and chapter 0, which trains, last."""
    near, far = [], []
    for file in sorted(notebook_signs.FOLDER.glob("*.py"), key=lambda file: (file.stem == "00_why", file)):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        uses = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module}
        if module in uses:
            near.append(file)
        elif uses & dependents(module):
            far.append(file)
    return near + far


def modules() -> list[str]:
    rooms = [
        f"endotsr.{room}.{file.stem}"
        for room in ROOMS
        for file in sorted(PACKAGE.joinpath(*room.split(".")).glob("[a-z]*.py"))
    ]
    return [*rooms, *(f"endotsr.{name}" for name in SINGLE)]


def source_of(module: str) -> str:
    return (PACKAGE.parent / Path(*module.split("."))).with_suffix(".py").read_text(encoding="utf-8")


def load_changed(module: str, source: str) -> None:
    """Put a changed module in the place of the original, and forget everything that was built on that."""
    import numba

    import endotsr.method.kernels.jit as compiler

    stale = dependents(module)
    for name in stale & set(sys.modules):
        del sys.modules[name]
    plain = numba.njit

    def uncached(*args, cache=False, **options):
        return plain(*args, **options)

    compiler.numba = ModuleType("numba")  # type: ignore[assignment]
    compiler.numba.njit = uncached  # type: ignore[attr-defined]
    spec = importlib.util.find_spec(module)
    assert spec is not None
    changed = importlib.util.module_from_spec(spec)
    sys.modules[module] = changed
    exec(compile(source, str(spec.origin), "exec"), changed.__dict__)


@cache
def load_package() -> None:
    """Import everything once, so that a process loads anew only what its change touches."""
    for name in package_imports():
        if not name.startswith(("endotsr.cli.main", "endotsr.cli", "endotsr.__main__")):
            importlib.import_module(name)


def noticed(module: str, source: str) -> bool:
    """Whether a notebook, or the import itself, fails with the changed module. Runs in a process of its own."""
    load_package()
    child = os.fork()
    if child == 0:
        signal.setitimer(signal.ITIMER_PROF, 300)  # s of processor time: a loop that never ends is noticed too
        sys.stdout = sys.stderr = open(os.devnull, "w")
        try:
            load_changed(module, source)
            bad = any(notebook_signs.notebook_fails(file) for file in notebooks_for(module))
        except BaseException:
            bad = True
        os._exit(1 if bad else 0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0


def flips(module: str) -> Iterator[tuple[str, str]]:
    """(source with one sign flipped, the line it is on) for every sign of the functions of a module."""
    source = source_of(module)
    for place in notebook_signs.signs_of(source):
        yield notebook_signs.flipped(source, place)


def sample(count: int) -> Iterator[tuple[str, str, bool]]:
    """(module, line, was it noticed) for the flips whose hash is lowest: edits elsewhere do not change the choice."""
    everything = [(module, *flip) for module in modules() for flip in flips(module)]
    everything.sort(key=lambda flip: hashlib.sha256(f"{flip[0]} {flip[2]}".encode()).digest())
    for module, source, line in everything[:count]:
        yield module, line, noticed(module, source)


def print_sample(count: int) -> int:
    """The number of flips of a sample that no notebook noticed."""
    found = []
    for module, line, good in sample(count):
        print("noticed " if good else "UNNOTICED", module, line, sep="  ", flush=True)
        found.append(good)
    return found.count(False)


def main(names: list[str]) -> int:
    """Print what survived; the exit status is the number of modules, or of signs of the sample, with survivors."""
    if names[:1] == ["--sample"]:
        return print_sample(int(names[1]))
    bad, known = 0, [module.removeprefix("endotsr.") for module in modules()]
    if unknown := [name for name in names if name not in known]:
        sys.exit(f"no module: {', '.join(unknown)}; use one of: {', '.join(known)}")
    for module in modules():
        if names and module.removeprefix("endotsr.") not in names:
            continue
        start, found = time.perf_counter(), list(flips(module))
        alive = [line for source, line in found if not noticed(module, source)]
        bad += notebook_signs.report(module, len(found), alive, start)
    return bad


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
