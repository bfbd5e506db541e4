"""Compilation of kernels: the only module that calls `numba.njit`.

Kernels are plain module-level functions, compiled by assignment (`blend = jit(_blend)` or `blend = jit(blend)`). Their
Python bodies stay visible to coverage and mutation tools. The decorator `jit_formula` compiles the formulas that
kernels apply to all items.

No fast-math: sums keep their written order. The fast path may contract a*b+c into one fused multiply-add
(`contract=True`), which stays bitwise reproducible on one machine.

Kernels are serial; `endotsr.method.kernels.threads` calls one kernel for several ranges at once. Numba's own parallel
loops compile their body several times, and its OpenMP layer spins at every barrier: with another busy process, an
iteration takes longer.

Numba's disk cache detects an edit of a kernel's own file, but not of the files that the kernel calls. The name of the
cache folder therefore contains a hash of all kernel sources: an edited kernel is never stale.
"""

import atexit
import hashlib
import os
import re
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numba

# Numba's parallel loops, which no kernel uses, need semaphores; without /dev/shm it warns when it prepares them.
warnings.filterwarnings("ignore", message="Could not obtain multiprocessing lock", module=r"numba\.")

F = TypeVar("F", bound=Callable)

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
    """Whether files can be created there. If not, Numba would silently cache next to the sources, without the hash."""
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
        f"endotsr: warning: {wanted} is not writable: kernels are recompiled at every start;"
        " set NUMBA_CACHE_DIR to a writable folder",
        file=sys.stderr,
    )
    return Path(folder)


_use_hashed_cache_folder()
if not os.environ.get("NUMBA_THREADING_LAYER"):
    numba.config.THREADING_LAYER = "workqueue"  # type: ignore[attr-defined]  # only its thread count is used


def jit(function: F, *, contract: bool = False) -> F:
    """Compile `function` on first call, once for each combination of dtypes.

    contract   allow fused multiply-add; for the fast path only
    """
    compiled: Any = numba.njit(
        cache=True,
        nogil=True,
        error_model="numpy",  # 1/0 is inf as in NumPy: one meaning with the JIT on or off
        fastmath={"contract"} if contract else False,
    )(function)
    return compiled  # typed as the function it was compiled from


def jit_inline(function: F) -> F:
    """Compile a small helper that other kernels call; it is inlined into them and has no separate cache entry."""
    compiled: Any = numba.njit(inline="always", error_model="numpy")(function)
    return compiled


def jit_formula(function: F) -> F:
    """Decorator: compile a formula of scalars and tuples of scalars, to be inlined into every kernel that calls it.

    Unlike in `jit_inline`, LLVM does the inlining. Types are then inferred once per dtype instead of at every call,
    which halves the compile time of the projection. A local array of `vectors` must not be passed to a formula.
    """
    compiled: Any = numba.njit(forceinline=True, error_model="numpy")(function)
    return compiled
