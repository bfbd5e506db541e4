"""The judge knows nothing of how vectors are made: its imports are read from the source and seen at run time."""

import ast
import subprocess
import sys
from pathlib import Path

import endotsr.port.judge

ROOM = Path(endotsr.port.judge.__file__).parent
FILES = ("endotsr.untrusted.files", "endotsr.untrusted.names", "endotsr.untrusted.writing")
OWN = ("endotsr", "endotsr.errors", "endotsr.port.judge", *FILES)
LIBRARIES = {"numpy", "msgspec", "pytest"}  # pytest by the tests of ports in Python


def imported(path: Path) -> set[str]:
    """Every module that a file imports, at its top or in a function."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module is not None, f"{path}: relative import"
            found.add(node.module)
    return found


def foreign(names: set[str]) -> set[str]:
    """Modules that the judge may not import."""
    own = {name for name in names if name in OWN or name.startswith("endotsr.port.judge.")}
    return {name for name in names - own if name.split(".")[0] not in LIBRARIES | sys.stdlib_module_names}


def test_the_judge_imports_numpy_msgspec_errors_checks_of_files_and_itself():
    files = sorted(ROOM.glob("*.py"))
    assert len(files) >= 10
    assert {path.name: foreign(imported(path)) for path in files if foreign(imported(path))} == {}


def test_what_is_foreign_is_told_apart():
    assert foreign({"endotsr.method.equations", "endotsr.port", "endotsr.port.reference", "numba"}) == {
        "endotsr.method.equations", "endotsr.port", "endotsr.port.reference", "numba",
    }  # fmt: skip
    assert foreign({"endotsr.port.judge.npy", "numpy.typing", "collections.abc"}) == set()


def test_nothing_of_the_method_is_loaded_with_the_judge():
    names = sorted(f"endotsr.port.judge.{path.stem}" for path in ROOM.glob("[!_]*.py"))
    script = f"import sys; import {', '.join(names)}; print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loaded = {name for name in done.stdout.split() if name.startswith("endotsr")}
    assert loaded == {"endotsr.port", "endotsr.untrusted", *OWN, *names}
    assert "numba" not in done.stdout.split()
