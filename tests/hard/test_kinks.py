"""Kinks and jumps from both sides: the one-sided slopes, the subgradient chosen there, the exact jump.

Kinks that are hard cases of the catalogue (the clamp, the cutoff and the stop of alpha; the bounds of scale, colour and
depth) have their tests beside the functions. The choices are those of docs/specification: sign(0) = 0, a clamp passes
no gradient where it is active, discrete decisions (near plane, cutoff, stop, order) are constants of the derivative.
"""

import numpy as np
import pytest
from made_up_scenes import Y00, run, screen_scene

from endotsr.method.equations.laplacian import laplacian_loss_forward, laplacian_loss_reverse, support_masks
from endotsr.method.losses.depth import depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.method.losses.smoothness import smoothness_forward, smoothness_reverse
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.covariance import covariance_forward
from endotsr.method.splatting.harmonics import harmonics_forward, harmonics_reverse
from endotsr.method.splatting.projection import projection_forward, projection_reverse
from endotsr.method.splatting.settings import PAPER

PIXEL = Camera(np.eye(3), np.zeros(3), 10.0, 10.0, 0.5, 0.5, 1, 1)
RGB = np.array([[0.9, 0.1, 0.6], [0.2, 0.8, 0.3], [0.5, 0.4, 0.7]])  # one column a splat
BACKGROUND = np.array([0.3, 0.6, 0.1])
G = np.array([1.0, -0.7, 0.4])


def sides(value, kink, h=1e-4):
    """((limit, slope) from below, (limit, slope) from above), by parabolas through three points of each side."""
    out = []
    for step in (-h, h):
        a, b, c = (value(kink + k * step) for k in (1, 2, 3))
        out.append((3 * a - 3 * b + c, (-5 * a + 8 * b - 3 * c) / (2 * step)))
    return out


# --- compositing (B5) ---


@pytest.mark.parametrize("path", ["definition", "blocks"])
def test_near_plane_jumps_by_the_whole_weight(path):
    """Closed on the hidden side: z = near is not drawn, the next number is."""

    def one(z):
        scene = screen_scene(PIXEL, 0.5, 0.5, [z, 3.0], 2.0, [0.6, 0.4], RGB[:, :2])
        nothing = np.zeros((1, 1))
        given = (G.reshape(3, 1, 1), nothing, nothing)
        images, back = run(scene, PIXEL, PAPER, path, background=BACKGROUND, given=given)
        return G @ images["colour"][:, 0, 0], back["position"][:, 0]

    behind = 0.4 * RGB[:, 1] + 0.6 * BACKGROUND
    hidden, shown = one(PAPER.near), one(np.nextafter(PAPER.near, 1))
    assert hidden[0] == pytest.approx(G @ behind, rel=1e-14) and not hidden[1].any()
    assert shown[0] - hidden[0] == pytest.approx(0.6 * (G @ (RGB[:, 0] - behind)), rel=1e-12)


# --- projection, colour (B3, B4) ---


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [-1, 1])
def test_clamp_of_the_jacobian_is_continuous_and_the_limit_itself_is_free(axis, sign):
    camera = Camera(np.eye(3), np.zeros(3), 32.0, 32.0, 16.0, 16.0, 32, 32)
    limit = PAPER.jacobian_clamp * 0.5  # 1.3 tan(fov / 2) = 1.3 * 32 / (2 * 32), at z = 1
    shape, _ = covariance_forward(np.array([[0.8], [0.1], [-0.2], [0.5]]), np.log([[0.3], [0.5], [0.2]]))
    weights = np.array([[0.7], [-0.4], [0.9]])

    def one(slope):
        position = np.array([[0.1], [0.2], [1.0]])
        position[axis] = sign * slope
        out, saved = projection_forward(position, shape, camera, PAPER)
        back = projection_reverse(np.zeros((2, 1)), weights, np.zeros(1), saved)
        return float((weights * out.covariance2d).sum()), sign * back.d_position[axis, 0]

    (low, below), (high, above) = sides(lambda x: one(x)[0], limit, 1e-3)
    assert low == pytest.approx(high, rel=1e-8) and abs(below) > 1 and above == pytest.approx(0, abs=1e-10)
    assert one(limit - 1e-9)[1] == pytest.approx(below, rel=1e-4) and one(limit + 1e-9)[1] == 0
    assert one(limit)[1] == pytest.approx(below, rel=1e-4)


def test_colour_of_exactly_zero_passes_the_gradient():
    """Y00 h = -1/2 exactly, by a residual that fills the last bit: the value before the clamp is +0."""
    h, extra = np.full((1, 3, 1), -0.5 / Y00), np.zeros((3, 1))
    for step in range(-8, 9):
        extra[:] = step * 2.0**-52
        _, saved = harmonics_forward(h, extra, np.ones((3, 1)), np.zeros(3), 0)
        before = 0.5 + Y00 * (h[0] + extra)
        passes = harmonics_reverse(np.ones((3, 1)), saved).d_harmonics[0] != 0
        np.testing.assert_array_equal(passes, before >= 0)


# --- losses (5), (B8), (B9) ---


@pytest.mark.parametrize("rule", ["co_sited", "half_pixel"])
def test_detail_loss_is_even_around_equality_with_subgradient_zero(rule):
    observed = np.random.default_rng(1).uniform(0.2, 0.8, (3, 16, 16))
    masks = support_masks(np.ones((16, 16), bool), 3, rule)

    def one(x):
        rendered = observed.copy()
        rendered[0, 7, 8] += x
        loss, saved = laplacian_loss_forward(rendered, observed, masks, rule)
        return loss, laplacian_loss_reverse(1.0, saved)

    (low, below), (high, above) = sides(lambda x: one(x)[0], 0.0)
    assert max(abs(low), abs(high)) <= 1e-15 and below == pytest.approx(-above, rel=1e-9) and above > 1e-3
    assert not one(0)[1].any()
    assert one(1e-3)[1][0, 7, 8] == pytest.approx(above, rel=1e-9)


def test_total_variation_of_equal_neighbours():
    """Five equal excluded pixels in a cross: slopes -4 and +4 steps, subgradient 0."""
    mask = np.ones((5, 5), bool)
    for row, column in ((2, 2), (1, 2), (3, 2), (2, 1), (2, 3)):
        mask[row, column] = False

    def one(x):
        rendered = np.where(mask, 0.0, 0.6)[None].copy()
        rendered[0, 2, 2] += x
        loss, saved = smoothness_forward(np.zeros((5, 5)), rendered, mask, np.zeros((5, 5), bool), 1.0)
        return loss, smoothness_reverse(1.0, saved).d_rendered[0, 2, 2]

    (low, below), (high, above) = sides(lambda x: one(x)[0], 0.0)
    assert low == pytest.approx(high, rel=1e-12)
    assert (below, above) == (pytest.approx(-4 / 25, rel=1e-9), pytest.approx(4 / 25, rel=1e-9))
    assert one(0)[1] == 0


def depth_case(rendered, prior):
    loss, saved = normalised_depth_forward(rendered, depth_target(prior, np.ones(rendered.shape, bool)))
    return loss, normalised_depth_reverse(1.0, saved)


def test_depth_guard_jumps_from_a_loss_without_scale_to_zero():
    """The loss does not depend on the size of the render, down to 1e-300; nothing rendered is 0 with gradient 0."""
    rng = np.random.default_rng(3)
    rendered, prior = rng.uniform(1, 2, (4, 5)), rng.uniform(40, 60, (4, 5))
    full, gradient = depth_case(rendered, prior)
    for size in (1e-3, 1e-150, 1e-300):
        loss, steep = depth_case(size * rendered, prior)
        assert loss == pytest.approx(full, rel=1e-13)
        np.testing.assert_allclose(steep * size, gradient, rtol=1e-12)
    for empty in (0.0 * rendered, -rendered):
        loss, gradient = depth_case(empty, prior)
        assert loss == 0 and not gradient.any()
