"""Pictures without the colours that masks exclude."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from endotsr.clips.flow import tissue_colours as module
from endotsr.clips.flow.tissue_colours import tissue_colours
from endotsr.clips.opencv.regions import nearest_known
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.splatting.camera import Camera


def clip(masks, train=None):
    """Frame k of 6x8 pixels has colour 10 k + 1 on tissue and 255 where it is excluded."""
    masks = np.asarray(masks)
    count, height, width = masks.shape
    level = np.where(masks, 10 * np.arange(count)[:, None, None] + 1, 255)
    camera = Camera(np.eye(3), np.zeros(3), 9.0, 9.0, width / 2, height / 2, width, height)
    train = np.arange(count) if train is None else np.asarray(train)
    return Sequence(
        images=np.repeat(level[:, None], 3, axis=1).astype(np.uint8),
        masks=masks, depth=np.ones(masks.shape, np.float32), times=np.arange(count) / count,
        cameras=[camera] * count, names=[str(k) for k in range(count)], unit="scene units", static_camera=True,
        train_index=train, test_index=np.setdiff1d(np.arange(count), train),
    )  # fmt: skip


def masks(count):
    return np.ones((count, 6, 8), bool)


def test_an_excluded_pixel_has_the_colour_of_the_nearest_frame_with_tissue():
    excluded = masks(5)
    excluded[2, :3], excluded[1, 0] = False, False
    found = tissue_colours(clip(excluded), 2)
    assert (found[:, 0] == 31).all(), "frame 1 does not show the first row"
    assert (found[:, 1:3] == 11).all(), "of two equally near frames, the earlier"
    assert (found[:, 3:] == 21).all()
    assert (tissue_colours(clip(excluded, [0, 2, 4]), 2)[:, :3] == 1).all(), "held-out frames are not read"


def test_a_held_out_frame_keeps_its_own_tissue():
    excluded = masks(3)
    excluded[1, :2] = False
    found = tissue_colours(clip(excluded, [0, 2]), 1)
    assert (found[:, 2:] == 11).all() and (found[:, :2] == 1).all()


def test_a_pixel_that_no_frame_shows_has_the_colour_of_its_neighbour():
    excluded = masks(2)
    excluded[:, :, 5:] = False
    sequence = clip(excluded)
    sequence.images[1, :, 2, 4] = 77
    found = tissue_colours(sequence, 1)
    assert (found[:, 2, 5:] == 77).all() and (found[:, 0, 5:] == 11).all()


def test_frames_far_away_in_time_are_not_searched(monkeypatch):
    monkeypatch.setattr(module, "NEAREST", 3)
    excluded = masks(9)
    excluded[:8, 0] = False
    assert (tissue_colours(clip(excluded), 0)[:, 0] == 1).all(), "of the row below, not of frame 8"


def test_without_tissue_there_is_no_colour():
    assert not tissue_colours(clip(~masks(3)), 1).any()


@given(st.integers(2, 4).flatmap(lambda count: arrays(bool, (count, 6, 8))), st.data())
def test_excluded_colours_are_never_read(shown, data):
    sequence, again = clip(shown), clip(shown)
    again.images[...] = np.where(shown[:, None], again.images, data.draw(st.integers(0, 255)))
    for k in range(len(shown)):
        found = tissue_colours(sequence, k)
        np.testing.assert_array_equal(found, tissue_colours(again, k))
        assert (255 not in found) and (shown.any() == found.any())


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_pixel_is_nearest_within_two_percent(seed):
    missing = np.random.default_rng(seed).random((40, 60)) < 0.97
    found = np.array(np.unravel_index(nearest_known(missing), missing.shape))
    rows, columns = np.mgrid[:40, :60]
    known = np.argwhere(~missing)
    away = lambda y, x: np.hypot(y - rows, x - columns)
    least = np.min([away(y, x) for y, x in known], axis=0)
    assert not missing[tuple(found)].any() and (away(*found) <= 1.02 * least + 1e-9).all()


def test_the_frame_itself_is_one_of_the_nearest(monkeypatch):
    monkeypatch.setattr(module, "NEAREST", 2)
    excluded = masks(4)
    excluded[1, 0] = excluded[0, 0] = False
    assert (tissue_colours(clip(excluded), 1)[:, 0] == 11).all(), "of the row below: frame 2 is the third"
