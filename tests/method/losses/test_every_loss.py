"""What holds for every loss with a stage, at the inputs of its gradient check."""

import numpy as np
import pytest

from endotsr.port.stages.losses import STAGES

BY_NAME = {"argnames": "stage", "argvalues": STAGES, "ids": [stage.name for stage in STAGES]}


def made_up(stage):
    """Inputs that are differentiated, all inputs, and the settings."""
    (variant,) = stage.variants
    inputs = variant.inputs(np.random.default_rng(0))
    return inputs, inputs | variant.fixed(np.dtype(np.float64)), variant.settings


@pytest.mark.parametrize(**BY_NAME)
def test_nan_is_not_hidden_where_it_is_read(stage):
    """At the entry with the largest gradient, of every input."""
    inputs, given, settings = made_up(stage)
    outputs, saved = stage.forward(given, settings)
    gradients = stage.reverse(dict.fromkeys(outputs, np.array(1.0)), saved)
    for name, array in inputs.items():
        spoiled = array.copy()
        spoiled.flat[np.abs(gradients[f"d_{name}"]).argmax()] = np.nan
        (value,) = stage.forward(given | {name: spoiled}, settings)[0].values()
        assert np.isnan(value), name


@pytest.mark.parametrize(**BY_NAME)
def test_a_mask_that_is_not_boolean_or_does_not_fit_is_refused(stage):
    _, given, settings = made_up(stage)
    mask = given["mask"]
    for wrong in (mask * np.uint8(255), mask.astype(float), mask[:, 1:], np.stack([mask] * 3)):
        with pytest.raises(ValueError):
            stage.forward(given | {"mask": wrong}, settings)
