"""Every kernel compiles for the processors and systems that nobody here has; nothing is run on them."""

import subprocess
import sys
from pathlib import Path

import lowering
import pytest

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(3600)]


@pytest.fixture(scope="module")
def kernels():
    found = lowering.kernels()
    assert len(found) > 50
    return found


@pytest.mark.parametrize("target", lowering.TARGETS)
def test_every_kernel_compiles_for(target, kernels):
    machine = lowering.machine_of(target)
    failed = {}
    for name, text in kernels.items():
        try:
            assert len(lowering.compiled(text, machine)) > 100, name
        except RuntimeError as error:
            failed[name] = str(error).splitlines()[0]
    assert failed == {}


def test_kernels_call_nothing_that_a_system_lacks(kernels):
    assert {name for text in kernels.values() for name in lowering.called(text)} <= lowering.LIBRARY


def test_no_kernel_of_float32_calls_a_function_that_another_system_rounds_otherwise(kernels):
    rounding = {"expf", "logf", "log2f", "powf", "sinf", "cosf"}
    assert {
        name: lowering.called(text) & rounding for name, text in kernels.items() if lowering.called(text) & rounding
    } == {}


ALIEN = """
import sys, lowering
name = '@llvm.x86.avx.vzeroupper()'
text = f'declare void {name}\\ndefine void @f() {{\\n  call void {name}\\n  ret void\\n}}\\n'
lowering.compiled(text, lowering.machine_of(sys.argv[1]))
"""


@pytest.mark.parametrize("target, accepted", [("x86-64-v3", True), ("apple-m1", False)])
def test_code_for_another_processor_alone_is_refused(target, accepted):
    """An instruction of x86 in a kernel would be noticed: LLVM ends the process, so it has one of its own."""
    words = [sys.executable, "-c", ALIEN, target]
    done = subprocess.run(words, cwd=Path(lowering.__file__).parent, capture_output=True, text=True)
    assert (done.returncode == 0) == accepted, done.stderr
    assert accepted or "vzeroupper" in done.stderr
