"""Relations of a wrong array to the expected one: each is found where it holds, and not where it does not."""

import numpy as np
import pytest

from endotsr.port.judge.compare import fingerprint
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
        (RIGHT[[1, 0, 2]], "axis 0 has the expected entries in the order [1, 0, 2]"),
        (RIGHT[[1, 2, 0]], "axis 0 has the expected entries in the order [1, 2, 0]"),
        (np.ascontiguousarray(RIGHT.T).reshape(3, 5), "written with axes 0 and 1 in the other order of memory"),
        (RIGHT * [[1], [-1], [1]], "5 of 15 entries have the opposite sign"),
        (RIGHT * [[1], [0.5], [1]], "only at [1] of axis 0, there times 1/2"),
        (RIGHT - 0.5, "plus -0.5"),
        ((1 + 3e-9) * RIGHT, "times 1 + 3e-09 (a constant rounded to float32 differs by up to 6e-8)"),
        (0.9995 * RIGHT, "times 1 - 0.0005"),
        (np.where(RIGHT > 30, RIGHT + 2.0, RIGHT), "only at [1, 2] of axis 0"),
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


HIDDEN = np.array([[4.5, 0.0, 7.25, 3.0, 9.0], [2.0, 0.0, 6.5, 1.5, 8.0]])  # Gaussian 1 is hidden


@pytest.mark.parametrize(
    ("shift", "text"),
    [((-0.5, 0.0), "plus (-0.5, 0) along axis 0, where it is wrong"),
     ((0.5, -0.25), "plus (0.5, -0.25) along axis 0, where it is wrong"),
     ((0.25, 0.25), "plus 0.25, where it is wrong")],
)  # fmt: skip
def test_an_offset_of_rows_is_told_though_hidden_gaussians_are_right(shift, text):
    seen = HIDDEN != 0
    got = HIDDEN + seen * np.array(shift)[:, None]
    texts = [r.text for r in relations(got, HIDDEN, "max", 1e-12, {"visible": seen[0]})]
    assert text in texts
    assert "only at every visible Gaussian of axis 1" in " ".join(texts)


@pytest.mark.parametrize(
    ("kind", "name"), [("float32", "single precision (2^-24)"), ("float16", "half precision (2^-11)")]
)
def test_the_size_of_rounding_errors_is_told(kind, name):
    right = np.sqrt(np.arange(1.0, 200.0))
    texts = [r.text for r in relations(right.astype(kind).astype(float), right, "max", 1e-12, {})]
    assert name in texts[-1]
    assert "precision" not in relations(right * (1 + 1e-4), right, "max", 1e-12, {})[-1].text
    assert "precision" not in relations(right + 3e-8 * np.abs(np.sin(right)), right, "max", 1e-12, {})[-1].text
    many_sizes = right * (1 + 1e-4 * np.sin(7 * right) * np.logspace(-3, 3, len(right)))
    assert "precision" not in relations(many_sizes, right, "max", 1e-12, {})[-1].text, "of very different sizes"


def test_long_lists_of_indices_are_counted():
    right = np.sqrt(np.arange(1.0, 101.0)).reshape(2, 50)
    got = right.copy()
    got[0, 3:40] *= np.linspace(1.1, 1.5, 37)
    assert "only at 37 of 50 indices of axis 1" in [r.text for r in relations(got, right, "max", 1e-12, {})]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("got", [np.full((3, 5), 1e308), np.where(RIGHT > 50, -1.7e308, RIGHT)])
def test_a_number_near_the_largest_neither_warns_nor_is_an_infinite_factor(got):
    said = [one.text for one in relations(got, RIGHT, "max", 1e-12, {"other": 1e300 * RIGHT})]
    assert said and not any("inf" in text or "nan" in text for text in said)


@pytest.mark.filterwarnings("error")
def test_a_fingerprint_that_overflows_does_not_warn():
    assert not np.isfinite(fingerprint("name", np.full(64, 1e308)))


@pytest.mark.parametrize("odd", [0, 1])
def test_both_colours_of_a_chessboard_are_found(odd):
    right = np.arange(1.0, 49.0).reshape(6, 8) ** 1.5
    row, column = np.indices(right.shape) % 2
    got = np.where(row ^ column == odd, 1.7 * right + np.sin(right), right)
    text = ("are both even or both odd", "are one even and one odd")[odd]
    found = [one.text for one in relations(got, right, "max", 1e-12, {})]
    assert f"only at pixels whose row and column {text}, counted from 0" in found
