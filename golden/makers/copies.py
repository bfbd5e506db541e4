"""Wrong ports: copies of the reference with some changed lines of source.

In: edits, each a module of the package, the text to replace and its replacement. Out: the operations of a changed copy,
loaded in the same process as the reference, which remains unchanged.

If the changed lines may be part of a kernel, the copy runs without the compiler: compiling it for each mistake would
take too long, and the images of the golden cases are small enough. Otherwise only the changed modules and their
importers are reloaded, and the compiled kernels of the reference are used.
"""

import ast
import functools
import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, ModuleType
from typing import NamedTuple

import numba

import endotsr
from endotsr.port.operations.operation import Operation

PACKAGE = Path(endotsr.__file__).parent
ROOT = "endotsr"
SHARED = {ROOT, f"{ROOT}.errors", f"{ROOT}.method.kernels.jit"}  # the same objects in every copy
REGISTRY, CONTRACT = f"{ROOT}.port.operations.registry", f"{ROOT}.port.contract"


class Edit(NamedTuple):
    """A change of the source of one module. The old text must occur exactly `times` times."""

    module: str  # within the package, "method.losses.masked_l1"
    old: str
    new: str
    times: int = 1


def changed_text(module: str, edits: Sequence[Edit]) -> str:
    """The source of a module after the edits. Raises ValueError if an old text does not occur exactly `times` times."""
    text = _files()[f"{ROOT}.{module}"].read_text(encoding="utf-8")
    for edit in edits:
        if text.count(edit.old) != edit.times:
            raise ValueError(f"{module}: {edit.old!r} occurs {text.count(edit.old)} times, not {edit.times}")
        text = text.replace(edit.old, edit.new)
    return text


def without_compiler(edits: Sequence[Edit]) -> bool:
    """Whether a copy with these edits runs without the compiler: a module has kernels or their formulas."""
    return any(_holds_kernels(edit.module) for edit in edits)


@functools.cache
def _holds_kernels(module: str) -> bool:
    return ".kernels.jit import" in _files()[f"{ROOT}.{module}"].read_text(encoding="utf-8")


@contextmanager
def changed_copy(edits: Sequence[Edit]) -> Iterator[Callable[[str], Operation]]:
    """The operations, by name, of a copy of the reference with these edits; valid only inside the context.

    Raises: ValueError as `changed_text`.
    """
    names = {edit.module: f"{ROOT}.{edit.module}" for edit in edits}
    texts = {name: changed_text(module, [e for e in edits if e.module == module]) for module, name in names.items()}
    interpreted = without_compiler(edits)
    again = (set(_files()) if interpreted else _importers(frozenset(texts)) | {REGISTRY}) - SHARED
    again |= {above for name in again for above in _packages_above(name)} - SHARED  # they refer to modules by name
    before = {name: module for name, module in sys.modules.items() if name in again}
    finder, off = _Finder(again, texts), numba.config.DISABLE_JIT  # type: ignore[attr-defined]
    _exchange(again, {})
    sys.meta_path.insert(0, finder)
    numba.config.DISABLE_JIT = off or interpreted  # type: ignore[attr-defined]
    try:
        yield _operation
    finally:
        numba.config.DISABLE_JIT = off  # type: ignore[attr-defined]
        sys.meta_path.remove(finder)
        _exchange(again, before)


def _packages_above(name: str) -> list[str]:
    """`a`, `a.b` of `a.b.c`."""
    parts = name.split(".")
    return [".".join(parts[:k]) for k in range(1, len(parts))]


def _operation(name: str) -> Operation:
    for operation in importlib.import_module(CONTRACT).OPERATIONS:
        if operation.name == name:
            return operation
    return importlib.import_module(REGISTRY).method_operations()[name]


def _exchange(names: set[str], modules: Mapping[str, ModuleType]) -> None:
    """Replace the loaded modules of these names by others."""
    root = sys.modules[ROOT]
    for name in names:
        sys.modules.pop(name, None)
        if name.count(".") == 1 and hasattr(root, name.split(".")[1]):
            delattr(root, name.split(".")[1])
    sys.modules.update(modules)
    for name, module in modules.items():
        if name.count(".") == 1:
            setattr(root, name.split(".")[1], module)


class _Finder(importlib.abc.MetaPathFinder):
    """Finds the modules of a copy."""

    def __init__(self, names: set[str], texts: Mapping[str, str]) -> None:
        self.names, self.texts = names, texts

    def find_spec(self, fullname, path=None, target=None):
        """Find modules of the copy only; others are left to the usual finders."""
        if fullname not in self.names:
            return None
        file = _files()[fullname]
        loader = _Loader(fullname, str(file), self.texts.get(fullname))
        inside = [str(file.parent)] if file.name == "__init__.py" else None
        return importlib.util.spec_from_file_location(fullname, file, loader=loader, submodule_search_locations=inside)


class _Loader(importlib.machinery.SourceFileLoader):
    """Loads a module from its file, or from changed text."""

    def __init__(self, fullname: str, path: str, text: str | None) -> None:
        super().__init__(fullname, path)
        self.text = text

    def get_code(self, fullname):
        """The code of the text. That of an unchanged file is kept."""
        if self.text is not None:
            return compile(self.text, f"<{fullname} with a mistake>", "exec")
        return _code(self.path)


@functools.cache
def _code(path: str) -> CodeType:
    return compile(Path(path).read_bytes(), path, "exec")


@functools.cache
def _files() -> dict[str, Path]:
    """Every module of the package with its file."""
    found = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@functools.cache
def _imports() -> dict[str, set[str]]:
    """The modules of the package that each module imports."""
    found = {}
    for name, file in _files().items():
        wanted = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                wanted |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        found[name] = wanted & set(_files())
    return found


@functools.cache
def _importers(names: frozenset[str]) -> set[str]:
    """These modules and all that import one of them, directly or through others."""
    found = set(names)
    while grown := {name for name, wanted in _imports().items() if wanted & found} - found:
        found |= grown
    return found
