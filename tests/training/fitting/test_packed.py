"""Targets in few bytes: masks and supports come back exactly, depths to half a step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endotsr.method.equations.laplacian import support_masks
from endotsr.method.losses.depth import depth_target
from endotsr.training.fitting.packed import (
    STEPS,
    packed_depth,
    packed_mask,
    packed_supports,
    unpacked_depth,
    unpacked_mask,
    unpacked_supports,
)


@given(st.integers(1, 19), st.integers(1, 19), st.integers(0, 2**32 - 1), st.sampled_from(["co_sited", "half_pixel"]))
def test_masks_and_supports_come_back_exactly(height, width, seed, rule):
    mask = np.random.default_rng(seed).random((height, width)) < 0.8
    packed = packed_mask(mask)
    assert packed.bits.nbytes == -(-mask.size // 8)
    again = unpacked_mask(packed)
    assert again.dtype == np.bool_
    np.testing.assert_array_equal(again, mask)
    found, wanted = unpacked_supports(packed_supports(mask, rule), mask, rule), support_masks(mask, upsampling=rule)
    assert found.upsampling == wanted.upsampling and found.image is mask
    for a, b in zip(found.bands, wanted.bands, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_pixel_between_two_frames_takes_the_bytes_that_the_docstring_states():
    mask = np.ones((512, 640), bool)
    supports = packed_supports(mask, "co_sited")
    image, depth, bits = 3 * 2, 2, 1 / 8  # uint16, uint16, and a bit each for the mask and for valid depth
    packed = image + depth + 2 * bits + sum(one.bits.nbytes for one in supports) / mask.size
    bands = unpacked_supports(supports, mask, "co_sited").bands
    whole = 4 * 3 + 4 + 2 + sum(band.nbytes for band in bands) / mask.size
    assert (round(packed, 1), round(whole, 1)) == (8.4, 19.3)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_depth_comes_back_to_half_a_step(dtype):
    rng = np.random.default_rng(5)
    depth, mask = rng.uniform(20, 90, (17, 23)).astype(dtype), rng.random((17, 23)) < 0.7
    depth[2, 3], depth[4, :5], depth[7, 7] = np.nan, 0.0, np.inf
    wanted = depth_target(depth, mask)
    found = unpacked_depth(packed_depth(wanted), dtype)
    assert found.normalised.dtype == dtype and found.count == wanted.count
    np.testing.assert_array_equal(found.valid, wanted.valid)
    assert np.abs(found.normalised - wanted.normalised).max() <= 0.501 / STEPS


def test_a_picture_without_any_depth_has_no_valid_pixel():
    mask = np.ones((5, 6), np.bool_)
    found = unpacked_depth(packed_depth(depth_target(np.zeros((5, 6), np.float32), mask)), "float32")
    assert found.count == 0 and not found.valid.any() and not found.normalised.any()
