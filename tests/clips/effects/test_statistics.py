"""What verdicts measure is what their texts say: of unusable depth, of the common gain, of the angle of the views."""

from dataclasses import replace

import numpy as np
import pytest

from endotsr.clips.effects.frames import reduced_frames
from endotsr.clips.effects.photometric import Ratios, error_of_median
from endotsr.clips.effects.seen import depth_verdict
from endotsr.clips.effects.views import largest_angle
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate

SEQUENCE = simulate(with_effects(SimulatorSettings(width=48, height=40, frames=12))).sequence


@pytest.mark.parametrize("value", [0.0, 50.0])
def test_depth_that_is_unusable_has_a_statistic_above_its_threshold(value):
    """A plane of one value has no holes, no steps and no flicker, and says as little as none."""
    sequence = replace(SEQUENCE, depth=np.full_like(SEQUENCE.depth, value))
    verdict = depth_verdict(sequence, reduced_frames(sequence))
    assert verdict.present and verdict.kind == "unusable" and not verdict.details["usable"]
    assert verdict.statistic > verdict.threshold and verdict.confidence > 0.99


def test_the_error_of_the_common_gain_is_that_of_pixel_noise_whatever_the_tiles_scatter():
    rng = np.random.default_rng(0)
    noise, level, tiles = np.full((3, 40), 0.01), np.ones(40), np.arange(40)
    calm, wild = (Ratios(s * rng.normal(size=(12, 3, 40)), noise, level, tiles) for s in (0.01, 1.0))
    np.testing.assert_array_equal(error_of_median(calm), error_of_median(wild))


def test_the_angle_of_the_views_is_from_the_first_frame():
    """Views at -5 and 5 degrees differ by 10 from one another, and by 5 from the first one between them."""
    angles = np.radians([0.0, -5.0, 5.0])
    directions = np.stack([np.sin(angles), np.zeros(3), np.cos(angles)], axis=1)
    assert np.degrees(largest_angle(directions)) == pytest.approx(5.0)
