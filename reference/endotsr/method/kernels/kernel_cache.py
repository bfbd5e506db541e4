"""The folder of compiled kernels: one for all installations of the same sources, and never stale.

Numba's disk cache detects an edit of a kernel's own file, but not of the files that the kernel calls, and has a place
for each installation. Here the name of the folder contains a hash of all kernel sources, and within it a kernel has the
place of its file in the package. An edited kernel is compiled again; another environment or clone with the same sources
reads what is compiled.

The folder is in the user's cache, or in NUMBA_CACHE_DIR.
"""

import atexit
import functools
import hashlib
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numba
from numba.core.caching import CacheImpl, UserProvidedCacheLocator

_PACKAGE = Path(__file__).parents[2]
_COMPILES = re.compile(
    r"^ *from endotsr\.method\.kernels\.jit import|^from endotsr\.method\.kernels import jit", re.MULTILINE
)
_TAKES = re.compile(r"^from (endotsr[\w.]*) import (\([^)]*\)|[^\n(]+)", re.MULTILINE)


def kernel_sources() -> list[Path]:
    """Every source file whose text is part of a kernel.

    These are the files that compile something, and those from which they import a constant (a name in capitals) or a
    whole module. Other names cannot occur in a kernel, because kernels call compiled functions only.
    """
    files = {file: file.read_text(encoding="utf-8") for file in sorted(_PACKAGE.rglob("*.py"))}
    found = {file for file, text in files.items() if _COMPILES.search(text)} | set(
        (_PACKAGE / "method" / "kernels").glob("*.py")
    )
    grown = set(found)
    while grown:
        grown = {file for source in grown for file in _constants_from(files[source])} - found
        found |= grown
    return sorted(found)


def _constants_from(text: str) -> Iterator[Path]:
    """Files of the modules that a source imports, or imports constants from."""
    for module, names in _TAKES.findall(text):
        base = _PACKAGE.parent.joinpath(*module.split("."))
        for name in re.findall(r"\w+", names):
            if (base / f"{name}.py").is_file():
                yield base / f"{name}.py"
            elif name.isupper() and base.with_suffix(".py").is_file():
                yield base.with_suffix(".py")


@functools.cache
def kernel_source_hash() -> str:
    """First 16 hex digits of the SHA-256 over `kernel_sources` and the version of Numba."""
    digest = hashlib.sha256(numba.__version__.encode())
    for file in kernel_sources():
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def kernel_folder() -> Path:
    """The folder of the kernels of these sources. Other files that depend on them may be kept there."""
    from platformdirs import user_cache_dir

    chosen = os.environ.get("NUMBA_CACHE_DIR")
    return (Path(chosen) if chosen else Path(user_cache_dir("endotsr")) / "kernels") / kernel_source_hash()


class _PackageLocator(UserProvidedCacheLocator):
    """The place of a kernel of this package; other functions keep the places that Numba gives them."""

    def __init__(self, py_func: Callable, py_file: str) -> None:
        self._py_file = py_file
        self._lineno = py_func.__code__.co_firstlineno
        self._cache_path = str(kernel_folder() / Path(py_file).parent.relative_to(_PACKAGE))

    @classmethod
    def from_function(cls, py_func: Callable, py_file: str) -> "_PackageLocator | None":
        return cls(py_func, py_file) if Path(py_file).is_relative_to(_PACKAGE) else None

    def get_source_stamp(self) -> str:
        """The content of the file, because its time differs between installations."""
        return hashlib.sha256(Path(self._py_file).read_bytes()).hexdigest()


def use_kernel_folder() -> None:
    """Keep kernels that are compiled from now on in `kernel_folder`, or in a temporary folder if that is read-only."""
    folder = kernel_folder()
    if not _takes_files(folder):
        _use_passing_folder(folder)
    CacheImpl._locator_classes.insert(0, _PackageLocator)


def _takes_files(folder: Path) -> bool:
    """Whether files can be created there. If not, Numba would silently cache next to the sources, without the hash."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _use_passing_folder(wanted: Path) -> None:
    """Choose a temporary folder for this process and its children, removed at exit."""
    folder = tempfile.mkdtemp(prefix="endotsr-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = folder
    print(
        f"endotsr: warning: {wanted} is not writable: kernels are recompiled at every start;"
        " set NUMBA_CACHE_DIR to a writable folder",
        file=sys.stderr,
    )
