"""Every kink and every jump from both sides: the one-sided slopes, the subgradient chosen there, the exact jump.

The choices are those of docs/specification: sign(0) = 0, a clamp passes no gradient where it is active, discrete
decisions (near plane, cutoff, stop, order) are constants of the derivative.
"""

import numpy as np
import pytest
from made_up_scenes import Y00, run, screen_scene

from endotsr.method.equations.appearance import appearance_forward, appearance_reverse
from endotsr.method.equations.calibration import calibrate
from endotsr.method.equations.dictionary import DEAD_RMS, atom_statistics, normalise_forward, normalise_reverse
from endotsr.method.equations.laplacian import laplacian_loss_forward, laplacian_loss_reverse, support_masks
from endotsr.method.equations.matern import matern_weights
from endotsr.method.losses.depth import FEWEST_VALID, depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.method.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.method.losses.smoothness import smoothness_forward, smoothness_reverse
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.covariance import Shape, covariance_forward, covariance_reverse
from endotsr.method.splatting.harmonics import harmonics_forward, harmonics_reverse
from endotsr.method.splatting.projection import projection_forward, projection_reverse
from endotsr.method.splatting.settings import PAPER

PIXEL = Camera(np.eye(3), np.zeros(3), 10.0, 10.0, 0.5, 0.5, 1, 1)
RGB = np.array([[0.9, 0.1, 0.6], [0.2, 0.8, 0.3], [0.5, 0.4, 0.7]])  # one column a splat
BACKGROUND = np.array([0.3, 0.6, 0.1])
G = np.array([1.0, -0.7, 0.4])
PATHS = pytest.mark.parametrize("path", ["definition", "blocks"])


def sides(value, kink, h=1e-4):
    """((limit, slope) from below, (limit, slope) from above), by parabolas through three points of each side."""
    out = []
    for step in (-h, h):
        a, b, c = (value(kink + k * step) for k in (1, 2, 3))
        out.append((3 * a - 3 * b + c, (-5 * a + 8 * b - 3 * c) / (2 * step)))
    return out


def logit(alpha):
    return np.log(alpha) - np.log1p(-alpha)


def pixel_of(logits, path, settings=PAPER):
    """Loss <G, colour> of splats centred on the only pixel, and its gradient by the logits."""
    scene = screen_scene(PIXEL, 0.5, 0.5, 2.0 + np.arange(len(logits)), 2.0, 0.5, RGB[:, : len(logits)])
    scene.opacity_logit[:] = logits
    nothing = np.zeros((1, 1))
    given = (G.reshape(3, 1, 1), nothing, nothing)
    images, gradients = run(scene, PIXEL, settings, path, background=BACKGROUND, given=given)
    return G @ images["colour"][:, 0, 0], gradients["opacity_logit"]


# --- compositing (B5) ---


@PATHS
def test_clamp_of_alpha_is_continuous_and_passes_nothing_above(path):
    kink, behind = logit(0.99), 0.4 * RGB[:, 1] + 0.6 * BACKGROUND
    one = lambda x: pixel_of([x, logit(0.4)], path)
    (low, below), (high, above) = sides(lambda x: one(x)[0], kink)
    slope = 0.99 * 0.01 * (G @ (RGB[:, 0] - behind))
    assert low == pytest.approx(high, abs=1e-10)
    assert below == pytest.approx(slope, rel=1e-5) and above == pytest.approx(0, abs=1e-10)
    assert one(kink - 1e-9)[1][0] == pytest.approx(slope, rel=1e-6) and one(kink + 1e-9)[1][0] == 0
    assert one(kink)[1][0] in (0, pytest.approx(slope, rel=1e-6))  # 0.99 itself passes; a rounding above it does not


@PATHS
def test_cutoff_jumps_by_the_weight_and_the_slope_is_that_of_the_branch(path):
    kink = logit(1 / 255)
    one = lambda x: pixel_of([logit(0.3), x, logit(0.4)], path)
    (low, below), (high, above) = sides(lambda x: one(x)[0], kink)
    behind = 0.4 * RGB[:, 2] + 0.6 * BACKGROUND
    step = 0.7 * (G @ (RGB[:, 1] - behind))
    assert high - low == pytest.approx(step / 255, rel=1e-8)
    assert below == 0 and above == pytest.approx(step * (1 / 255) * (254 / 255), rel=1e-5)
    assert one(kink - 1e-9)[1][1] == 0 and one(kink + 1e-9)[1][1] == pytest.approx(above, rel=1e-5)


@PATHS
def test_stop_jumps_by_what_the_crossing_splat_and_all_behind_it_gave(path):
    """T = 0.1 in front of the second; with T (1 - alpha) below the stop of 0.05 it is dropped."""
    settings = PAPER._replace(transmittance_stop=0.05)
    one = lambda x: pixel_of([logit(0.9), x, logit(0.4)], path, settings)
    (low, below), (high, above) = sides(lambda x: one(x)[0], 0.0)
    step = G @ (RGB[:, 1] - BACKGROUND)
    assert high - low == pytest.approx(-0.1 * 0.5 * step, rel=1e-8)  # the third is beyond the stop on both sides
    assert below == pytest.approx(0.1 * 0.25 * step, rel=1e-5) and above == 0
    assert one(-1e-9)[1][1] == pytest.approx(below, rel=1e-5) and (one(1e-9)[1][1:] == 0).all()


@PATHS
def test_stop_is_open_a_transmittance_equal_to_it_is_still_blended(path):
    settings = PAPER._replace(alpha_max=0.5, transmittance_stop=0.25)  # alphas of exactly 1/2 by the clamp
    full, _ = pixel_of([5.0, 5.0, 5.0], path, settings)
    assert full == pytest.approx(G @ (0.5 * RGB[:, 0] + 0.25 * RGB[:, 1] + 0.25 * BACKGROUND), rel=1e-14)
    dropped, _ = pixel_of([5.0, 5.0, 5.0], path, settings._replace(transmittance_stop=np.nextafter(0.25, 1)))
    assert dropped == pytest.approx(G @ (0.5 * RGB[:, 0] + 0.5 * BACKGROUND), rel=1e-14)


@PATHS
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


# --- projection, covariance, colour (B2-B4) ---


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


@pytest.mark.parametrize("bound", [-40.0, 40.0])
def test_clip_of_the_log_scale_passes_on_the_bound_and_not_beyond(bound):
    one = lambda s: covariance_forward(np.array([[1.0], [0], [0], [0]]), np.full((3, 1), s))

    def gradient(s):
        return covariance_reverse(Shape(np.zeros((3, 3, 1)), np.ones((3, 1))), one(s)[1]).d_log_scale[0, 0]

    inside, beyond = sides(lambda s: one(s)[0].scale[0, 0] / np.exp(bound), bound)[:: 1 if bound > 0 else -1]
    assert inside == (pytest.approx(1, rel=1e-9), pytest.approx(1, rel=1e-6))
    assert beyond == (pytest.approx(1, rel=1e-14), 0)
    assert gradient(bound) == pytest.approx(np.exp(bound), rel=1e-14) and gradient(np.nextafter(bound, 2 * bound)) == 0


def test_colour_clamp_at_zero():
    def one(value):
        h = np.full((1, 3, 1), (value - 0.5) / Y00)
        colour, saved = harmonics_forward(h, None, np.ones((3, 1)), np.zeros(3), 0)
        return colour[0, 0], harmonics_reverse(np.ones((3, 1)), saved).d_harmonics[0, 0, 0] / Y00

    (low, below), (high, above) = sides(lambda x: one(x)[0], 0.0)
    assert (low, below) == (0, 0) and high == pytest.approx(0, abs=1e-15) and above == pytest.approx(1, rel=1e-10)
    assert one(-1e-12)[1] == 0 and one(1e-12)[1] == 1


def test_colour_of_exactly_zero_passes_the_gradient():
    """Y00 h = -1/2 exactly, by a residual that fills the last bit: the value before the clamp is +0."""
    h, extra = np.full((1, 3, 1), -0.5 / Y00), np.zeros((3, 1))
    for step in range(-8, 9):
        extra[:] = step * 2.0**-52
        _, saved = harmonics_forward(h, extra, np.ones((3, 1)), np.zeros(3), 0)
        before = 0.5 + Y00 * (h[0] + extra)
        passes = harmonics_reverse(np.ones((3, 1)), saved).d_harmonics[0] != 0
        np.testing.assert_array_equal(passes, before >= 0)


# --- losses (5), (B6), (B8), (B9) ---


def test_l1_has_slopes_plus_and_minus_one_and_subgradient_zero():
    observed = np.random.default_rng(0).uniform(0.2, 0.8, (3, 4, 5))
    mask = np.ones((4, 5), bool)
    mask[0, 0] = False

    def one(x):
        rendered = observed.copy()
        rendered[1, 2, 3] += x
        loss, saved = masked_l1_forward(rendered, observed, mask)
        return loss, masked_l1_reverse(1.0, saved)[1, 2, 3]

    (low, below), (high, above) = sides(lambda x: one(x)[0], 0.0)
    share = 1 / (3 * 19)
    assert low == pytest.approx(0, abs=1e-16) and high == pytest.approx(0, abs=1e-16)
    assert (below, above) == (pytest.approx(-share, rel=1e-10), pytest.approx(share, rel=1e-10))
    assert one(0)[1] == 0 and one(-1e-12)[1] == pytest.approx(-share) and one(1e-12)[1] == pytest.approx(share)


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


def depth_case(rendered, prior, mask=None):
    mask = np.ones(rendered.shape, bool) if mask is None else mask
    loss, saved = normalised_depth_forward(rendered, depth_target(prior, mask))
    return loss, normalised_depth_reverse(1.0, saved)


def test_shared_maximum_of_the_depth_takes_the_mean_of_both_slopes():
    rng = np.random.default_rng(2)
    rendered, prior = rng.uniform(40, 60, (5, 6)), rng.uniform(40, 60, (5, 6))
    rendered[1, 1] = rendered[3, 4] = 70.0
    prior[1, 1] = prior[3, 4] = 50.0

    def one(x):
        moved = rendered.copy()
        moved[1, 1] += x
        return depth_case(moved, prior)[0]

    (low, below), (high, above) = sides(one, 0.0, 1e-3)
    sign = np.sign(rendered / 70 - prior / prior.max())
    assert low == pytest.approx(high, rel=1e-10)
    assert below == pytest.approx(1 / (30 * 70), rel=1e-6)  # the other pixel holds the maximum
    assert above == pytest.approx(1 / (30 * 70) - (sign * rendered).sum() / (30 * 70**2), rel=1e-4)
    assert depth_case(rendered, prior)[1][1, 1] == pytest.approx((below + above) / 2, rel=1e-4)


def test_depth_residual_of_zero_has_subgradient_zero():
    rendered, prior = np.full((4, 5), 50.0), np.full((4, 5), 50.0)
    rendered[0, 0] = prior[0, 0] = 80.0
    loss, gradient = depth_case(rendered, prior)
    assert loss == 0 and not gradient.any()
    for sign in (-1, 1):
        moved = rendered.copy()
        moved[2, 2] += sign * 1e-6
        assert depth_case(moved, prior)[1][2, 2] == pytest.approx(sign / (20 * 80), rel=1e-12)


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


def test_depth_counts_ten_valid_pixels_and_not_nine():
    rendered, prior = np.linspace(1, 2, 20).reshape(4, 5), np.linspace(60, 40, 20).reshape(4, 5)
    for count in (FEWEST_VALID - 1, FEWEST_VALID):
        mask = (np.arange(20) < count).reshape(4, 5)
        loss, gradient = depth_case(rendered, prior, mask)
        assert (loss > 0) == gradient.any() == (count >= FEWEST_VALID)


# --- spectral parts (1b), (2), (4), (7) ---


def test_dead_atom_jumps_by_the_whole_normalised_value():
    """sin(2 pi t) at two stamps 0 and d has RMS pi d: just below 1e-6 the atom is 0, just above it is +-1."""
    values = []
    for factor in (1 - 1e-6, 1 + 1e-6):
        stamps = np.array([0.0, factor * DEAD_RMS / np.pi])
        statistics = atom_statistics(stamps, np.array([1.0]))
        raw = np.array([np.sin(2 * np.pi * stamps[1]), np.cos(2 * np.pi * stamps[1])])
        bar, saved = normalise_forward(raw, statistics)
        values.append((bar[0], normalise_reverse(np.ones(2), saved)[0]))
    assert values[0] == (0, 0)
    assert values[1] == (pytest.approx(1, rel=1e-9), pytest.approx(1 / DEAD_RMS, rel=1e-5))


def test_bounded_residual_has_no_kink_at_zero():
    one = lambda x: appearance_forward(np.full((3, 1, 1), x), np.ones(1), 0.3)
    (low, below), (high, above) = sides(lambda x: one(x)[0][0, 0], 0.0)
    assert low == pytest.approx(high, abs=1e-11) and below == pytest.approx(above, rel=1e-9)
    slope = appearance_reverse(np.ones((3, 1)), one(0.0)[1]).d_appearance_coefficients[0, 0, 0]
    assert slope == pytest.approx(0.3 / Y00, rel=1e-15) and below == pytest.approx(slope, rel=1e-6)


def test_the_two_forms_of_the_matern_weights_meet():
    """The form changes where length x largest frequency = sqrt 5; value and slope do not."""
    omega, length = np.geomspace(1, 16, 8), np.sqrt(5) / 16
    for f in range(8):
        (low, below), (high, above) = sides(lambda x, f=f: matern_weights(omega, x)[f], length, 1e-5)
        assert low == pytest.approx(high, rel=1e-12) and below == pytest.approx(above, rel=1e-6)


@pytest.mark.parametrize(("kink", "below", "above"), [(1.0, 0.0, 0.5), (4.0, 0.5, 0.0)])
def test_median_of_four_ratios_follows_the_middle_two(kink, below, above):
    """Ratios 1, 2, 4 and x: the median moves with half of x while x is one of the middle two, and not beyond a tie."""
    median = lambda x: 1.0 / calibrate([(str(i), 1.0, r) for i, r in enumerate((1.0, 2.0, 4.0, x))], 1.0).lambda_lap
    (low, left), (high, right) = sides(median, kink)
    assert low == pytest.approx(high, rel=1e-10)
    assert (left, right) == (pytest.approx(below, abs=1e-9), pytest.approx(above, abs=1e-9))
