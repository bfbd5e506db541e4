"""Colour planes of two views or of two moments are named, and those of one view are not."""

import cv2
import numpy as np
import pytest
from made_videos import files
from still_text import FRAMES, tissue

from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.colour_planes import FEWEST, ColourPlanes, displacement


def said(pictures):
    planes = ColourPlanes(len(pictures))
    for i, picture in enumerate(pictures):
        planes.add(i, np.ascontiguousarray(picture))
    return [(found.code, found.what) for found in planes.findings("clip")]


def shifted(picture, columns, plane=0):
    found = picture.copy()
    found[:, :, plane] = np.roll(picture[:, :, plane], columns, axis=1)
    return found


@pytest.mark.parametrize("plane", [0, 2])
def test_a_plane_that_is_displaced_is_named_with_its_way(plane):
    pictures = [tissue(i) for i in range(FRAMES)]
    assert said(pictures) == []
    ((code, what),) = said([shifted(picture, 5, plane) for picture in pictures])
    assert code == "shifted-colours" and "by (5.0, 0.0) px" in what and ("red", "green", "blue")[plane] in what


@pytest.mark.parametrize(("columns", "expected"), [(1, []), (2, ["shifted-colours"])])
def test_a_displacement_as_of_a_lens_is_within_the_limit(columns, expected):
    assert [code for code, _ in said([shifted(tissue(i), columns) for i in range(FRAMES)])] == expected


def test_few_frames_grey_pictures_flat_planes_and_a_minority_say_nothing():
    pictures = [tissue(i) for i in range(FRAMES)]
    moved = [shifted(picture, 5) for picture in pictures]
    assert said(moved[: FEWEST - 1]) == []
    assert len(said([*moved[:7], *pictures[7:]])) == 1 and said([*moved[:6], *pictures[6:]]) == []
    assert said([np.repeat(picture[:, :, :1], 3, axis=2) for picture in pictures]) == []
    flat = [picture * np.array([0, 1, 1], np.uint8) for picture in pictures]
    assert said(flat) == [] and displacement(np.zeros((40, 40)), np.ones((40, 40))) == (0.0, 0.0, 0.0, 0.0)
    noise = np.random.default_rng(0).integers(0, 255, (FRAMES, 64, 96, 3), np.uint8)
    assert said(list(noise)) == []


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting", "sinus_endoscopy"])
def test_recorded_clips_say_nothing(name):
    pictures = [read_picture(file) for file in sorted((data_folder(name) / "images").iterdir())[::6]]
    assert said(pictures) == []
    assert said([picture[256:512, 320:640] for picture in pictures]) == []
    moved = [shifted(picture, picture.shape[1] // 100) for picture in pictures]
    assert [code for code, _ in said(moved)] == ["shifted-colours"]


@pytest.mark.data
def test_an_anaglyph_of_a_recorded_pair_is_named():
    video = cv2.VideoCapture(str(data_folder("surgt_davinci") / "video.mp4"))
    pairs = [np.asarray(video.read()[1], np.uint8)[:, :, ::-1] for _ in range(4)]
    halves = [np.hsplit(pair, 2) for pair in pairs]
    assert said([left for left, _ in halves]) == []
    assert [code for code, _ in said([np.dstack([one[:, :, 0], two[:, :, 1:]]) for one, two in halves])] == [
        "shifted-colours"
    ]


def test_prepare_and_check_name_it(tmp_path, capsys):
    files(tmp_path, "raw", [shifted(tissue(i), 5) for i in range(FRAMES)])
    words = ["--camera", "250", "250", "128", "96"]
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "clip"), *words]) == 0
    assert "warning: shifted-colours: in 12 of 12 frames" in capsys.readouterr().out
    main(["check", str(tmp_path / "clip")])
    assert "warning: shifted-colours:" in capsys.readouterr().out
