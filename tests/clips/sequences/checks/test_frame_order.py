"""Frames in another order than that of time are named, and motion, a cut and a still scene are not."""

import numpy as np
import pytest
from moving_pictures import recorded, tissue

from endotsr.clips.sequences.checks.frame_order import MOST, order_findings

COUNT = 48
AS_TEXT = [int(name) for name in sorted(str(i) for i in range(COUNT))]


def said(pictures, readable=None):
    names = [f"{i:03d}.png" for i in range(len(pictures))]
    readable = np.ones(len(pictures), bool) if readable is None else readable
    return [(f.code, f.frame, f.what) for f in order_findings(pictures, names, readable, "clip")]


def exchanged(count, *pairs):
    order = list(range(count))
    for a, b in pairs:
        order[a], order[b] = order[b], order[a]
    return order


def test_names_that_are_sorted_as_text_and_exchanged_frames_are_named_with_their_place():
    pictures = tissue(COUNT, period=150)
    assert said(pictures) == []
    ((code, frame, what),) = said([pictures[i] for i in AS_TEXT])
    assert (code, frame) == ("frame-order", 2) and "002.png" in what and f"({MOST} or more" in what
    ((code, frame, what),) = said([pictures[i] for i in exchanged(COUNT, (12, 33))])
    assert (code, frame) == ("frame-order", 12) and what.startswith("4 steps")


def test_three_breaks_are_too_few():
    """A part that stands elsewhere has three breaks: before it, behind it and where it was."""
    pictures = tissue(COUNT, period=150)
    order = [*range(8), *range(30, 36), *range(8, 30), *range(36, COUNT)]
    assert said([pictures[i] for i in order]) == []


def test_frames_without_any_order_are_named():
    pictures = tissue(COUNT, period=150)
    ((code, frame, what),) = said([pictures[i] for i in np.random.default_rng(2).permutation(COUNT)])
    assert code == "frame-order" and frame is None and "nearer than both neighbours" in what


def test_a_cut_a_still_scene_fast_motion_exposure_and_few_frames_say_nothing():
    pictures = tissue(COUNT, period=150)
    cut = [*pictures[:20], *[255 - picture for picture in pictures[20:]]]
    brighter = [picture * (1 + 0.3 * (i // 5 % 2)) for i, picture in enumerate(pictures)]
    still = [pictures[0] + np.random.default_rng(i).normal(0, 2, pictures[0].shape) for i in range(COUNT)]
    assert said(cut) == said(brighter) == said(still) == said(tissue(COUNT, period=12)) == []
    assert said([pictures[i] for i in AS_TEXT][:11]) == []
    dark = np.arange(COUNT) != 3
    assert said([pictures[i] for i in AS_TEXT], dark) == []


def test_motion_that_repeats_itself_is_in_order():
    """As breathing does: the same moment of another breath is nearer than the neighbours, and the steps are even."""
    breath, rng = tissue(40, period=40)[::4], np.random.default_rng(7)
    pictures = [breath[i % 10] + rng.normal(0, 2, breath[0].shape) for i in range(COUNT)]
    assert said(pictures) == []
    assert len(said([pictures[i] for i in rng.permutation(COUNT)])) == 1


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting", "sinus_endoscopy"])
def test_recorded_clips_in_their_order_say_nothing_and_in_another_one_are_named(name):
    for pictures in recorded(name):
        assert [said(pictures[::every]) for every in (1, 2, 3)] == [[], [], []]
    pictures = recorded(name)[0]
    order = [int(i) for i in sorted(str(i) for i in range(len(pictures)))]
    assert [code for code, *_ in said([pictures[i] for i in order])] == ["frame-order"]
    assert [code for code, *_ in said([pictures[i] for i in exchanged(len(pictures), (9, 25))])] == ["frame-order"]
    shuffled = np.random.default_rng(3).permutation(len(pictures))
    assert [code for code, *_ in said([pictures[i] for i in shuffled])] == ["frame-order"]
