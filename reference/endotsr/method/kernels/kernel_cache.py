"""The folder of compiled kernels: one for all installations of the same sources, and never stale.

Numba's disk cache detects an edit of a kernel's own file, but not of the files that the kernel calls, and has a place
for each installation. Here the name of the folder contains a hash of all kernel sources, and within it a kernel has the
place of its file in the package. An edited kernel is compiled again; another environment or clone with the same sources
reads what is compiled.

The folder is in the user's cache, or in NUMBA_CACHE_DIR. Processes may write to it at once, and a file that a crash of
the system damaged counts as absent: its kernel is compiled again.
"""

import atexit
import contextlib
import functools
import hashlib
import os
import re
import shutil
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, UserProvidedCacheLocator

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


@functools.cache
def _digest(file: Path) -> str:
    """SHA-256 of the content; "" for what is no file, as a cell of a notebook."""
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""


class _Locator(UserProvidedCacheLocator):
    """The place of a kernel: that of its file in the package."""

    def __init__(self, py_func: Callable, py_file: str) -> None:
        file = Path(py_file)
        self._py_file = py_file  # Numba names it when it warns that a kernel cannot be kept
        self._code, self._lineno = py_func.__code__, py_func.__code__.co_firstlineno
        inside = file.parent.relative_to(_PACKAGE) if file.is_relative_to(_PACKAGE) else Path("others")
        self._cache_path = str(kernel_folder() / inside)

    @classmethod
    def from_function(cls, py_func: Callable, py_file: str) -> "_Locator":
        return cls(py_func, py_file)

    def get_source_stamp(self) -> str:
        """The content of the file, because its time differs between installations; without a file, the function."""
        code = self._code
        return (
            _digest(Path(code.co_filename)) or hashlib.sha256(repr((code.co_code, code.co_consts)).encode()).hexdigest()
        )


class _Places(CompileResultCacheImpl):
    """The place of a kernel is that of `_Locator` and no other, such as a folder beside the sources."""

    _locator_classes: ClassVar[list[type]] = [_Locator]


class _Files(IndexDataCacheFile):
    """The files of one kernel: an index, and one file for each combination of dtypes.

    Numba numbers the files by the index that it has read. Two processes that save different dtypes at once would give
    one name to both, and a later process would load the code of the wrong one. An empty or cut file can raise almost
    any exception when it is read.
    """

    def _data_name(self, number: int) -> str:
        """A name that no other process uses."""
        return f"{Path(self._index_name).stem}.{uuid.uuid4().hex[:12]}.nbc"

    def _load_index(self) -> dict[Any, str]:
        with contextlib.suppress(Exception):
            return super()._load_index()
        return {}

    def load(self, key: Any) -> Any:
        """The compiled code of a key; None if it is not there, or damaged."""
        with contextlib.suppress(Exception):
            return super().load(key)
        return None


class KernelCache(FunctionCache):
    """The kept code of one kernel, in `kernel_folder`."""

    _impl_class = _Places

    def __init__(self, py_func: Callable) -> None:
        super().__init__(py_func)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _Files(self._cache_path, self._impl.filename_base, stamp)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep compiled code; on a full disk it serves this process alone."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)


def use_kernel_folder() -> None:
    """Keep kernels that are compiled from now on in `kernel_folder`, or in a temporary folder if that is read-only."""
    folder = kernel_folder()
    if not _takes_files(folder):
        _use_passing_folder(folder)


def _takes_files(folder: Path) -> bool:
    """Whether files can be created there."""
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
