"""How kernels are compiled: the only module that calls `numba.njit`.

Kernels are plain module-level functions, compiled by assignment (`blend = jit(_blend)` or
`blend = jit(blend)`), so that the Python body stays visible to coverage and mutation tools. The formulas that they
carry to all items are compiled by the decorator `jit_formula`.

No fast-math: sums keep the order they are written in. The fast path may contract a*b+c into one fused
multiply-add (`contract=True`), which stays bitwise reproducible on one machine.

Kernels are serial; threads come from `endotsr.kernels.threads`, which calls one kernel for several ranges at once.
Numba's own parallel loops compile their body several times, and its OpenMP layer spins at every barrier: with one other
busy process on two cores, an iteration took 650 ms instead of 300.

Numba's disk cache notices an edit of the file that holds a kernel, but not of the files it calls into.
The cache therefore lives in a folder named after a hash of all kernel sources: an edited kernel is never stale.
"""

import atexit
import hashlib
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable)

_PACKAGE = Path(__file__).parents[1]
_COMPILES = re.compile(r"^ *from endotsr\.kernels\.jit import|^from endotsr\.kernels import jit", re.MULTILINE)
_TAKES = re.compile(r"^from (endotsr[\w.]*) import (\([^)]*\)|[^\n(]+)", re.MULTILINE)


def kernel_sources() -> list[Path]:
    """Every source file whose text is part of a kernel.

    These are the files that compile something, and those from which they take a constant (a name in capitals) or a
    whole module. No other name can reach the inside of a kernel: a function that is not compiled cannot be called.
    """
    files = {file: file.read_text(encoding="utf-8") for file in sorted(_PACKAGE.rglob("*.py"))}
    found = {file for file, text in files.items() if _COMPILES.search(text)} | set((_PACKAGE / "kernels").glob("*.py"))
    grown = set(found)
    while grown:
        grown = {file for source in grown for file in _constants_from(files[source])} - found
        found |= grown
    return sorted(found)


def _constants_from(text: str) -> Iterator[Path]:
    """Files of the modules that a source takes constants from, or takes whole."""
    for module, names in _TAKES.findall(text):
        base = _PACKAGE.parent.joinpath(*module.split("."))
        for name in re.findall(r"\w+", names):
            if (base / f"{name}.py").is_file():
                yield base / f"{name}.py"
            elif name.isupper() and base.with_suffix(".py").is_file():
                yield base.with_suffix(".py")


def kernel_source_hash() -> str:
    """First 16 hex digits of the SHA-256 over `kernel_sources` and the version of Numba."""
    digest = hashlib.sha256(numba.__version__.encode())
    for file in kernel_sources():
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def _use_hashed_cache_folder() -> None:
    if os.environ.get("NUMBA_CACHE_DIR"):
        return  # the caller chose the folder and is responsible for stale entries
    from platformdirs import user_cache_dir

    folder = Path(user_cache_dir("endotsr")) / "kernels" / kernel_source_hash()
    if not _takes_files(folder):
        folder = _passing_folder(folder)
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]


def _takes_files(folder: Path) -> bool:
    """Whether files can be created there. Otherwise Numba would silently cache beside the sources, without the hash."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _passing_folder(wanted: Path) -> Path:
    """A temporary folder for this process and its children, removed at exit."""
    folder = tempfile.mkdtemp(prefix="endotsr-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = folder
    print(
        f"endotsr: warning: {wanted} cannot be written: kernels are compiled anew at every start;"
        " set NUMBA_CACHE_DIR to a folder that can be written",
        file=sys.stderr,
    )
    return Path(folder)


_use_hashed_cache_folder()
if not os.environ.get("NUMBA_THREADING_LAYER"):
    numba.config.THREADING_LAYER = "workqueue"  # type: ignore[attr-defined]  # only its thread count is used


def jit(function: F, *, contract: bool = False) -> F:
    """Compile `function` on first call, for whatever dtypes it is called with.

    contract   allow fused multiply-add; for the fast path only
    """
    compiled: Any = numba.njit(
        cache=True,
        nogil=True,
        error_model="numpy",  # 1/0 is inf as in NumPy: one meaning with the JIT on or off
        fastmath={"contract"} if contract else False,
    )(function)
    return compiled  # to a type checker a kernel is the function it was made from


def jit_inline(function: F) -> F:
    """Compile a small helper that other kernels call; it is inlined into them and has no cache entry of its own."""
    compiled: Any = numba.njit(inline="always", error_model="numpy")(function)
    return compiled


def jit_formula(function: F) -> F:
    """Compile a formula of scalars and tuples of scalars; every kernel that calls it holds it inlined. A decorator.

    Unlike `jit_inline` it leaves the inlining to LLVM: types are inferred once for each dtype and not at every call,
    which halves the compilation of the projection. A local array of `vectors` must not be passed to it.
    """
    compiled: Any = numba.njit(forceinline=True, error_model="numpy")(function)
    return compiled
