"""The processor that kernels are compiled for."""

import os
import subprocess
import sys

import numba
import pytest
from numba.core import codegen

from endotsr.method.kernels import target, vectors

WIDE = "+avx2,+avx512f"
ASSEMBLY = """
import numpy as np
from endotsr.method.kernels.jit import jit
def double(values):
    for i in range(values.size):
        values[i] += values[i]
kernel = jit(double)
kernel(np.ones(64, np.float32))
print("\\n".join(kernel.inspect_asm().values()))
"""


@pytest.fixture
def chosen(monkeypatch):
    """The features in force after `compile_for_full_vectors` with those of a processor and of the user."""

    def choose(here, name=None, features=None):
        monkeypatch.setattr(codegen, "get_host_cpu_features", lambda: here)
        monkeypatch.setattr("numba.config.CPU_NAME", name)
        monkeypatch.setattr("numba.config.CPU_FEATURES", features)
        target.compile_for_full_vectors()
        return numba.config.CPU_FEATURES

    return choose


def test_full_vectors_are_chosen_with_avx512_alone_and_never_against_the_user(chosen):
    assert chosen(WIDE) == WIDE + target.FULL_VECTORS
    assert chosen("+avx2") is None and chosen("") is None
    assert chosen(WIDE, features="+avx2") == "+avx2" and chosen(WIDE, name="x86-64-v3") is None


def test_the_width_of_vectors_is_no_part_of_the_target(chosen):
    chosen("")
    plain = target.compiled_for()
    chosen(WIDE)
    assert target.compiled_for() == plain
    chosen(WIDE, features=WIDE)
    assert target.compiled_for() != plain


@pytest.mark.skipif(vectors.REGISTER < 64 or numba.config.DISABLE_JIT, reason="kernels have no 64-byte vectors here")
def test_a_kernel_uses_registers_of_64_bytes(tmp_path):
    """Without kernels on the disk: of those, numba knows no assembly."""
    command, fresh = [sys.executable, "-c", ASSEMBLY], os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    assembly = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300, env=fresh).stdout
    assert "zmm" in assembly
