"""A result must not depend on how `parallel_for` cuts the tasks of a kernel: every task writes cells of its own."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from endotsr.port.gradcheck import all_pairs, one_thread, pair_stream

PAIRS = all_pairs()


def one_by_one_backwards(kernel, tasks, *arguments):
    """As `parallel_for`, with the smallest ranges there are, the last one first."""
    for task in range(tasks - 1, -1, -1):
        kernel(task, task + 1, *arguments)


def run_one_by_one(monkeypatch):
    """Every kernel gets its tasks one by one, in every module that calls `parallel_for`."""
    name, home = "parallel_for", "endotsr.method.kernels.threads"
    modules = [m for n, m in list(sys.modules.items()) if n.startswith("endotsr.") and n != home and hasattr(m, name)]
    assert len(modules) > 10, "the modules call it by another name: nothing would be tested"
    for module in modules:
        monkeypatch.setattr(module, name, one_by_one_backwards)


def case(name):
    """A pair with inputs and cotangents."""
    pair, rng = PAIRS[name], pair_stream(name, 3)
    inputs = pair.inputs(rng)
    return pair, inputs, {k: np.asarray(rng.standard_normal(np.shape(v))) for k, v in pair.forward(inputs).items()}


def both_passes(pair, inputs, cotangents):
    return dict(pair.forward(inputs)) | {f"gradient of {k}": v for k, v in pair.reverse(inputs, cotangents).items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(PAIRS))
def test_tasks_in_any_ranges_and_order_give_the_same_bits(name, monkeypatch):
    chosen = case(name)
    with one_thread():
        whole = both_passes(*chosen)
        run_one_by_one(monkeypatch)
        cut = both_passes(*chosen)
    assert whole.keys() == cut.keys()
    for key, value in whole.items():
        assert np.array_equal(value, cut[key]), key


@pytest.mark.slow
def test_pieces_of_any_length_without_the_compiler():
    file = Path(__file__).with_name("pieces_without_compiler.py")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(file)]
    done = subprocess.run(command, env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True)
    assert done.returncode == 0 and " passed" in done.stdout, done.stdout[-3000:]
