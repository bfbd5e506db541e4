"""Single frames that are blurred are named, and frames of a clip that is soft as a whole are not."""

import cv2
import numpy as np
import pytest
from still_text import tissue

from data_folder import data_folder
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.blurred import BLURRED, blurred_findings
from endotsr.clips.sequences.checks.frames import frame_facts, frame_findings

AT = 4


def blurred(picture, sigma):
    return cv2.GaussianBlur(picture, (0, 0), sigma)


def by_motion(picture, length):
    return cv2.blur(picture, (length, 1))


def facts_of(pictures):
    return [frame_facts(f"{i:03d}.png", np.ascontiguousarray(picture)) for i, picture in enumerate(pictures)]


def named(pictures, facts=None):
    found = frame_findings(facts or facts_of(pictures), "clip")
    return [(f.frame, f.what) for f in found if f.code == "blurred-frame"]


def with_frames(pictures, change, *frames):
    return [change(picture) if i in frames else picture for i, picture in enumerate(pictures)]


@pytest.mark.parametrize("change", [lambda p: blurred(p, 2), lambda p: by_motion(p, 9)])
def test_single_frames_and_two_in_a_row_are_named(change):
    pictures = [tissue(i, step=1) for i in range(9)]
    assert named(pictures) == []
    ((frame, what),) = named(with_frames(pictures, change, AT))
    assert frame == AT and what.startswith("004.png has") and f"(limit {BLURRED:.0%})" in what
    assert [frame for frame, _ in named(with_frames(pictures, change, AT, AT + 1))] == [AT, AT + 1]
    assert named([change(picture) for picture in pictures]) == []


@pytest.mark.parametrize(("left", "expected"), [(1.05 * BLURRED, []), (0.95 * BLURRED, [3])])
def test_the_detail_that_is_left_has_a_limit_in_rows_and_in_columns(left, expected):
    names, grey = [str(i) for i in range(7)], [np.arange(12.0).reshape(3, 4)] * 7
    for axis in (0, 1):
        detail = np.full((7, 2), 0.1)
        detail[3, axis] *= left
        assert [f.frame for f in blurred_findings(detail, grey, names, np.ones(7, bool), "clip")] == expected
        assert blurred_findings(detail, grey, names, np.arange(7) != 2, "clip") == []
    focus = np.repeat([[0.1], [0.1], [0.1], [0.05], [0.05], [0.05], [0.05]], 2, axis=1)
    assert blurred_findings(focus, grey, names, np.ones(7, bool), "clip") == []
    assert blurred_findings(np.zeros((7, 2)), grey, names, np.ones(7, bool), "clip") == []


def test_an_instrument_that_covers_the_view_is_not_blurred():
    """It has no detail and does not resemble the frames beside it."""
    pictures = [tissue(i, step=1) for i in range(9)]
    ramp = np.repeat(np.linspace(90, 150, pictures[0].shape[1])[None, :, None], 3, axis=2)
    covered = np.broadcast_to(ramp, pictures[0].shape).astype(np.uint8)
    assert named(with_frames(pictures, lambda picture: covered, AT)) == []


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting", "sinus_endoscopy"])
def test_recorded_clips_have_no_such_frame_and_have_one_if_it_is_blurred(name):
    files = sorted((data_folder(name) / "images").iterdir())[:24]
    pictures = [read_picture(file) for file in files]
    for facts in (facts_of(pictures), facts_of([picture[256:512, 320:640] for picture in pictures])):
        assert [named([], facts[::every]) for every in (1, 2, 3)] == [[], [], []]
    whole = facts_of(pictures[:9])
    for change in (lambda p: blurred(p, 1), lambda p: blurred(p, 2), lambda p: by_motion(p, 5)):
        changed = frame_facts(f"{AT:03d}.png", np.ascontiguousarray(change(pictures[AT])))
        assert [frame for frame, _ in named([], [*whole[:AT], changed, *whole[AT + 1 :]])] == [AT]
