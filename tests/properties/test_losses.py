"""Properties of the image losses (5), (B6)-(B9) and of their masks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endotsr.method.equations.laplacian import laplacian_loss_forward, laplacian_loss_reverse, support_masks
from endotsr.method.losses.depth import depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.method.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.method.losses.masked_ssim import masked_ssim_forward, masked_ssim_reverse, ssim_target
from endotsr.method.losses.smoothness import smoothness_forward, smoothness_reverse
from properties.strategies import SEEDS, image_pairs, masks, poisons, shapes

RULES = st.sampled_from(["co_sited", "half_pixel"])
POWERS = st.integers(-6, 6).map(lambda k: 2.0**k)


def l1(rendered, observed, mask):
    loss, saved = masked_l1_forward(rendered, observed, mask)
    return loss, masked_l1_reverse(1.0, saved)


def ssim(rendered, observed, mask):
    value, saved = masked_ssim_forward(rendered, ssim_target(observed, mask))
    return value, masked_ssim_reverse(1.0, saved)


def detail(rendered, observed, mask, rule="co_sited"):
    loss, saved = laplacian_loss_forward(rendered, observed, support_masks(mask, 3, rule), rule)
    return loss, laplacian_loss_reverse(1.0, saved)


IMAGE_LOSSES = st.sampled_from([l1, ssim, detail, lambda *a: detail(*a, "half_pixel")])


@given(st.data(), shapes(40), RULES)
def test_more_tissue_never_makes_a_valid_value_invalid(data, shape, rule):
    larger = data.draw(masks(shape))
    smaller = larger & data.draw(masks(shape))
    for less, more in zip(support_masks(smaller, 3, rule).bands, support_masks(larger, 3, rule).bands):
        assert not (less & ~more).any()


@given(st.data(), shapes(40), RULES)
def test_valid_values_shrink_from_level_to_level_and_lie_on_tissue(data, shape, rule):
    mask = data.draw(masks(shape))
    found = support_masks(mask, 3, rule)
    assert not (found.bands[0] & ~mask).any()
    for level in range(2):
        fine, coarse = found.bands[level], found.bands[level + 1]
        assert not (coarse & ~fine[::2, ::2]).any()  # band j + 1 reads the reduced image that band j expands


@given(image_pairs(), st.data(), IMAGE_LOSSES)
def test_hard_L6_nothing_under_the_mask_matters(pair, data, loss):
    rendered, observed, mask = pair
    value, gradient = loss(rendered, observed, mask)
    dirt = [data.draw(poisons(rendered.dtype)) for _ in range(2)]
    dirty = [np.where(mask, image, rendered.dtype.type(bad)) for image, bad in zip((rendered, observed), dirt)]
    again, same = loss(*dirty, mask)
    assert again == value and np.array_equal(same, gradient)
    assert np.isfinite(value) and np.isfinite(gradient).all() and not gradient[:, ~mask].any()


@given(image_pairs(), IMAGE_LOSSES, st.permutations(range(3)))
def test_colour_channels_do_not_mix(pair, loss, order):
    rendered, observed, mask = pair
    order = list(order)
    value, gradient = loss(rendered, observed, mask)
    turned, back = loss(np.ascontiguousarray(rendered[order]), np.ascontiguousarray(observed[order]), mask)
    assert turned == pytest.approx(value, rel=1e-12, abs=1e-15)
    np.testing.assert_allclose(back, gradient[order], rtol=4 * np.finfo(rendered.dtype).eps, atol=0)


@given(image_pairs(), IMAGE_LOSSES)
def test_hard_L7_X1_equal_images_are_perfect_and_at_rest(pair, loss):
    _, observed, mask = pair
    value, gradient = loss(observed.copy(), observed, mask)
    assert value == (1.0 if loss is ssim else 0.0) and not gradient.any()


@given(image_pairs(), IMAGE_LOSSES)
def test_losses_are_symmetric_and_bounded(pair, loss):
    rendered, observed, mask = pair
    value, other = loss(rendered, observed, mask)[0], loss(observed, rendered, mask)[0]
    assert value == pytest.approx(other, rel=1e-6 if rendered.dtype == np.float32 else 1e-13)
    if loss is ssim:
        assert abs(value) <= 1 + 4 * np.finfo(rendered.dtype).eps
    else:
        assert 0 <= value <= 1.2 * 4  # a band of an image in [0, 1.2] is at most twice as wide


@given(image_pairs(), st.sampled_from([l1, detail]), POWERS)
def test_absolute_losses_are_of_degree_one(pair, loss, factor):
    rendered, observed, mask = pair
    factor = rendered.dtype.type(factor)
    value, gradient = loss(rendered, observed, mask)
    scaled, same = loss(factor * rendered, factor * observed, mask)
    assert scaled == float(factor) * value and np.array_equal(same, gradient)


@given(image_pairs(), IMAGE_LOSSES)
def test_a_transposed_image_has_the_same_loss(pair, loss):
    rendered, observed, mask = pair
    turn = lambda a: np.ascontiguousarray(np.swapaxes(a, -1, -2))
    value, gradient = loss(rendered, observed, mask)
    again, back = loss(turn(rendered), turn(observed), turn(mask))
    single = rendered.dtype == np.float32
    assert again == pytest.approx(value, rel=1e-5 if single else 1e-12, abs=1e-6 if single else 1e-14)
    if loss is l1:
        np.testing.assert_array_equal(turn(back), gradient)


@given(image_pairs(), SEEDS, POWERS, POWERS)
def test_neither_scale_of_the_depths_matters(pair, seed, one, two):
    """Powers of two: bitwise, and the gradient goes with 1 / scale."""
    _, _, mask = pair
    rng = np.random.default_rng(seed)
    rendered, prior = rng.uniform(1, 2, (2, *mask.shape))
    prior[rng.random(mask.shape) < 0.1] = 0.0
    results = []
    for a, b in ((1.0, 1.0), (one, two)):
        loss, saved = normalised_depth_forward(a * rendered, depth_target(b * prior, mask))
        results.append((loss, normalised_depth_reverse(1.0, saved) * a))
    assert results[0][0] == results[1][0]
    np.testing.assert_array_equal(*(gradient for _, gradient in results))
    assert abs(np.vdot(results[0][1], rendered)) <= 1e-13  # homogeneous of degree 0


@given(image_pairs(), SEEDS, st.floats(-5, 5))
def test_smoothness_of_tissue_depth_knows_no_offset(pair, seed, offset):
    rendered, _, mask = pair
    rng = np.random.default_rng(seed)
    depth, edges = rng.uniform(40, 60, mask.shape), rng.random(mask.shape) < 0.2
    image = rendered.astype(np.float64)
    loss, saved = smoothness_forward(depth, image, mask, edges, 0.0)
    moved, other = smoothness_forward(depth + offset, image, mask, edges, 0.0)
    assert moved == pytest.approx(loss, rel=1e-11, abs=1e-11)
    gradient, same = smoothness_reverse(1.0, saved), smoothness_reverse(1.0, other)
    np.testing.assert_allclose(same.d_rendered_depth, gradient.d_rendered_depth, rtol=1e-9, atol=1e-11)
    assert abs(gradient.d_rendered_depth.sum()) <= 1e-9 and not gradient.d_rendered.any()
