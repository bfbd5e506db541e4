"""Every kernel compiles for the processors and systems that nobody here has; nothing is run on them."""

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


def test_code_for_another_processor_alone_is_refused():
    """An instruction of x86 in a kernel would be seen."""
    text = 'define void @f() {\n  call void asm sideeffect "vzeroupper", ""()\n  ret void\n}\n'
    assert lowering.compiled(text, lowering.machine_of("x86-64-v3"))
    with pytest.raises((RuntimeError, SystemExit)):
        lowering.compiled(text, lowering.machine_of("apple-m1"))
