"""The answers of the page of solutions are right: each is computed once, by the definition or by hand."""

import numpy as np


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
    """Chapter 8: half the difference of colour and background, for both."""
    for colour, background in ((0.8, 0.1), (0.3, 0.3), (0.2, 0.9)):
        front, back = gradients_of_two_layers(0.5, colour, background)
        np.testing.assert_allclose([front, back], (colour - background) / 2, atol=1e-9)
