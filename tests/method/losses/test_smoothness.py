"""Smoothness terms (B9)."""

import numpy as np
import pytest

from endotsr.definition import smoothness as definition
from endotsr.method.losses.smoothness import smoothness_forward, smoothness_reverse
from method.losses.made_up_images import images, tool_mask

FACTOR = 30.0


def case(shape=(12, 17), seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(40, 70, shape), images((3, *shape), seed)[0], tool_mask(shape), rng.random(shape) < 0.1


def loss_and_gradients(depth, rendered, mask, edges, factor=FACTOR, d_loss=1.0):
    loss, saved = smoothness_forward(depth, rendered, mask, edges, factor)
    return loss, smoothness_reverse(d_loss, saved)


@pytest.mark.parametrize("shape", [(12, 17), (3, 5), (1, 7), (7, 1), (1, 1)])
def test_equals_the_definition(shape):
    depth, rendered, mask, edges = case(shape)
    loss, grads = loss_and_gradients(depth, rendered, mask, edges)
    expected, saved = definition.smoothness_forward(depth, rendered, mask, edges, FACTOR)
    d_rendered, d_depth = definition.smoothness_reverse(1.0, saved)
    assert loss == pytest.approx(expected, rel=1e-13)
    np.testing.assert_allclose(grads.d_rendered_depth, d_depth, rtol=0, atol=1e-13 * max(1e-9, np.abs(d_depth).max()))
    np.testing.assert_allclose(grads.d_rendered, d_rendered, rtol=1e-13, atol=0)


def test_border_pairs_are_kept():
    """One excluded pixel of value 1 in tissue has four steps to zero."""
    mask = np.ones((5, 5), bool)
    mask[2, 2] = False
    rendered = np.full((1, 5, 5), 7.0)
    rendered[0, 2, 2] = 1.0
    loss, grads = loss_and_gradients(np.zeros((5, 5)), rendered, mask, np.zeros((5, 5), bool), 1.0)
    assert loss == pytest.approx(4 / 25)
    assert grads.d_rendered[0, 2, 2] == pytest.approx(4 / 25)
    assert np.count_nonzero(grads.d_rendered) == 1


def test_images_are_not_clamped():
    depth, rendered, mask, edges = case()
    assert loss_and_gradients(depth, rendered + 5, mask, edges)[0] > loss_and_gradients(depth, rendered, mask, edges)[0]


def test_edges_stop_the_smoothing():
    """A step of 100 between columns 5 and 6 costs much, unless column 5 is an edge; the edge itself has no gradient."""
    depth, rendered, mask, _ = case()
    depth[:, 6:] += 100
    free, fenced = np.zeros((12, 17), bool), np.zeros((12, 17), bool)
    fenced[:, 5] = True
    kept, _ = loss_and_gradients(depth, rendered, mask, free, 0.0)
    cut, grads = loss_and_gradients(depth, rendered, mask, fenced, 0.0)
    assert kept > 3 * cut
    assert not grads.d_rendered_depth[:, 5].any()


def test_hard_L5_all_or_no_tissue():
    depth, rendered, _, edges = case()
    everything, nothing = np.ones((12, 17), bool), np.zeros((12, 17), bool)
    _, grads = loss_and_gradients(depth, rendered, everything, edges)
    assert not grads.d_rendered.any()
    assert loss_and_gradients(depth, rendered, nothing, edges, 0.0)[0] == 0.0
    assert not loss_and_gradients(depth, rendered, nothing, edges, 0.0)[1].d_rendered_depth.any()


def test_hard_L6_values_outside_each_term_do_not_matter():
    """The image on tissue is read by no term; depth on tissue edges is read by none either."""
    depth, rendered, mask, edges = case()
    loss, grads = loss_and_gradients(depth, rendered, mask, edges)
    for bad in (np.nan, np.inf, 1e300):
        other_depth = np.where(mask & edges, bad, depth)
        other, other_grads = loss_and_gradients(other_depth, np.where(mask, bad, rendered), mask, edges)
        assert other == loss
        assert np.array_equal(other_grads.d_rendered, grads.d_rendered)
        assert np.array_equal(other_grads.d_rendered_depth, grads.d_rendered_depth)


def test_hard_D6_depths_above_255_are_not_wrapped():
    depth, rendered, mask, edges = case()
    one, two = (loss_and_gradients(k * depth, rendered, mask, edges, 0.0)[0] for k in (1, 8))
    assert two == 64 * one


def test_float32():
    depth, rendered, mask, edges = case((40, 33))
    depth, rendered = depth.astype(np.float32), rendered.astype(np.float32)
    loss, grads = loss_and_gradients(depth, rendered, mask, edges)
    assert grads.d_rendered.dtype == grads.d_rendered_depth.dtype == np.float32
    wide, wide_grads = loss_and_gradients(depth.astype(float), rendered.astype(float), mask, edges)
    assert abs(loss - wide) <= 1e-6 * wide
    for narrow, exact in zip(grads, wide_grads):
        assert np.linalg.norm(narrow - exact) <= 1e-6 * np.linalg.norm(exact)
