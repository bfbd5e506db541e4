"""Depth that did not fit its type is named; sound depth, normalised and clipped, is not."""

import numpy as np
import pytest

from data_folder import data_folder
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.checks.depth_wraps import WRAPPED, wrapped_part
from endotsr.clips.sequences.depth_files import read_plane

SIZE = (120, 160)


def relief() -> np.ndarray:
    """Depth of folds, 40 to 70 mm."""
    y, x = np.indices(SIZE)
    return 55 + 10 * np.sin(x / 25) * np.cos(y / 20) + x / 32


@pytest.mark.parametrize("per_mm, type_", [(10, np.uint8), (20, np.uint8), (100, np.uint8), (1000, np.uint16)])
def test_depth_that_did_not_fit_is_told_from_depth_that_did(per_mm, type_):
    exact = np.rint(relief() * per_mm).astype(np.int64)
    assert wrapped_part(exact.astype(type_)) > 2 * WRAPPED
    assert wrapped_part(np.minimum(exact, np.iinfo(type_).max).astype(type_)) == 0, "clipped"
    assert wrapped_part(exact.astype(np.int32)) == wrapped_part((exact / per_mm).astype(np.uint8)) == 0


def test_an_instrument_before_clipped_depth_is_no_such_step():
    """Both ends of the type lie beside one another; they are those of the frame."""
    low, high = np.percentile(relief(), (5, 80))
    stored = np.clip((relief() - low) / (high - low) * 254 + 1, 1, 255).astype(np.uint8)
    stored[40:80, :90] = 1
    assert (stored == 255).any() and wrapped_part(stored) == 0


@pytest.mark.parametrize("stored", [np.zeros(SIZE, np.uint8), np.full(SIZE, 7, np.uint16), relief().astype(np.float32)])
def test_no_depth_one_depth_and_fractions_have_no_step(stored):
    assert wrapped_part(stored) == 0


@pytest.mark.data
@pytest.mark.parametrize("clip", ["endonerf_pulling", "endonerf_cutting"])
def test_recorded_depth_fits(clip):
    files = sorted((data_folder(clip) / "depth").iterdir())[::8]
    assert max(wrapped_part(read_plane(file)) for file in files) < WRAPPED / 5


@pytest.mark.data
def test_rendered_depth_fits():
    assert wrapped_part(read_png(data_folder("c3vd_frame") / "depth_index_u8.png")) == 0
