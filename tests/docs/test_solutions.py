"""The answers of the page of solutions are right: each is computed once, by the definition or by hand."""

from pathlib import Path

import numpy as np
import pytest

from endotsr.definition.deformation import bell
from endotsr.definition.dictionary import atom_statistics, frequencies
from endotsr.definition.matern import matern_weights

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "solutions.md").read_text(encoding="utf-8")


def gradients_of_two_layers(alpha: float, colour: float, background: float) -> tuple[float, float]:
    """Central differences of the pixel with respect to both opacities, front to back; equation (B5)."""

    def pixel(front: float, back: float) -> float:
        return front * colour + (1 - front) * (back * colour + (1 - back) * background)

    step = 1e-6
    return (
        (pixel(alpha + step, alpha) - pixel(alpha - step, alpha)) / (2 * step),
        (pixel(alpha, alpha + step) - pixel(alpha, alpha - step)) / (2 * step),
    )


def test_two_equal_layers_have_equal_gradients():
    """Chapter 9: half the difference of colour and background, for both."""
    for colour, background in ((0.8, 0.1), (0.3, 0.3), (0.2, 0.9)):
        front, back = gradients_of_two_layers(0.5, colour, background)
        np.testing.assert_allclose([front, back], (colour - background) / 2, atol=1e-9)


@pytest.mark.parametrize("file", sorted((ROOT / "notebooks").glob("[0-9]*.py")), ids=lambda file: file.stem)
def test_every_chapter_has_an_answer(file):
    assert PAGE.count(f"**{{doc}}`notebooks/{file.stem}`.**") == 1


def test_only_the_sine_of_sixteen_cycles_can_be_dead():
    """Chapter 1."""
    omega = frequencies(8, 1.0, 16.0)
    dead = {n: np.flatnonzero(~(atom_statistics(np.arange(n) / n, omega).rms >= 1e-6)).tolist() for n in range(2, 81)}
    assert [n for n, atoms in dead.items() if 7 in atoms] == [2, 4, 8, 16, 32]
    assert {n: atoms for n, atoms in dead.items() if n >= 20 and atoms} == {32: [7]}


def test_the_reach_of_a_quartic_basis():
    """Chapter 4."""
    np.testing.assert_allclose(bell(0.0, 0.01, 0.0229, "quartic")[2], 1e-3, rtol=0.05)
    assert 0.0229 < 2 / 63, "three frames at most"


def test_the_weights_of_twice_the_correlation_length():
    """Chapter 5."""
    omega = frequencies(8, 1.0, 16.0)
    ends = [matern_weights(omega, length)[[0, -1]] for length in (0.2, 0.4)]
    np.testing.assert_allclose(ends, [[3.0e-5, 7.22], [2.5e-6, 7.25]], rtol=0.02)


def test_the_average_of_two_noisy_frames():
    """Chapter 14."""
    noise = np.random.default_rng(14).normal(size=(3, 200_000))
    gain = np.var(noise[2] - noise[0]) / np.var(noise[2] - noise[:2].mean(axis=0))
    np.testing.assert_allclose(10 * np.log10(gain), 1.25, atol=0.05)


def test_digits_of_the_determinant_of_a_needle():
    """Chapter 15."""
    long, short = np.float32(1e4), np.float32(1)
    a = b = c = (long**2 + short**2) / 2
    b = (long**2 - short**2) / 2
    assert abs((a * c - b * b) / (long * short) ** 2 - 1) > 0.1
