"""Pixels that training hardly shows and extrapolated frames: exact cases, a loop over pixels, joined windows."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_sequence import made_up

from data_folder import recorded_masks
from endotsr.clips.sequences.splits import every_eighth
from endotsr.results.evaluation import coverage as cover
from endotsr.results.evaluation.baselines import unit_image
from endotsr.results.evaluation.evaluate import evaluate_model, held_out_means
from endotsr.results.report.run_text import held_out_table


def clip(test=(1, 4), count=6, seed=0):
    rng = np.random.default_rng(seed)
    images = rng.integers(30, 200, (count, 3, 12, 16), dtype=np.uint8)
    return made_up(images, list(test), rng.random((count, 12, 16)) > 0.6)


@given(seed=st.integers(0, 1000))
def test_the_counts_are_those_of_a_loop_over_pixels_and_frames(seed):
    sequence = clip(seed=seed)
    seen = cover.times_seen(sequence)
    for row in cover.coverage(sequence, sequence.test_index, seen):
        never = once = tissue = 0
        for r in range(12):
            for c in range(16):
                if sequence.masks[row["frame"], r, c]:
                    shown = sum(bool(sequence.masks[k, r, c]) for k in (0, 2, 3, 5))
                    tissue, never, once = tissue + 1, never + (shown == 0), once + (shown == 1)
        assert row == {"frame": row["frame"], "tissue": tissue, "never_seen": never, "seen_once": once}


def test_a_moving_camera_is_not_counted():
    sequence = clip()
    object.__setattr__(sequence, "static_camera", False)
    assert cover.times_seen(sequence) is None
    result = evaluate_model(sequence, lambda i: unit_image(sequence, i) + np.float32(0.1))
    assert result["frames"]["coverage"] is None and "psnr_seen" not in result["held_out"]["mean"]


def test_an_error_on_unseen_pixels_alone_leaves_the_seen_ones():
    """Error 0.1 everywhere and 0.4 where training shows nothing or one frame: decibels by hand."""
    masks = np.ones((6, 12, 16), bool)
    masks[[0, 2, 3, 5], :3] = False  # rows 0 to 2 are never shown
    masks[5, 1] = True  # row 1 is shown once
    images = np.full((6, 3, 12, 16), 100, np.uint8)
    sequence = made_up(images, [1], masks)
    sequence.train_index[:] = [0, 2, 3, 4, 5]
    masks[4, :3] = False
    error = np.full((12, 16), 0.1, np.float32)
    error[:3] = 0.4
    result = evaluate_model(sequence, lambda i: unit_image(sequence, i) + error)["held_out"]["mean"]
    decibel = lambda squared: -10 * math.log10(squared)
    assert result["psnr_seen_twice"] == pytest.approx(20, abs=1e-4)
    assert result["psnr_seen"] == pytest.approx(decibel((9 * 0.01 + 0.16) / 10), abs=1e-4)
    assert result["psnr_tissue"] == pytest.approx(decibel((9 * 0.01 + 3 * 0.16) / 12), abs=1e-4)


def test_a_frame_of_unseen_pixels_alone_has_no_value():
    mask, seen = np.ones((4, 4), bool), np.zeros((4, 4), np.int32)
    picture = np.full((3, 4, 4), 0.5)
    assert cover.seen_metrics(picture, picture + 0.1, mask, seen) == {"psnr_seen": None, "psnr_seen_twice": None}
    seen[:] = 1
    found = cover.seen_metrics(picture, picture + 0.1, mask, seen)
    assert found["psnr_seen"] == pytest.approx(20) and found["psnr_seen_twice"] is None


@pytest.mark.parametrize(
    ("test", "outside"), [((1, 4), []), ((0, 3), [0]), ((3, 5), [5]), ((4, 5), [4, 5]), ((0, 1, 5), [0, 1, 5])]
)
def test_frames_without_a_training_frame_on_one_side_are_extrapolated(test, outside):
    sequence = clip(test)
    assert cover.extrapolated(sequence, sequence.test_index) == outside


def test_extrapolated_frames_have_means_of_their_own():
    """20 dB between the training frames, 10 dB at the end: no mean of 15."""
    sequence = clip((1, 5))
    sequence.masks[:] = True
    error = {1: 0.1, 5: math.sqrt(0.1)}
    sequence.images[:] = 100
    result = evaluate_model(sequence, lambda i: unit_image(sequence, i) + np.float32(error.get(i, 0.01)))
    within, beyond = held_out_means(result, result["held_out"])
    assert within["psnr_tissue"] == pytest.approx(20, abs=1e-3) and beyond["psnr_tissue"] == pytest.approx(10, abs=1e-3)
    first, second = held_out_table(result).split("\n1 extrapolated")
    assert first.startswith("1 held-out frame ") and "20.00" in first.splitlines()[1]
    assert "10.00" in second.splitlines()[1] and "15.00" not in held_out_table(result)


def test_a_split_of_extrapolated_frames_alone_has_one_table():
    sequence = clip((4, 5))
    result = evaluate_model(sequence, lambda i: unit_image(sequence, i) + np.float32(0.1))
    assert held_out_means(result, result["held_out"]) == (result["held_out"]["mean"], {})
    assert "every held-out frame is extrapolated" in held_out_table(result)


def test_a_file_without_these_entries_is_still_shown():
    sequence = clip((1, 5))
    result = evaluate_model(sequence, lambda i: unit_image(sequence, i) + np.float32(0.1))
    del result["frames"]["extrapolated"], result["frames"]["coverage"]
    assert held_out_means(result, result["held_out"]) == (result["held_out"]["mean"], {})
    assert held_out_table(result).startswith("2 held-out frames")


@pytest.mark.data
def test_frame_73_of_cutting_shows_almost_nothing_that_training_does_not():
    """Its mask is unlike those of its neighbours, but of its 215410 pixels 31 are never seen and 57 once."""
    masks = np.stack(recorded_masks("endonerf_cutting", "masks"))
    sequence = made_up(np.zeros((len(masks), 3, 1, 1), np.uint8), list(every_eighth(len(masks))[1]), masks)
    (row,) = cover.coverage(sequence, [73], cover.times_seen(sequence))
    assert row == {"frame": 73, "tissue": 215410, "never_seen": 31, "seen_once": 57}
