"""A digital zoom between two frames is named with its factor, and motion is not."""

from itertools import islice

import cv2
import msgspec
import numpy as np
import pytest

from data_folder import data_folder
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.checks.frames import frame_facts, frame_findings
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene

HEIGHT, WIDTH, FRAMES, FIRST = 384, 480, 12, 6


def zoomed(picture, factor):
    """The middle of a picture, enlarged to its size, as a digital zoom shows it."""
    height, width = picture.shape[:2]
    h, w = round(height / factor), round(width / factor)
    top, left = (height - h) // 2, (width - w) // 2
    return cv2.resize(picture[top : top + h, left : left + w], (width, height), interpolation=cv2.INTER_LINEAR)


def said(pictures):
    facts = [frame_facts(f"{i:06d}.png", picture) for i, picture in enumerate(pictures)]
    return [(f.code, f.frame, f.what) for f in frame_findings(facts, "images") if "zoom" in f.code or "scene" in f.code]


@pytest.fixture(scope="module", params=["pulling", "moving-camera"])
def pictures(request):
    """The first half of a clip."""
    settings = msgspec.structs.replace(named_scene(request.param), frames=2 * FRAMES, width=WIDTH, height=HEIGHT)
    return [frame.image.transpose(1, 2, 0) for frame in islice(simulated_frames(make_scene(settings)), FRAMES)]


@pytest.mark.parametrize("factor", [1.15, 1.3, 1.6])
@pytest.mark.parametrize("way", ["larger", "smaller"])
def test_a_zoom_is_named_with_its_factor(pictures, factor, way):
    part = range(FIRST, FRAMES) if way == "larger" else range(FIRST)
    ((code, frame, what),) = said([zoomed(p, factor) if i in part else p for i, p in enumerate(pictures)])
    assert (code, frame) == ("zoom-jump", FIRST) and what.endswith(f" times {way}")
    found = float(what.split("png ")[-1].split(" ")[0])
    assert found == pytest.approx(factor, rel=0.04)


def test_motion_and_another_scene_are_no_zoom(pictures):
    assert said(pictures) == []
    other = np.random.default_rng(0).integers(0, 255, (16, 20, 3), np.uint8)
    other = cv2.resize(other, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    assert [(code, frame) for code, frame, _ in said([*pictures[:FIRST], *[other] * (FRAMES - FIRST)])] == [
        ("another-scene", FIRST)
    ]


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting"])
def test_recorded_clips_have_none_until_they_are_zoomed(name):
    recorded = [read_png(file)[..., :3] for file in sorted((data_folder(name) / "images").iterdir())]
    assert said(recorded) == []
    ((code, frame, what),) = said([*recorded[:30], *(zoomed(picture, 1.2) for picture in recorded[30:40])])
    assert (code, frame) == ("zoom-jump", 30) and "1.2" in what
