"""Masks of noise are named; masks of instruments, thin ones too, are not."""

import cv2
import msgspec
import numpy as np
import pytest

from data_folder import data_folder, recorded_masks
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.checks.specks import MANY, Specks, speck_count
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene

SIZE = (240, 320)
PARTS = (0.01, 0.05, 0.2, 0.5)


def tool() -> np.ndarray:
    """Tissue but for an instrument from the border to the middle."""
    mask = np.ones(SIZE, np.uint8)
    cv2.line(mask, (0, 40), (180, 130), 0, 40)
    return mask > 0


def found(*masks):
    specks = Specks()
    for i, mask in enumerate(masks):
        specks.add(i, mask)
    return specks.findings("masks")


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("kind", ["salt and pepper", "exchanged", "excluded", "noise alone"])
def test_noise_is_named(part, kind):
    rng = np.random.default_rng(0)
    hit, value, mask = rng.random(SIZE) < part, rng.random(SIZE) < 0.5, tool()
    noisy = {
        "salt and pepper": np.where(hit, value, mask), "exchanged": mask ^ hit, "excluded": mask & ~hit,
        "noise alone": ~hit,
    }[kind]  # fmt: skip
    (warning,) = found(mask, noisy, mask)
    assert (warning.code, warning.level, warning.frame) == ("speckled-masks", "warning", 1)
    assert "1 of 3 masks" in warning.what and warning.what.endswith("frames 1") and "median" in warning.line
    assert part > 0.2 or not found(cv2.medianBlur(noisy.astype(np.uint8), 5) > 0), "the remedy helps"


def test_all_frames_are_in_one_sentence():
    noise = np.random.default_rng(0).random((12, *SIZE)) < 0.05
    (warning,) = found(*noise)
    assert warning.frame is None and "12 of 12 masks" in warning.what
    assert warning.what.endswith("frames 0, 1, 2, 3, 4 and 7 more")


def test_a_speck_differs_from_seven_of_its_eight_neighbours():
    mask = np.ones((9, 9), bool)
    mask[4, 4] = False
    assert speck_count(mask) == speck_count(~mask) == 1
    mask[3, 3] = False
    assert speck_count(mask) == 2, "two in a diagonal"
    mask[2, 2] = False
    assert speck_count(mask) == 2, "a line has ends"
    mask[3, 4] = False
    assert speck_count(mask) == 1


@pytest.mark.parametrize("width", [1, 2, 3])
def test_thin_instruments_are_no_noise(width):
    """Ten needles, sutures or wires in every direction, smooth or not."""
    rng = np.random.default_rng(0)
    for line in (cv2.LINE_4, cv2.LINE_8, cv2.LINE_AA):
        mask = np.full(SIZE, 255, np.uint8)
        for a, b in zip(rng.integers(0, 240, (10, 2)), rng.integers(0, 240, (10, 2)), strict=True):
            cv2.line(mask, a.tolist(), b.tolist(), 0, width, line)
        assert not found(mask > 127), line


@pytest.mark.parametrize("scene", ["cutting", "everything"])
def test_simulated_masks_are_no_noise(scene):
    settings = msgspec.structs.replace(named_scene(scene), frames=4, width=160, height=128)
    assert not found(*(frame.tissue for frame in simulated_frames(make_scene(settings))))


@pytest.mark.data
@pytest.mark.parametrize("clip", ["endonerf_pulling", "endonerf_cutting"])
@pytest.mark.parametrize("folder", ["masks", "gt_masks"])
def test_recorded_masks_are_no_noise(clip, folder):
    """Also at half of their size, where holes of the depth become single pixels."""
    masks = recorded_masks(clip, folder)
    assert max(speck_count(mask) / mask.size for mask in masks) < MANY / 30
    assert not found(*(mask[::2, ::2] for mask in masks))


@pytest.mark.data
def test_a_field_of_view_and_highlights_are_no_noise():
    assert not found(read_png(data_folder("sinus_endoscopy") / "mask.png") > 127)
    pictures = sorted((data_folder("endonerf_cutting") / "images").iterdir())[::20]
    assert not found(*(read_png(file).max(axis=2) < 200 for file in pictures))
