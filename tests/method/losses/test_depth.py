"""Normalised depth loss (B8)."""

import numpy as np
import pytest

from endotsr.definition import depth as definition
from endotsr.method.losses.depth import FEWEST_VALID, depth_target, normalised_depth_forward, normalised_depth_reverse
from method.losses.made_up_images import tool_mask


def depths(seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(40, 70, (12, 17)), rng.uniform(40, 70, (12, 17))


def loss_and_gradient(rendered, prior, mask, d_loss=1.0):
    loss, saved = normalised_depth_forward(rendered, depth_target(prior, mask))
    return loss, normalised_depth_reverse(d_loss, saved)


def by_definition(rendered, prior, mask):
    loss, saved = definition.normalised_depth_forward(rendered, definition.depth_target(prior, mask))
    return loss, definition.normalised_depth_reverse(1.0, saved)


def test_the_target_is_zero_where_there_is_no_prior():
    prior = depths()[1]
    prior[0, :4] = 0.0, -3.0, np.nan, np.inf
    target = depth_target(prior, tool_mask())
    assert (target.normalised[0, :4] == 0).all() and not target.valid[0, :4].any()
    assert target.normalised[1:].min() > 0 and target.normalised.max() == 1


LARGEST = {"on tissue": [(0, 3)], "on the tool": [(5, 12)], "two equal ones": [(2, 2), (0, 9)]}


@pytest.mark.parametrize("place", LARGEST)
def test_hard_D3_equals_the_definition_wherever_the_largest_depth_is(place):
    """Two equal maxima: the gradient is split between them."""
    rendered, prior = depths()
    mask = tool_mask()
    for row, column in LARGEST[place]:
        rendered[row, column] = 90.0
    loss, gradient = loss_and_gradient(rendered, prior, mask)
    expected, expected_gradient = by_definition(rendered, prior, mask)
    assert loss == pytest.approx(expected, rel=1e-13)
    np.testing.assert_allclose(gradient, expected_gradient, rtol=1e-12, atol=0)
    assert (gradient[5, 12] != 0) == (place == "on the tool")


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_D2_faint_pixels_have_a_bounded_gradient(dtype):
    """Depth over its maximum, not 1 / depth: at D = 1e-6 the latter sends 1e12, this sends 1 / (n m) and no more."""
    rendered, prior = (a.astype(dtype) for a in depths())
    rendered[1, 1:8] = [1e-6, 1e-12, 1e-30, 0.0, 1e-37, 1e-3, 1.0]
    rendered[0, 0] = 90.0
    loss, gradient = loss_and_gradient(rendered, prior, tool_mask())
    assert gradient.dtype == dtype and np.isfinite(loss)
    n, largest = tool_mask().sum(), np.delete(np.abs(gradient), 0).max()  # the maximum itself holds the counterweight
    np.testing.assert_allclose(largest, 1 / (n * 90.0), rtol=8 * np.finfo(dtype).eps)
    np.testing.assert_allclose(np.abs(gradient[1, 1:8]), 1 / (n * 90.0), rtol=8 * np.finfo(dtype).eps)


def test_hard_D3_an_empty_render_has_no_loss():
    _, prior = depths()
    for rendered in (np.zeros((12, 17)), np.full((12, 17), -1.0), np.full((12, 17), np.nan)):
        loss, gradient = loss_and_gradient(rendered, prior, tool_mask())
        assert loss == 0.0
        assert not gradient.any()


@pytest.mark.parametrize("none", [0.0, -5.0, np.nan, np.inf, -np.inf])
def test_hard_D4_no_prior_means_no_residual(none):
    rendered, prior = depths()
    prior[:4] = none
    loss, gradient = loss_and_gradient(rendered, prior, tool_mask())
    with_zero, gradient_with_zero = loss_and_gradient(
        rendered, np.where(np.arange(12)[:, None] < 4, 0, prior), tool_mask()
    )
    assert loss == with_zero > 0
    assert np.array_equal(gradient, gradient_with_zero)
    assert np.count_nonzero(gradient[:4]) <= 1  # at most the pixel that holds the maximum


def test_hard_D4_fewer_than_ten_valid_pixels():
    rendered, prior = depths()
    mask = np.zeros((12, 17), bool)
    mask.flat[: FEWEST_VALID - 1] = True
    loss, gradient = loss_and_gradient(rendered, prior, mask)
    assert loss == 0.0
    assert not gradient.any()
    mask.flat[FEWEST_VALID - 1] = True
    loss, gradient = loss_and_gradient(rendered, prior, mask)
    assert loss > 0
    assert gradient.any()


@pytest.mark.parametrize("prior", [np.zeros((12, 17)), np.full((12, 17), np.nan)])
def test_hard_D4_no_prior_at_all(prior):
    loss, gradient = loss_and_gradient(depths()[0], prior, tool_mask())
    assert loss == 0.0
    assert not gradient.any()


def test_hard_D5_constant_depths_agree():
    loss, gradient = loss_and_gradient(np.full((12, 17), 55.0), np.full((12, 17), 20.0), tool_mask())
    assert loss == 0.0
    assert not gradient.any()


def test_hard_D6_depths_above_255_are_not_wrapped():
    rendered, prior = depths()
    loss, _ = loss_and_gradient(rendered, prior, tool_mask())
    assert loss_and_gradient(rendered + 300, prior + 300, tool_mask())[0] != loss
    assert loss_and_gradient(8 * rendered, 8 * prior, tool_mask())[0] == loss


def test_hard_L6_bad_values_under_the_mask_are_not_the_maximum():
    rendered, prior = depths()
    rendered[0, 3] = 90.0
    mask = tool_mask()
    loss, gradient = loss_and_gradient(rendered, prior, mask)
    for bad in (np.nan, np.inf):
        other, other_gradient = loss_and_gradient(np.where(mask, rendered, bad), prior, mask)
        assert other == loss
        assert np.array_equal(other_gradient[mask], gradient[mask])
        assert not other_gradient[~mask].any()


@pytest.mark.parametrize("prior_of_tool", [np.nan, np.inf, -np.inf, -3.0, 0.0, 1e-300, 39.0])
def test_hard_L6_a_prior_under_the_mask_that_is_not_the_maximum_changes_nothing(prior_of_tool):
    rendered, prior = depths()
    loss, gradient = loss_and_gradient(rendered, prior, tool_mask())
    prior[0, 3] = prior[tool_mask()].max()
    other, other_gradient = loss_and_gradient(rendered, np.where(tool_mask(), prior, prior_of_tool), tool_mask())
    here, here_gradient = loss_and_gradient(rendered, np.where(tool_mask(), prior, 0.0), tool_mask())
    assert other == here and np.array_equal(other_gradient, here_gradient)
    assert loss > 0 and gradient.any()


@pytest.mark.parametrize("prior_of_tool", [90.0, 1e4, 1e300])
def test_hard_L6_the_largest_prior_may_lie_under_the_mask(prior_of_tool):
    """The exception of (B8): one finite value there scales the prior of every pixel of the tissue."""
    rendered, prior = depths()
    mask = tool_mask()
    loss, _ = loss_and_gradient(rendered, prior, mask)
    prior[5, 12] = prior_of_tool  # on the tool
    other, _ = loss_and_gradient(rendered, prior, mask)
    by_hand = np.abs(rendered / rendered.max() - prior / prior_of_tool)[mask].mean()
    assert not mask[5, 12] and other == pytest.approx(by_hand, rel=1e-13) and other > 1.4 * loss


def test_float32():
    rendered, prior = (a.astype(np.float32) for a in depths())
    loss, gradient = loss_and_gradient(rendered, prior, tool_mask())
    wide, wide_gradient = loss_and_gradient(rendered.astype(float), prior.astype(float), tool_mask())
    assert gradient.dtype == np.float32
    assert abs(loss - wide) <= 4 * 2.0**-24
    np.testing.assert_allclose(gradient, wide_gradient, rtol=1e-5, atol=0)
