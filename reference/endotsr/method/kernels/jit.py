"""Compilation of kernels: the only module that calls `numba.njit`.

Kernels are plain module-level functions, compiled by assignment (`blend = jit(_blend)` or `blend = jit(blend)`). Their
Python bodies stay visible to coverage and mutation tools. The decorator `jit_formula` compiles the formulas that
kernels apply to all items. `kernel_cache` keeps what is compiled.

No fast-math: sums keep their written order. The fast path may contract a*b+c into one fused multiply-add
(`contract=True`), which stays bitwise reproducible on one machine.

Kernels are serial; `endotsr.method.kernels.threads` calls one kernel for several ranges at once. Numba's own parallel
loops compile their body several times, and its OpenMP layer spins at every barrier: with another busy process, an
iteration takes longer.
"""

import os
import warnings
from collections.abc import Callable
from typing import Any, TypeVar

import numba

from endotsr.method.kernels.kernel_cache import KernelCache, use_kernel_folder
from endotsr.method.kernels.target import compile_for_full_vectors

# Numba's parallel loops, which no kernel uses, need semaphores; without /dev/shm it warns when it prepares them.
warnings.filterwarnings("ignore", message="Could not obtain multiprocessing lock", module=r"numba\.")

F = TypeVar("F", bound=Callable)

use_kernel_folder()
compile_for_full_vectors()
if not os.environ.get("NUMBA_THREADING_LAYER"):
    numba.config.THREADING_LAYER = "workqueue"  # type: ignore[attr-defined]  # only its thread count is used


def jit(function: F, *, contract: bool = False) -> F:
    """Compile `function` on first call, once for each combination of dtypes.

    contract   allow fused multiply-add; for the fast path only
    """
    compiled: Any = numba.njit(
        nogil=True,
        error_model="numpy",  # 1/0 is inf as in NumPy: one meaning with the JIT on or off
        fastmath={"contract"} if contract else False,
    )(function)
    if hasattr(compiled, "_cache"):  # not with the JIT off
        compiled._cache = KernelCache(function)
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
