"""Two kinds of light in turn and flicker are named, and motion, breathing and exposures that settle are not."""

import numpy as np
import pytest
from moving_pictures import recorded, tissue

from endotsr.clips.sequences.checks.frames import FrameFacts, frame_findings
from endotsr.clips.sequences.checks.light import LONG, light_findings

NARROW_BAND = np.array([0.4, 1.0, 1.0])


def codes(pictures):
    return [found.code for found in light_findings(pictures, np.ones(len(pictures), bool), "clip")]


def in_turn(pictures, light):
    return [picture * light if i % 2 else picture for i, picture in enumerate(pictures)]


def flickering(pictures, amplitude, period):
    return [picture * (1 + amplitude * np.cos(2 * np.pi * i / period)) for i, picture in enumerate(pictures)]


def of_one_colour(pictures):
    """As the fluorescence of a dye is shown, every second frame."""
    return [
        picture.mean(axis=2, keepdims=True) * [0.2, 1, 0.3] if i % 2 else picture for i, picture in enumerate(pictures)
    ]


def test_two_kinds_of_light_in_turn_are_named():
    pictures = tissue(24)
    assert codes(pictures) == codes(pictures[::2]) == []
    assert codes(in_turn(pictures, NARROW_BAND)) == codes(of_one_colour(pictures)) == ["alternating-views"]
    (found,) = light_findings(in_turn(pictures, NARROW_BAND), np.ones(24, bool), "clip")
    assert "the limit is 1.3 times" in found.what


@pytest.mark.parametrize(("red", "expected"), [(0.97, []), (0.5, ["alternating-views"])])
def test_a_small_difference_of_the_light_is_less_than_the_motion(red, expected):
    assert codes(in_turn(tissue(24), np.array([red, 1, 1]))) == expected


@pytest.mark.parametrize("period", [2.0, 2.4, 3.0, 5.0])
def test_flicker_is_named_with_its_period_and_amplitude(period):
    (found,) = light_findings(flickering(tissue(48), 0.06, period), np.ones(48, bool), "clip")
    assert found.code == "flicker" and "brightness changes by" in found.what
    words = found.what.split()
    assert float(words[words.index("of") + 1]) == pytest.approx(period, rel=0.1)


def test_weak_slow_irregular_and_short_changes_are_no_flicker():
    pictures = tissue(48)
    assert codes(flickering(pictures, 0.015, 3.0)) == codes(flickering(pictures, 0.1, 12.0)) == []
    assert codes(flickering(pictures, 0.06, 3.0)[: LONG - 1]) == []
    steps = np.random.default_rng(0).choice([0.92, 1.08], 48)
    assert codes([picture * step for picture, step in zip(pictures, steps)]) == []


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting", "sinus_endoscopy"])
def test_recorded_clips_say_nothing_and_with_another_light_they_are_named(name):
    for pictures in recorded(name):
        assert [codes(pictures[::every]) for every in (1, 2, 3)] == [[], [], []]
    pictures = recorded(name)[0]
    assert codes(in_turn(pictures, NARROW_BAND)) == codes(of_one_colour(pictures)) == ["alternating-views"]
    assert codes(flickering(pictures, 0.05, 3.0)) == codes(flickering(pictures, 0.05, 2.4)) == ["flicker"]


@pytest.mark.parametrize(("ratio", "expected"), [(1.35, []), (1.45, [4]), (1 / 1.45, [4]), (1 / 1.35, [])])
def test_a_jump_of_the_exposure_has_a_limit(ratio, expected):
    """Of pictures that are equal otherwise."""
    facts = [
        FrameFacts(f"{i:03d}", np.clip(picture * (0.5 * ratio if i >= 4 else 0.5), 0, 255).astype(np.int16), 0.0, 0.0)
        for i, picture in enumerate([tissue(1)[0]] * 8)
    ]
    assert [f.frame for f in frame_findings(facts, "clip") if f.code == "exposure-jump"] == expected
