"""Interpolation that obeys the masks: against a loop over pixels, exact answers, and blind to excluded pixels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_sequence import made_up

from data_folder import data_folder
from endotsr.errors import InputError
from endotsr.results.evaluation import tissue_baselines as tissue
from endotsr.results.evaluation.baselines import flow_interpolation, neighbours, two_neighbours
from endotsr.results.evaluation.metrics import psnr_tissue


def clip(seed: int, count: int = 7, test: tuple[int, ...] = (1, 4), size: tuple[int, int] = (6, 8)):
    """Random pictures and masks; about a third of the pixels is excluded."""
    rng = np.random.default_rng(seed)
    images = rng.integers(0, 256, (count, 3, *size), dtype=np.uint8)
    return made_up(images, list(test), rng.random((count, *size)) > 0.35)


def blended_pixel(sequence, index: int, row: int, column: int) -> np.ndarray:
    """The rule once more, one pixel at a time, without arrays of frames."""
    near = neighbours(sequence, index)
    total, weight = np.zeros(3), 0.0
    for k, w in ((near.before, 1 - near.fraction), (near.after, near.fraction)):
        if sequence.masks[k, row, column]:
            total, weight = total + w * sequence.images[k, :, row, column] / 255, weight + w
    if weight > 0:
        return total / weight
    order = sorted(sequence.train_index, key=lambda k: (round(abs(sequence.times[k] - sequence.times[index]), 9), k))
    shown = [k for k in order if sequence.masks[k, row, column]]
    return sequence.images[shown[0], :, row, column] / 255 if shown else np.zeros(3)


@pytest.mark.parametrize("seed", range(4))
def test_the_blend_is_that_of_a_loop_over_pixels(seed):
    sequence = clip(seed)
    for index in (1, 4):
        found = tissue.blend_tissue(sequence, index)
        for row in range(6):
            for column in range(8):
                expected = blended_pixel(sequence, index, row, column)
                np.testing.assert_allclose(found[:, row, column], expected, rtol=0, atol=1e-6)


def test_without_excluded_pixels_both_are_the_plain_baselines():
    rng = np.random.default_rng(0)
    smooth = np.cumsum(np.cumsum(rng.normal(size=(5, 3, 32, 40)), axis=2), axis=3)
    images = np.clip(128 + 4 * smooth, 0, 255).astype(np.uint8)
    sequence = made_up(images, [2])
    np.testing.assert_allclose(tissue.blend_tissue(sequence, 2), two_neighbours(sequence, 2), rtol=0, atol=1e-6)
    inside = (slice(None), slice(6, -6), slice(6, -6))
    plain, masked = flow_interpolation(sequence, 2), tissue.flow_tissue(sequence, 2)
    np.testing.assert_allclose(masked[inside], plain[inside], rtol=0, atol=1e-6)


@given(seed=st.integers(0, 10_000), name=st.sampled_from(["blend_tissue", "flow_tissue"]))
def test_no_excluded_value_and_no_held_out_value_is_read(seed, name):
    """The pictures may hold anything there: the prediction has the same bits."""
    sequence = clip(seed, size=(20, 24))
    predicted = [getattr(tissue, name)(sequence, index) for index in (1, 4)]
    other = np.random.default_rng(seed + 1).integers(0, 256, sequence.images.shape, dtype=np.uint8)
    sequence.images[:] = np.where(sequence.masks[:, None], sequence.images, other)
    sequence.images[[1, 4]], sequence.masks[[1, 4]] = other[[1, 4]], False
    for index, before in zip((1, 4), predicted, strict=True):
        np.testing.assert_array_equal(getattr(tissue, name)(sequence, index), before)


def test_a_hole_shows_the_frame_nearest_in_time_the_earlier_at_a_tie():
    images = np.broadcast_to((10 * np.arange(9, dtype=np.uint8))[:, None, None, None], (9, 3, 16, 16)).copy()
    masks = np.zeros((9, 16, 16), bool)
    masks[[2, 6]] = True  # both two frames from frame 4
    sequence = made_up(images, [4], masks)
    assert np.all(tissue.nearest_tissue(sequence, sequence.times[4]) == 20)
    for predict in (tissue.blend_tissue, tissue.flow_tissue):
        np.testing.assert_allclose(predict(sequence, 4), 20 / 255, rtol=0, atol=1e-6)
    masks[:] = False
    assert not tissue.blend_tissue(sequence, 4).any()


def test_an_instrument_between_two_frames_is_not_pasted():
    """Tissue that moves by 4 px, a bright tool in one neighbour: the plain flow shows the tool, this one does not."""
    rng = np.random.default_rng(3)
    wide = np.cumsum(rng.normal(size=(3, 64, 96)), axis=2)
    wide = np.round(80 + 40 * (wide - wide.mean()) / np.abs(wide).max()).astype(np.uint8)
    images = np.stack([wide[:, :, 8 - s : 88 - s] for s in (0, 2, 4)])
    masks = np.ones((3, 64, 80), bool)
    truth = images[1].copy()
    images[0, :, 20:40, 30:50] = 255
    masks[0, 20:40, 30:50] = False
    sequence = made_up(images, [1], masks)
    error = lambda predict: np.abs(predict(sequence, 1) - truth / 255)[:, 8:-8, 8:-8].max()
    assert error(flow_interpolation) > 0.3 and error(tissue.flow_tissue) < 0.2


def test_one_neighbour_and_none():
    sequence = clip(1, count=3, test=(2,), size=(16, 16))
    np.testing.assert_array_equal(tissue.flow_tissue(sequence, 2), tissue.blend_tissue(sequence, 2))
    alone = clip(1, count=1, test=(0,))
    for predict in (tissue.blend_tissue, tissue.flow_tissue):
        with pytest.raises(InputError, match="frame 0: no training frame"):
            predict(alone, 0)


@pytest.mark.data
@pytest.mark.parametrize("predict, expected", [("blend_tissue", 37.22), ("flow_tissue", 38.21)])
def test_known_figures_on_pulling(predict, expected):
    import endotsr

    sequence = endotsr.load_sequence(str(data_folder("endonerf_pulling")))
    made = getattr(tissue, predict)
    found = [psnr_tissue(made(sequence, i), sequence.images[i] / 255, sequence.masks[i]) for i in sequence.test_index]
    assert np.mean(found) == pytest.approx(expected, abs=0.05)
