"""Relations of a wrong array to the expected one: each is found where it holds, and not where it does not."""

import numpy as np
import pytest

from endotsr.port.judge.relate import relations

RIGHT = np.arange(1.0, 16.0).reshape(3, 5) ** 1.5
TURN = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
TURN = TURN @ TURN[:, [2, 0, 1]][[2, 0, 1]]  # about two axes
SCALE = np.array([0.5, 2.0, 3.0, 0.25, 1.5])


def first(got, others=None):
    found = relations(np.asarray(got, float), RIGHT, "max", 1e-12, others or {})
    return found[0].text if found else ""


@pytest.mark.parametrize(
    ("got", "text"),
    [
        (3 * RIGHT, "times 3"),
        (0.28209479177387814 * RIGHT, "times Y00"),
        (-RIGHT, "has the opposite sign"),
        (0 * RIGHT, "0 everywhere"),
        (RIGHT[[1, 0, 2]], "the entries of axis 0 stand in another order: [1, 0, 2]"),
        (RIGHT * [[1], [-1], [1]], "5 of 15 entries have the opposite sign"),
        (RIGHT * [[1], [0.5], [1]], "only at [1] of axis 0, there times 1/2"),
        (RIGHT - 0.5, "plus -0.5"),
        (np.minimum(RIGHT, 20.0), "clamped above 20"),
        (np.where(RIGHT > 50, np.nan, RIGHT), "2 of 15 entries not finite"),
        (RIGHT, ""),
    ],
)
def test_a_relation_is_found(got, text):
    assert first(got) == text


def test_matrices_and_factors_of_the_case_are_found():
    assert first(TURN @ TURN @ RIGHT, {"rotation_matrix": TURN}) == "multiplied by W (W where W^T is right)"
    assert first(RIGHT * SCALE, {"scale": SCALE}) == "times scale"
    assert first(RIGHT / SCALE, {"scale": SCALE}) == "times 1 / scale"


def test_noise_is_no_relation():
    noise = RIGHT * (1 + np.random.default_rng(0).uniform(0.1, 0.9, RIGHT.shape))
    assert first(noise, {"scale": SCALE}) == "every entry has another value"


def test_every_second_row_or_pixel_is_told():
    right, factor = np.arange(1.0, 43.0).reshape(6, 7), np.random.default_rng(0).uniform(2, 3, (6, 7))
    row, column = np.indices(right.shape) % 2
    for wrong, text in ((column == 1, "odd columns"), (row != column, "one even and one odd")):
        found = relations(np.where(wrong, factor * right, right), right, "max", 1e-12, {})
        assert any(one.text.startswith("only at ") and text in one.text for one in found)
    assert not any("odd" in one.text for one in relations(factor * right, right, "max", 1e-12, {}))
