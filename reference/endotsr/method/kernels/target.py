"""The processor that kernels are compiled for. Vector widths and the C library affect the last bits of results.

For Intel processors with AVX-512, LLVM prefers vectors of 32 bytes, half of a register, and calls this preference
`prefer-256-bit`. It is switched off here: blocks and lanes of the kernels fill whole registers (docs/bench.md has the
times).
"""

import hashlib
import platform
from typing import Any

import numba

FULL_VECTORS = ",-prefer-256-bit"


def compile_for_full_vectors() -> None:
    """Make Numba use whole AVX-512 registers. Call it before the first kernel is declared.

    Edges: nothing changes without AVX-512, and if NUMBA_CPU_NAME or NUMBA_CPU_FEATURES chooses the processor.
    """
    from numba.core.codegen import get_host_cpu_features

    if _config().CPU_NAME is None and _config().CPU_FEATURES is None:
        features = get_host_cpu_features()  # "" if LLVM does not know this processor
        if "+avx512f" in features:
            _config().CPU_FEATURES = features + FULL_VECTORS


def compiled_for() -> str:
    """The compile target of kernels, a string without spaces: everything that can change a rounding.

    On Linux with glibc and without variables of Numba it is the processor name. Another system, whose C library has
    other `exp` and `log`, and a digest of NUMBA_CPU_FEATURES are appended.
    """
    from llvmlite.binding import get_host_cpu_name

    name, features = _config().CPU_NAME, _config().CPU_FEATURES
    words = [name or get_host_cpu_name()]
    if not (platform.system() == "Linux" and platform.libc_ver()[0] == "glibc"):
        words.append(platform.system().lower())
    if features is not None and not features.endswith(FULL_VECTORS):
        words.append("features" + hashlib.sha256(features.encode()).hexdigest()[:8])
    return "-".join(words)


def _config() -> Any:
    return numba.config  # type: ignore[attr-defined]
