"""Exposure of a frame, equation (B13), against its definition."""

import numpy as np
import pytest

from endotsr.definition import exposure as definition
from endotsr.method.equations.exposure import exposure_forward, exposure_reverse


@pytest.fixture
def case():
    rng = np.random.default_rng(13)
    return rng.uniform(-0.3, 1.4, (3, 6, 5)), rng.normal(0, 0.5, 3), rng.normal(0, 0.2, 3), rng.normal(size=(3, 6, 5))


@pytest.mark.parametrize("dtype, bound", [("float32", 4e-6), ("float64", 1e-14)])
def test_values_and_gradients_equal_the_definition(case, dtype, bound):
    colour, log_gain, bias, d_exposed = (a.astype(dtype) for a in case)
    exposed, saved = exposure_forward(colour, log_gain, bias)
    grads = exposure_reverse(d_exposed, saved)
    expected, wide = definition.exposure_forward(*(a.astype(float) for a in (colour, log_gain, bias)))
    wanted = definition.exposure_reverse(d_exposed.astype(float), wide)
    for found, right in zip((exposed, *grads), (expected, *wanted), strict=True):
        assert found.dtype == dtype
        np.testing.assert_allclose(found, right, rtol=bound, atol=bound)


def test_identity_changes_no_bit_and_writes_nothing_into_its_inputs(case):
    colour, log_gain, bias, _ = case
    before = [a.copy() for a in (colour, log_gain, bias)]
    np.testing.assert_array_equal(exposure_forward(colour, np.zeros(3), np.zeros(3))[0], colour)
    exposure_forward(colour, log_gain, bias)
    for now, then in zip((colour, log_gain, bias), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_an_empty_image_has_no_gradient():
    exposed, saved = exposure_forward(np.zeros((3, 0, 4)), np.ones(3), np.ones(3))
    grads = exposure_reverse(exposed, saved)
    assert exposed.shape == (3, 0, 4) and not grads.d_log_gain.any() and not grads.d_bias.any()


@pytest.mark.parametrize("log_gain, bias", [(np.zeros(2), np.zeros(3)), (np.zeros(3), np.zeros(1))])
def test_parameters_of_another_number_of_channels_are_refused(log_gain, bias):
    with pytest.raises(ValueError, match="3 channels: got log_gain"):
        exposure_forward(np.zeros((3, 2, 2)), log_gain, bias)
