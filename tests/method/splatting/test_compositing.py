"""Compositing: hard cases A1-A5, A7 and the rules of every preset, on splats of known alpha at one pixel."""

import numpy as np
import pytest
from made_up_scenes import (
    U32,
    U64,
    Y00,
    as_dtype,
    assert_close,
    assert_finite,
    deviating,
    plain_camera,
    run,
    screen_scene,
)

from endotsr.definition.compositing import opacity_of
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.records import log_opacity
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER

PIXEL = Camera(np.eye(3), np.zeros(3), 10.0, 10.0, 0.5, 0.5, 1, 1)
BACKGROUND = np.array([0.3, 0.6, 0.1])
ONE_COLOUR = np.array([0.9, 0.2, 0.5])


def on_the_pixel(alphas, rgb, dtype=np.float64, z=None):
    """Splats centred on the only sample of the image: alpha = opacity exactly; nearest first."""
    alphas = np.asarray(alphas, float)
    z = 1.0 + 0.01 * np.arange(alphas.size) if z is None else z
    return as_dtype(screen_scene(PIXEL, 0.5, 0.5, z, 2.0, alphas, rgb), dtype)


def by_hand(alphas, rgb, z, given):
    """The recursion of (B5) in longdouble, no cutoff: images and gradients by alpha, rgb, z, background."""
    alphas, rgb, z = (np.asarray(x, np.longdouble) for x in (alphas, rgb, z))
    g, gz, go = given[0][:, 0, 0], given[1][0, 0], given[2][0, 0]
    front = np.concatenate([[1], np.cumprod(1 - alphas)])
    weight = alphas * front[:-1]
    colour = (weight * rgb).sum(axis=1) + front[-1] * BACKGROUND
    by_alpha, rest = np.empty_like(alphas), (g * BACKGROUND).sum()
    for k in range(alphas.size - 1, -1, -1):
        own = (g * rgb[:, k]).sum() + gz * z[k] + go
        by_alpha[k] = front[k] * (own - rest)
        rest = alphas[k] * own + (1 - alphas[k]) * rest
    return colour, (weight * z).sum(), weight.sum(), by_alpha, weight * g[:, None], front[-1] * g


GIVEN = (np.array([1.0, -0.7, 0.4]).reshape(3, 1, 1), np.array([[0.3]]), np.array([[-0.2]]))
STACKS = {
    "one in the middle": [0.3, 1.0, 0.5],
    "nearly one": [0.999999, 0.5, 0.5],
    "ones": [1.0, 1.0, 1.0],
    "200 halves": [0.5] * 200,
    "2000 hundredths": [0.01] * 2000,
    "faint": [1e-8] * 50,
    "all sizes": [0.0, 1e-30, 1e-8, 1e-3, 0.5, 0.99, 0.999999, 1.0, 0.7],
}


@pytest.mark.parametrize("dtype, u", [(np.float64, U64), (np.float32, U32)])
@pytest.mark.parametrize("name", list(STACKS))
def test_hard_A4_stacks_against_the_recursion_by_hand(name, dtype, u):
    alphas = np.array(STACKS[name])
    rgb = np.random.default_rng(0).uniform(0.05, 1.0, (3, alphas.size))
    scene = on_the_pixel(alphas, rgb, dtype)
    given = tuple(a.astype(dtype) for a in GIVEN)
    images, gradients = run(scene, PIXEL, EXACT, background=BACKGROUND, given=given)
    assert_finite(images, gradients)
    used = opacity_of(scene.opacity_logit.astype(np.longdouble))
    shown = 0.5 + Y00 * scene.harmonics[0].astype(np.longdouble)
    colour, depth, opacity, by_alpha, by_rgb, by_background = by_hand(used, shown, scene.position[2], given)
    by_logit = by_alpha * used * (1 - used)
    bound = (64 + 4 * alphas.size) * u
    steepest = float(np.abs(by_alpha).max())  # the measure of rounding in dI / dalpha, from which dI / dlogit comes
    pairs = [
        (images["colour"][:, 0, 0], colour),
        (images["depth"][0], depth[None]),
        (images["opacity"][0], opacity[None]),
        (np.append(gradients["opacity_logit"], steepest), np.append(by_logit, steepest)),
        (gradients["harmonics"][0] / Y00, by_rgb),
        (np.append(gradients["background"], 1.0), np.append(by_background, 1.0)),  # T_n is right to u, not to u T_n
    ]
    for found, wanted in pairs:
        size = max(float(np.abs(wanted).max()), float(np.finfo(dtype).tiny))
        assert np.abs(found - wanted).max() <= bound * size, (found, wanted)


@pytest.mark.parametrize("alpha", [1e-6, 1e-3, 0.5])
@pytest.mark.parametrize("count", [1000, 100_000])
def test_hard_A5_many_equal_splats_against_the_closed_form(alpha, count):
    """I = c (1 - E) + bg E with E = (1 - alpha)^n; the first splat's gradient is right even where T_n = 0."""
    scene = on_the_pixel(np.full(count, alpha), ONE_COLOUR, z=np.full(count, 2.0))
    images, gradients = run(scene, PIXEL, EXACT, background=BACKGROUND, given=GIVEN)
    e = np.exp(count * np.log1p(-alpha))
    wanted = ONE_COLOUR * (1 - e) + BACKGROUND * e
    np.testing.assert_allclose(images["colour"][:, 0, 0], wanted, rtol=2 * count * U64)
    np.testing.assert_allclose(images["depth"][0, 0], 2.0 * (1 - e), rtol=2 * count * U64 + 1e-10)
    # dI / dalpha of any of them = (c - bg) E / (1 - alpha): only the background still changes
    behind = e / (1 - alpha)
    own = GIVEN[0][:, 0, 0] @ (ONE_COLOUR - BACKGROUND) + GIVEN[1][0, 0] * 2.0 + GIVEN[2][0, 0]
    np.testing.assert_allclose(
        gradients["opacity_logit"][0], own * behind * alpha * (1 - alpha), rtol=1e-10, atol=4 * U64
    )
    by_colour = gradients["harmonics"][0, 0] / Y00
    np.testing.assert_allclose(by_colour[0], alpha * GIVEN[0][0, 0, 0], rtol=1e-10)


@pytest.mark.parametrize("path", ["definition", "blocks"])
def test_hard_A5_the_cutoff_and_the_stop_bound_the_number_of_contributors(path):
    """alpha just above 1/255 and T >= 1e-4: (254/255)^n >= 1e-4 holds for n <= 2348."""
    count = 4000
    scene = on_the_pixel(np.full(count, 1.0001 / 255), ONE_COLOUR)
    _, gradients = run(scene, PIXEL, PAPER, path, background=BACKGROUND, given=GIVEN)
    used = int(np.count_nonzero(gradients["harmonics"][0, 0]))
    assert used == int(np.log(1e-4) / np.log1p(-1.0001 / 255))
    assert (gradients["harmonics"][0, 0, :used] != 0).all()


# --- the alpha clamp ---


@pytest.mark.parametrize("path", ["definition", "blocks"])
@pytest.mark.parametrize("opacity", [0.992, 0.999999, 1.0])
def test_hard_A1_clamped_alpha_is_the_maximum_with_zero_gradient(path, opacity):
    """Two splats: the first is clamped. Forward and reverse use the same constant: the second sees T = 0.01."""
    rgb = np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.4]])
    scene = on_the_pixel([opacity, 0.6], rgb)
    images, gradients = run(scene, PIXEL, PAPER, path, background=BACKGROUND, given=GIVEN)
    wanted = 0.99 * rgb[:, 0] + 0.01 * (0.6 * rgb[:, 1] + 0.4 * BACKGROUND)
    np.testing.assert_allclose(images["colour"][:, 0, 0], wanted, rtol=1e-13)
    assert gradients["opacity_logit"][0] == 0 and (gradients["log_scale"][:, 0] == 0).all()
    np.testing.assert_allclose(gradients["harmonics"][0, :, 0] / Y00, 0.99 * GIVEN[0][:, 0, 0], rtol=1e-13)
    np.testing.assert_allclose(gradients["harmonics"][0, :, 1] / Y00, 0.01 * 0.6 * GIVEN[0][:, 0, 0], rtol=1e-12)
    assert gradients["opacity_logit"][1] != 0


@pytest.mark.parametrize("opacity", [0.985, 0.992, 0.9999])
def test_hard_A1_legacy_passes_the_gradient_through_the_clamp(opacity):
    """The CUDA rasterisers use d alpha = opacity (1 - opacity) also beyond the clamp; below it nothing deviates."""
    scene = on_the_pixel([opacity, 0.6], np.tile(ONE_COLOUR[:, None], 2))
    plain = run(scene, PIXEL, PAPER, "definition", background=BACKGROUND, given=GIVEN)
    passing = run(scene, PIXEL, deviating(PAPER, pass_clamped_alpha=True), background=BACKGROUND, given=GIVEN)
    np.testing.assert_array_equal(plain[0]["colour"], passing[0]["colour"])
    rest = 0.6 * ONE_COLOUR + 0.4 * BACKGROUND
    z = scene.position[2]
    by_alpha = GIVEN[0][:, 0, 0] @ (ONE_COLOUR - rest) + GIVEN[1][0, 0] * (z[0] - 0.6 * z[1]) + GIVEN[2][0, 0] * 0.4
    wanted = by_alpha * opacity * (1 - opacity)
    np.testing.assert_allclose(passing[1]["opacity_logit"][0], wanted, rtol=1e-11)
    assert (plain[1]["opacity_logit"][0] == passing[1]["opacity_logit"][0]) == (opacity < 0.99)
    assert plain[1]["opacity_logit"][1] == passing[1]["opacity_logit"][1]


def test_hard_A1_at_the_clamp_exactly_the_gradient_passes():
    logit = np.log(0.99 / 0.01)
    for step in range(-40, 41):
        scene = on_the_pixel([0.5], ONE_COLOUR)
        scene.opacity_logit[0] = logit + step * 2 * U64
        _, gradients = run(scene, PIXEL, PAPER, "definition", given=GIVEN)
        below = np.exp(log_opacity(scene.opacity_logit))[0] <= 0.99
        assert (gradients["opacity_logit"][0] != 0) == below


# --- stop and cutoff ---


@pytest.mark.parametrize("path", ["definition", "blocks"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_A2_the_splat_that_crosses_the_stop_is_dropped(path, dtype):
    """T = 0.1, 0.01, then 0.00101; the next would leave 5e-4 and one more 1e-5: it and all behind are dropped."""
    alphas = np.array([0.9, 0.9, 0.899, 0.5, 0.98, 0.5])
    rgb = np.random.default_rng(1).uniform(0.1, 1.0, (3, 6))
    scene = on_the_pixel(alphas, rgb, dtype)
    images, gradients = run(scene, PIXEL, PAPER, path, background=BACKGROUND)
    front = np.concatenate([[1.0], np.cumprod(1 - alphas[:4])])
    wanted = (rgb[:, :4] * alphas[:4] * front[:4]).sum(axis=1) + front[4] * BACKGROUND
    np.testing.assert_allclose(images["colour"][:, 0, 0], wanted, rtol=8 * np.finfo(dtype).eps)
    assert (gradients["harmonics"][..., :4] != 0).any(axis=(0, 1)).all()
    assert (gradients["harmonics"][..., 4:] == 0).all() and (gradients["opacity_logit"][4:] == 0).all()


def test_hard_A2_the_error_shrinks_with_the_stop_and_is_bounded_by_it():
    rng = np.random.default_rng(2)
    for _ in range(20):
        scene = on_the_pixel(rng.uniform(0.05, 0.95, 60), rng.uniform(0, 1, (3, 60)))
        exact = run(scene, PIXEL, EXACT, background=BACKGROUND)[0]["colour"]
        errors = []
        for stop in (1e-1, 1e-2, 1e-4, 1e-8):
            settings = EXACT._replace(transmittance_stop=stop)
            errors.append(np.abs(run(scene, PIXEL, settings, background=BACKGROUND)[0]["colour"] - exact).max())
            assert errors[-1] <= stop / (1 - 0.95)  # at most T in front of the dropped one, colours in 0..1
        assert errors[-1] <= 1e-7 and errors[0] >= errors[2]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_A2_a_tile_in_which_every_pixel_has_stopped_is_left(dtype):
    """80 opaque splats over the whole image: two are blended, the others have gradient 0 and change nothing."""
    camera = plain_camera(9, 5, 10.0)
    scene = as_dtype(screen_scene(camera, 4.5, 2.5, 2.0 + np.arange(80), 1e4, 0.98, ONE_COLOUR), dtype)
    for path in ("definition", "blocks"):
        images, gradients = run(scene, camera, PAPER, path, background=BACKGROUND)
        wanted = (1 - 0.02**2) * ONE_COLOUR + 0.02**2 * BACKGROUND
        np.testing.assert_allclose(images["colour"], np.broadcast_to(wanted[:, None, None], (3, 5, 9)), rtol=1e-5)
        assert gradients["harmonics"][..., :2].all() and not gradients["harmonics"][..., 2:].any()


@pytest.mark.parametrize("path", ["definition", "blocks"])
def test_hard_A3_the_jump_at_the_cutoff_is_alpha_times_the_difference(path):
    settings = PAPER
    images, gradients = [], []
    for factor in (1 - 1e-9, 1 + 1e-9):
        scene = on_the_pixel([0.4, factor / 255], np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.4]]))
        image, gradient = run(scene, PIXEL, settings, path, background=BACKGROUND, given=GIVEN)
        images.append(image["colour"][:, 0, 0])
        gradients.append(gradient["opacity_logit"][1])
    jump = 0.6 / 255 * (np.array([0.1, 0.8, 0.4]) - BACKGROUND)
    np.testing.assert_allclose(images[1] - images[0], jump, atol=1e-11)
    assert gradients[0] == 0 and gradients[1] != 0


def test_hard_A3_an_alpha_equal_to_the_cutoff_contributes():
    scene = on_the_pixel([0.5], ONE_COLOUR)
    scene.opacity_logit[0] = 0.0
    for path in ("definition", "blocks"):
        images, _ = run(scene, PIXEL, PAPER._replace(alpha_cutoff=0.5), path)
        assert images["opacity"][0, 0] == 0.5, path


# --- opacity ---


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_A7_logits_of_any_size(dtype):
    logit = np.array([-800.0, -40.0, -1.0, 0.0, 1.0, 40.0, 800.0, 3e38], dtype)
    found = log_opacity(logit)
    assert found.dtype == dtype and np.isfinite(found).all() and (found <= 0).all()
    with np.errstate(over="ignore"):
        wanted = -np.log1p(np.exp(-logit.astype(np.longdouble)))
    wanted[logit < -600] = logit[logit < -600]
    np.testing.assert_allclose(found, wanted.astype(float), rtol=8 * np.finfo(dtype).eps, atol=np.finfo(dtype).eps)
    for settings, path in ((EXACT, "definition"), (PAPER, "blocks"), (LEGACY, "definition")):
        scene = on_the_pixel(np.full(logit.size, 0.5), ONE_COLOUR, dtype)
        scene.opacity_logit[:] = logit
        assert_finite(*run(scene, PIXEL, settings, path, background=BACKGROUND))


def test_faint_splats_keep_their_opacity_in_float32():
    """1 - T would be 0."""
    images, _ = run(on_the_pixel([1e-8] * 3, ONE_COLOUR, np.float32), PIXEL, EXACT)
    np.testing.assert_allclose(images["opacity"], 3e-8, rtol=1e-5)


def test_depth_is_not_normalised_and_has_no_background():
    camera = plain_camera(9, 9, 10.0)
    scene = screen_scene(camera, 4.5, 4.5, 7.0, 1e4, 1 - 1e-12, ONE_COLOUR)
    images, _ = run(scene, camera, PAPER, background=BACKGROUND)
    assert_close({"depth": images["depth"]}, {"depth": np.full((9, 9), 0.99 * 7.0)}, 1e-6)
