"""A result must not depend on the length of the pieces that a kernel takes its arrays in.

The lengths are compiled into the kernels, so `test_ranges.py` runs this file in a process without the compiler; there
they are set to a few numbers, and arrays of a dozen already have whole and broken pieces.
"""

import sys

import numpy as np
import pytest
from test_ranges import PAIRS, both_passes, case, run_one_by_one

from endotsr.method.equations.deformation import CHANNELS, deformation_forward, deformation_reverse
from endotsr.port.gradcheck import one_thread
from endotsr.training.fitting.adam import adam_state, adam_update
from endotsr.training.fitting.fused.coefficients import coefficients_adam_step
from endotsr.training.fitting.fused.deformation import NAMES, FdmArrays, deformation_adam_step

NAMES_OF_LENGTHS = (
    "GAUSSIANS_PER_TASK",
    "GAUSSIANS_PER_PIECE",
    "NUMBERS_PER_TASK",
    "GAUSSIANS_PER_BLOCK",
    "POSES_PER_SUM",
    "ROWS",
)


def shorten(monkeypatch, length):
    """Set the length of every piece."""
    changed = 0
    for module_name, module in list(sys.modules.items()):
        if module_name.startswith(
            (
                "endotsr.method.equations",
                "endotsr.method.splatting",
                "endotsr.method.losses",
                "endotsr.training.fitting",
            )
        ):
            for name in NAMES_OF_LENGTHS:
                if isinstance(getattr(module, name, None), int):
                    monkeypatch.setattr(module, name, length)
                    changed += 1
    assert changed >= 6


@pytest.mark.parametrize("length", [1, 4])
@pytest.mark.parametrize("name", list(PAIRS))
def test_pieces_of_any_length_give_the_same_numbers(name, length, monkeypatch):
    """To rounding: sums over pieces are added in another order."""
    chosen = case(name)
    with one_thread():
        whole = both_passes(*chosen)
        shorten(monkeypatch, length)
        cut = both_passes(*chosen)
        run_one_by_one(monkeypatch)
        alone = both_passes(*chosen)
    for key, value in whole.items():
        largest = np.abs(value).max(initial=0.0)
        np.testing.assert_allclose(cut[key], value, rtol=1e-9, atol=1e-12 * largest, err_msg=key)
        np.testing.assert_array_equal(cut[key], alone[key], err_msg=key)


@pytest.mark.parametrize("length, count", [(4, 11), (4, 8), (5, 9), (1, 3)])
@pytest.mark.parametrize("ranges", ["whole", "one by one"])
def test_adam_and_the_fused_step_in_pieces(length, count, ranges, monkeypatch):
    rng = np.random.default_rng(length)
    shape = (CHANNELS, 2, count)
    start = {name: rng.uniform(0.1, 0.9, shape) for name in NAMES}
    d_offsets = rng.normal(size=(CHANNELS, count))
    rates = dict.fromkeys(NAMES, 1e-2)

    def stepped(fused):
        parameters = {name: a.copy() for name, a in start.items()}
        state = adam_state(parameters)
        for t in (0.2, 0.6):
            _, saved = deformation_forward(*parameters.values(), t=t)
            if fused:
                fdm = FdmArrays(*parameters.values())
                ahead = deformation_adam_step(d_offsets, fdm, saved, state, rates, 0.9, 0.999, 1e-15, 0.4)
                np.testing.assert_array_equal(ahead, deformation_forward(*parameters.values(), t=0.4)[0])
            else:
                grads = dict(zip(NAMES, deformation_reverse(d_offsets, saved)[:3], strict=True))
                adam_update(state, parameters, grads, rates, 0.9, 0.999, 1e-15)
        return [*parameters.values(), *state.first.values(), *state.second.values()]

    with one_thread():
        whole = stepped(False)
        shorten(monkeypatch, length)
        if ranges == "one by one":
            run_one_by_one(monkeypatch)
        for fused in (False, True):
            for one, two in zip(stepped(fused), whole, strict=True):
                np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("length, count", [(4, 11), (4, 8), (1, 3)])
@pytest.mark.parametrize("ranges", ["whole", "one by one"])
def test_the_fused_step_of_coefficients_in_pieces(length, count, ranges, monkeypatch):
    rng = np.random.default_rng(length)
    start, d_sums = rng.normal(size=(3, 4, count)), rng.normal(size=(3, count))
    atoms, factors = rng.normal(size=4), rng.uniform(0.5, 1.5, 4)

    def stepped():
        parameter = start.copy()
        state = adam_state({"c": parameter})
        for _ in range(2):
            coefficients_adam_step(d_sums, atoms, factors, parameter, state, "c", {"c": 0.1}, 0.9, 0.999, 1e-15)
        return [parameter, state.first["c"], state.second["c"]]

    with one_thread():
        whole = stepped()
        shorten(monkeypatch, length)
        if ranges == "one by one":
            run_one_by_one(monkeypatch)
        for one, two in zip(stepped(), whole, strict=True):
            np.testing.assert_array_equal(one, two)
