"""What holds for every loss with an operation, at the inputs of its gradient check."""

import numpy as np
import pytest

from endotsr.port.operations.losses import OPERATIONS

BY_NAME = {"argnames": "operation", "argvalues": OPERATIONS, "ids": [operation.name for operation in OPERATIONS]}


def made_up(operation):
    """Inputs that are differentiated, all inputs, and the settings."""
    (variant,) = operation.variants
    inputs = variant.inputs(np.random.default_rng(0))
    return inputs, inputs | variant.fixed(np.dtype(np.float64)), variant.settings


@pytest.mark.parametrize(**BY_NAME)
def test_nan_is_not_hidden_where_it_is_read(operation):
    """At the entry with the largest gradient, of every input."""
    inputs, given, settings = made_up(operation)
    outputs, saved = operation.forward(given, settings)
    gradients = operation.reverse(dict.fromkeys(outputs, np.array(1.0)), saved)
    for name, array in inputs.items():
        spoiled = array.copy()
        spoiled.flat[np.abs(gradients[f"d_{name}"]).argmax()] = np.nan
        (value,) = operation.forward(given | {name: spoiled}, settings)[0].values()
        assert np.isnan(value), name


@pytest.mark.parametrize(**BY_NAME)
def test_a_mask_that_is_not_boolean_or_does_not_fit_is_refused(operation):
    _, given, settings = made_up(operation)
    mask = given["mask"]
    for wrong in (mask * np.uint8(255), mask.astype(float), mask[:, 1:], np.stack([mask] * 3)):
        with pytest.raises(ValueError):
            operation.forward(given | {"mask": wrong}, settings)
