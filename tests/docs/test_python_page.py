"""The code of the Python guide: its camera is that of the command, its gradients are right, and its loss falls."""

import re
from pathlib import Path

import numpy as np
import pytest

import endotsr
from endotsr.results.views.cameras import shifted

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "python.md"
SIMULATOR = {"width": 48, "height": 32, "frames": 9}
POINTS = {"first_frame_points": 150, "other_frame_points": 40}
TIME = 0.37


def blocks(*marks):
    """The blocks of code of the page that contain these words, in order."""
    every = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    found = [block for mark in marks for block in every if mark in block]
    assert len(found) == len(marks)
    return "\n".join(found)


@pytest.fixture(scope="module")
def found():
    """The names of the page, on a small run in double precision."""
    sequence = endotsr.load_sequence("simulated", simulator=SIMULATOR)
    exact = {"precision": "float64", "threads": 1}
    run = endotsr.train(
        sequence,
        preset="demo",
        iterations=8,
        initialisation=POINTS,
        training=exact,
        raster={"preset": "exact"},
        on_message=lambda line: None,
    )
    names = {"endotsr": endotsr, "sequence": sequence, "run": run}
    exec(compile(blocks("moved =", "def brightness"), str(PAGE), "exec"), names)
    return names


def test_the_moved_camera_is_that_of_the_option(found):
    option = shifted(found["sequence"].cameras[0], (2.0, 0.0, 0.0))
    np.testing.assert_array_equal(found["moved"].translation, option.translation)
    assert found["moved"].translation[0] == found["sequence"].cameras[0].translation[0] - 2.0


def test_the_value_is_that_of_a_render(found):
    view = found["run"].render(TIME, found["moved"])
    assert found["value"] == view.colour.sum(dtype=np.float64)


@pytest.mark.parametrize("name", ["position", "harmonics", "fdm_weight", "fdm_centre", "motion_coefficients"])
def test_the_gradients_are_those_of_finite_differences(name, found):
    model, moved, gradients = found["run"].model, found["moved"], found["gradients"]
    assert set(gradients) == {key for key, array in model.gaussians._asdict().items() if array is not None}
    array, gradient = getattr(model.gaussians, name), gradients[name]
    step = 1e-5 * np.sign(gradient)  # no two directions cancel
    step *= np.abs(gradient) > 0.3 * np.abs(gradient).max()
    values = [
        found["brightness"](model.gaussians._replace(**{name: array + side * step}), model, moved, TIME)[0]
        for side in (1.0, -1.0)
    ]
    np.testing.assert_allclose((values[0] - values[1]) / 2, (gradient * step).sum(), rtol=1e-5)


def test_the_loss_of_the_page_falls(found):
    names = dict(found)
    exec(compile(blocks("adam_update("), str(PAGE), "exec"), names)
    losses = names["losses"]
    assert len(losses) == 20 and np.mean(losses[-5:]) < 0.5 * np.mean(losses[:5])
