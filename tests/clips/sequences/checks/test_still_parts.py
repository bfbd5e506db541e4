"""Burnt-in text and the border between two pictures are named where the rest moves, and nothing else is."""

import cv2
import msgspec
import numpy as np
import pytest
from made_videos import files
from still_text import FRAMES, HEIGHT, WIDTH, tissue, with_text

from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.still_parts import Edges, StillParts, plain_findings
from endotsr.clips.simulator.scenes import named_scene
from endotsr.clips.simulator.simulate import simulate


def said(pictures, masks=None):
    parts = StillParts(len(pictures))
    for i, picture in enumerate(pictures):
        parts.add(i, picture, None if masks is None else masks[i])
    return [(found.code, found.what) for found in parts.findings("clip")]


def test_text_is_named_with_its_place_and_moving_tissue_is_not():
    assert said([tissue(i) for i in range(FRAMES)]) == []
    ((code, what),) = said([with_text(tissue(i)) for i in range(FRAMES)])
    assert code == "burnt-in" and "where the rest moves" in what
    words = what.split()
    left, right = (int(words[words.index("columns") + k]) for k in (1, 3))
    assert 35 <= left < right <= 220


def test_an_inset_in_a_corner_is_named_and_the_blocks_of_jpeg_are_not():
    for rows, columns, corner in ((np.s_[:64], np.s_[-80:], "upper right"), (np.s_[-64:], np.s_[:80], "lower left")):
        pictures = [tissue(i) for i in range(FRAMES)]
        for i, picture in enumerate(pictures):
            picture[rows, columns] = 255 - cv2.resize(tissue(FRAMES - 1 - i), (80, 64), interpolation=cv2.INTER_AREA)
        ((code, what),) = said(pictures)
        width, height = map(int, what.split("about ")[1].split()[0].split("x"))
        assert code == "straight-border" and f"in the {corner} corner" in what
        assert abs(width - 80) <= 2 and abs(height - 64) <= 2
    jpeg = lambda picture: cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 15])[1], 1)
    assert said([jpeg(cv2.GaussianBlur(tissue(i), None, 2)) for i in range(FRAMES)]) == []


def test_excluded_text_a_still_scene_and_few_frames_say_nothing():
    pictures = [with_text(tissue(i)) for i in range(FRAMES)]
    outside = np.ones((HEIGHT, WIDTH), bool)
    outside[30:70] = False
    assert said(pictures, [outside] * FRAMES) == []
    assert said([with_text(tissue(0))] * FRAMES) == []
    assert said(pictures[:3]) == []


def test_masks_of_the_caller_stay_as_they_are():
    masks = np.ones((FRAMES, HEIGHT, WIDTH), bool)
    for i in range(FRAMES):
        masks[i, : 2 * i] = False
    before = masks.copy()
    said([tissue(i) for i in range(FRAMES)], masks)
    assert (masks == before).all()


def test_a_second_picture_and_grey_bars_are_named_with_their_border():
    beside = [np.hstack([tissue(i), 255 - tissue(FRAMES - 1 - i)]) for i in range(FRAMES)]
    ((code, what),) = said(beside)
    assert code == "straight-border" and any(f"column {WIDTH + k}:" in what for k in (-2, -1, 0, 1))
    below = [np.vstack([tissue(i), np.full((40, WIDTH, 3), 90, np.uint8)]) for i in range(FRAMES)]
    ((code, what),) = said(below)
    assert code == "straight-border" and any(f"row {HEIGHT + k}:" in what for k in (-2, -1, 0, 1))


def test_a_surround_of_one_colour_is_named_unless_it_is_excluded():
    rows, columns = np.ogrid[:HEIGHT, :WIDTH]
    outside = (rows - HEIGHT / 2) ** 2 + (columns - WIDTH / 2) ** 2 > 90**2
    shown = [np.where(outside[..., None], np.uint8(190), tissue(i)) for i in range(FRAMES)]
    ((code, what),) = said(shown)
    assert code == "plain-part" and "grey level 190" in what
    assert said(shown, [~outside] * FRAMES) == []


def test_smooth_parts_of_many_levels_are_no_part_of_one_colour():
    """As blocks of a compressed picture are."""
    flat, every = np.zeros((2, 40, 40)), np.ones((40, 40), bool)
    levels = np.kron(np.arange(100.0).reshape(10, 10), np.ones((4, 4)))
    assert plain_findings(Edges(levels, flat, every, 1.0), "clip") == []
    assert plain_findings(Edges(levels // 50 * 50, flat, every, 1.0), "clip") != []


@pytest.mark.parametrize("name", ["cutting", "moving-camera"])
def test_simulated_clips_have_no_such_parts(name):
    scene = simulate(msgspec.structs.replace(named_scene(name), width=256, height=192, frames=6)).sequence
    images, masks = scene.images, scene.masks
    assert said([np.ascontiguousarray(image.transpose(1, 2, 0)) for image in images], masks) == []


def test_text_on_a_recorded_clip():
    files = sorted((data_folder("sinus_endoscopy") / "images").iterdir())[::2]
    pictures = [np.ascontiguousarray(read_picture(file)[::3, ::3]) for file in files]
    assert said(pictures) == []

    def burnt(picture):
        cv2.putText(picture, "MEIER, A. 28.11.2026", (130, 90), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 1)
        return picture

    assert [code for code, _ in said([burnt(picture.copy()) for picture in pictures])] == ["burnt-in"]


def sharpened(picture, weight, radius=2.0):
    """An unsharp mask."""
    smooth = cv2.GaussianBlur(picture, (0, 0), radius).astype(np.float32)
    return np.clip(picture + weight * (picture - smooth), 0, 255).astype(np.uint8)


@pytest.mark.data
def test_a_sharpened_clip_has_no_text_and_text_on_it_is_named():
    video = cv2.VideoCapture(str(data_folder("surgt_davinci") / "video.mp4"))
    pictures = [np.ascontiguousarray(np.asarray(video.read()[1], np.uint8)[:, :1280, ::-1]) for _ in range(8)]
    for weight in (1, 2):
        assert said([sharpened(picture, weight) for picture in pictures]) == []
    texts = [cv2.putText(picture.copy(), "MEIER, A. 28.11.2026", (160, 160), cv2.FONT_HERSHEY_SIMPLEX, 2,
                         (255, 255, 255), 2) for picture in pictures]  # fmt: skip
    for weight in (0, 1):
        assert [code for code, _ in said([sharpened(picture, weight) for picture in texts])] == ["burnt-in"]


def test_a_still_scene_under_amplified_noise_says_nothing():
    """The noise moves the faint edges, and the clear ones stand still."""
    rng = np.random.default_rng(1)
    noisy = [
        np.clip(tissue(0) + rng.normal(0, 1.5, (HEIGHT, WIDTH, 1)), 0, 255).astype(np.uint8) for _ in range(FRAMES)
    ]
    assert said([sharpened(with_text(picture), 2) for picture in noisy]) == []


def test_prepare_and_check_name_it(tmp_path, capsys):
    files(tmp_path, "raw", [with_text(tissue(i)) for i in range(FRAMES)])
    words = ["--camera", "250", "250", "128", "96"]
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "clip"), *words]) == 0
    assert "warning: burnt-in: sharp edges stand still" in capsys.readouterr().out
    main(["check", str(tmp_path / "clip")])
    assert "warning: burnt-in:" in capsys.readouterr().out
