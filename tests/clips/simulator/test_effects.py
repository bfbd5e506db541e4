"""Every effect of light, motion and camera: what it does, and that its smallest size does nothing at all."""

import msgspec
import numpy as np
import pytest

from endotsr.clips.simulator import SimulatorSettings, simulate, with_effects
from endotsr.clips.simulator.bleeding import blood_cover
from endotsr.clips.simulator.cameras import make_cameras, open_span, shutter_times, vignette
from endotsr.clips.simulator.coarse import see_coarsely, views_during
from endotsr.clips.simulator.frames import Eye, make_scene, simulated_frames, tissue_light
from endotsr.clips.simulator.gain import auto_exposure_gain, gain_series, gain_spectrum
from endotsr.clips.simulator.instrument import draw
from endotsr.clips.simulator.lamps import Blocker, shadow
from endotsr.clips.simulator.shading import lit_by_all, shade
from endotsr.clips.simulator.slit import half_width, parting, slit_coordinates
from endotsr.clips.simulator.smoke import GREY, clouds, smoke_fraction, with_smoke
from endotsr.clips.simulator.surface import make_surface, surface_point
from endotsr.clips.simulator.texture import sample
from endotsr.clips.simulator.views import see, to_camera
from endotsr.config import with_settings
from endotsr.errors import InputError

SMALL = SimulatorSettings(width=64, height=48, frames=6, seed=3)

SMALL_STILL = with_effects(SMALL)


# The size of every effect at which it does nothing.
NOTHING = {
    "breathing": {"amplitude": 0.0}, "pulsation": {"amplitude": 0.0}, "pull": {"amplitude": 0.0},
    "exposure": {"amplitude": 0.0}, "brightening": {"amplitude": 0.0}, "highlights": {"strength": 0.0},
    "noise": {"sigma": 0.0}, "cutting": {"start": 0.95, "stop": 1.0}, "bleeding": {"opacity": 0.0},
    "second_light": {"strength": 0.0}, "shadows": {"strength": 0.0}, "smoke": {"density": 0.0},
    "vignetting": {"amplitude": 0.0}, "auto_exposure": {"amplitude": 0.0}, "motion_blur": {"shutter": 0.0},
}  # fmt: skip


@pytest.mark.parametrize("effect", NOTHING)
def test_off_equals_on_with_the_smallest_size_bitwise(effect):
    base = ("breathing", "exposure", "highlights", "instrument")
    off = simulate(with_effects(SMALL, *(name for name in base if name != effect)))
    settings = with_settings(with_effects(SMALL, *base, effect), **{effect: NOTHING[effect]})
    on = simulate(settings)
    for name in ("images", "masks", "depth"):
        np.testing.assert_array_equal(getattr(on.sequence, name), getattr(off.sequence, name))
    np.testing.assert_array_equal(on.truth.material_coordinates, off.truth.material_coordinates)


# The slit


@pytest.fixture(scope="module")
def cut():
    return with_effects(SMALL, "cutting", "breathing")


def test_the_slit_parts_the_tissue_by_its_opening_and_only_there(cut):
    slit = make_surface(cut).slit
    x = np.array([0.0, 4.0, -9.0, 20.0])
    a, b = (slit.centre[i] + x * slit.along[i] for i in (0, 1))
    gap = parting(slit, a, b, 1.0, 0.9)[0] - parting(slit, a, b, -1.0, 0.9)[0]
    np.testing.assert_allclose(gap, [4.0, 4.0 * (1 - (4 / 9) ** 2) ** 2, 0.0, 0.0], atol=1e-12)
    assert (parting(slit, a, b, 1.0, 0.1)[0] == 0).all() and (parting(slit, a, b, None, 0.9)[0] >= 0).all()
    far = parting(slit, a + 40 * slit.across[0], b + 40 * slit.across[1], None, 0.9)[0]
    assert np.abs(far).max() < 1e-6


def test_the_blade_runs_from_one_end_to_the_other(cut):
    slit = make_surface(cut).slit
    x = np.linspace(-12, 12, 481)
    ends = [x[half_width(slit, x, t)[0] > 0] for t in (0.2, 0.4, 0.7, 1.0)]
    assert all(end.min() == pytest.approx(-9, abs=0.06) for end in ends)
    tips = [end.max() for end in ends]
    assert tips == sorted(tips) and tips[2] == tips[3] == pytest.approx(9, abs=0.06)
    assert tips[1] == pytest.approx(-9 + 18 * (0.4 - 0.15) / 0.55, abs=0.06)


def test_rays_meet_one_side_the_other_or_the_wound_between(cut):
    surface, camera = make_surface(cut), make_cameras(cut, [0.9])[0]
    view = see(surface, camera, 0.9)
    x, y = slit_coordinates(surface.slit, *view.material)
    sides = np.sign(y)[~view.wound]
    assert {-1.0, 1.0} <= set(sides) and 5 < view.wound.sum() < 0.1 * view.wound.size
    assert (half_width(surface.slit, x[view.wound], 0.9)[0] > 0).all()
    # the wound lies between its edges and behind them, and every position projects to its own pixel centre
    u, v = (camera.fx * view.point[i] / view.point[2] + c for i, c in ((0, camera.cx), (1, camera.cy)))
    rows, columns = np.mgrid[0:48, 0:64] + 0.5
    assert max(np.abs(u - columns).max(), np.abs(v - rows).max()) < 1e-8
    line = surface_point(surface._replace(slit=None), view.material[:, view.wound], 0.9)
    aside = (view.point[:2, view.wound] - line[:2]).T @ surface.slit.across
    assert (np.abs(aside) < half_width(surface.slit, x[view.wound], 0.9)[0]).all()
    assert (view.point[2, view.wound] > line[2]).all() and np.ptp(aside) > 2


def test_the_wound_meets_the_edges_of_the_tissue(cut):
    """Along a row of pixels through the slit, depth has no jump: the groove begins at the edges."""
    fine = msgspec.structs.replace(cut, width=640, height=48, focal=5.0)
    surface = make_surface(fine)
    camera = make_cameras(fine, [0.9])[0]
    camera = camera._replace(cx=320 + 5 * 640 * 0.08, cy=24 + 5 * 640 * 0.05)  # the slit in the middle
    view = see(surface, camera, 0.9)
    assert view.wound[24].any() and not view.wound[24].all()
    assert np.abs(np.diff(view.depth[24])).max() < 0.06


def test_a_slit_that_would_fold_the_tissue_is_refused():
    with pytest.raises(InputError, match=r"cutting.opening = 30 folds .* use at most 20.8 with cutting.reach = 7"):
        simulate(with_settings(with_effects(SMALL, "cutting"), cutting={"opening": 30.0}))
    with pytest.raises(InputError, match=r"cutting.stop = 0.1: use a number above cutting.start = 0.2"):
        simulate(with_settings(with_effects(SMALL, "cutting"), cutting={"start": 0.2, "stop": 0.1}))


@pytest.mark.parametrize("effects", [("breathing", "pull"), ("breathing", "pull", "cutting"), ("camera_motion",)])
@pytest.mark.parametrize("right", [False, True])
def test_a_coarse_view_is_good_to_a_few_hundredths_of_a_pixel(effects, right):
    settings = with_effects(SimulatorSettings(width=320, height=256), *effects)
    surface, camera = make_surface(settings), make_cameras(settings, [0.6], right)[0]
    exact, quick = see(surface, camera, 0.6), see_coarsely(surface, camera, 0.6)
    if exact.wound is not None:
        assert (exact.wound != quick.wound).sum() <= 2
    same = np.ones(exact.depth.shape, bool) if exact.wound is None else exact.wound == quick.wound
    pixel = 50 / (0.89 * 320)
    for a, b in ((exact.material, quick.material), (exact.point, quick.point)):
        assert np.abs(a - b)[:, same].max() < 0.02 * pixel and np.abs(a - b)[:, same].mean() < 3e-4 * pixel
    assert np.abs(exact.normal - quick.normal)[:, same].max() < 0.01


# Light


def test_blood_spreads_from_its_spot_and_stays_on_the_tissue():
    settings = with_effects(SMALL, "bleeding")
    a, b = np.meshgrid(np.linspace(-20, 20, 161), np.linspace(-20, 20, 161))
    material = np.stack([a, b])
    areas = [(blood_cover(settings, material, t) > 0.45).sum() * 0.0625 for t in (0.1, 0.4, 0.7, 0.99)]
    assert areas[0] == 0 and areas == sorted(areas)
    assert areas[3] == pytest.approx(np.pi * 6**2, rel=0.15) and areas[1] == pytest.approx(areas[3] / 4, rel=0.2)
    assert blood_cover(settings, material, 0.9).max() == 0.9


def test_the_second_lamp_adds_light_from_its_side():
    scene = make_scene(with_effects(SMALL))
    view = see(scene.surface, scene.cameras[0], 0.0)
    one, both = (
        shade(settings, scene.texture, view, lit_by_all(settings, view, scene.cameras[0]), 0.0).light
        for settings in (SMALL_STILL, with_effects(SMALL, "second_light"))
    )
    added = (both - one)[1] / one[1]
    assert (added > 0).all() and added[:, :16].mean() > 1.3 * added[:, -16:].mean()
    towards = np.array([-30.0, -20.0, 0.0])[:, None, None] - view.point
    r = np.sqrt((towards**2).sum(axis=0))
    cosine = (view.normal * towards).sum(axis=0) / r
    received = 0.5 * 0.95 * (50 / r) ** 2 * np.maximum(cosine + 0.15, 0) / 1.15
    np.testing.assert_allclose((both - one) / received, sample(scene.texture, view.material)[:3], rtol=1e-9)


def test_vignetting_takes_its_fraction_in_the_corners_and_nothing_in_the_middle():
    factor = vignette(msgspec.structs.replace(SMALL, width=2000, height=1600))
    assert factor[800, 1000] == pytest.approx(1, abs=1e-5)
    for corner in (factor[0, 0], factor[0, -1], factor[-1, 0], factor[-1, -1]):
        assert corner == pytest.approx(0.6, abs=1e-3)


def test_smoke_replaces_light_by_grey_within_its_time():
    settings = with_effects(SMALL, "smoke")
    assert not smoke_fraction(settings, 0.05).any() and not smoke_fraction(settings, 0.97).any()
    fraction = smoke_fraction(settings, 0.5)
    assert 0.1 < fraction.mean() < 0.5 and fraction.max() < 0.6 and fraction.std() > 0.05
    light = np.full((3, 48, 64), 0.2)
    np.testing.assert_allclose(with_smoke(settings, light, 0.5)[0], 0.2 + (GREY[0] - 0.2) * fraction)


def test_smoke_drifts_to_the_right_and_does_not_depend_on_the_image_size():
    settings = with_effects(SimulatorSettings(width=100, height=80), "smoke")
    first, later = clouds(settings, 0.2, 0), clouds(settings, 0.4, 0)  # drift 0.5: ten pixels in between
    np.testing.assert_allclose(later[:, 10:], first[:, :-10], atol=1e-12)
    large = clouds(msgspec.structs.replace(settings, width=300, height=240), 0.2, 0)
    np.testing.assert_allclose(large[1::3, 1::3], first, atol=1e-12)
    for drift in (-0.5, 0.0, 2.0):
        assert np.isfinite(smoke_fraction(with_settings(settings, smoke={"drift": drift}), 0.5)).all()


def test_automatic_exposure_is_constant_between_its_jumps():
    settings = with_effects(SMALL, "auto_exposure")
    gains = np.array([auto_exposure_gain(settings, t) for t in np.linspace(0, 0.999, 400)])
    assert gains[0] == 1 and np.count_nonzero(np.diff(gains)) == 3
    np.testing.assert_array_equal(np.flatnonzero(np.diff(gains)) + 1, [100, 200, 300])
    levels = np.unique(gains[gains != 1]) - 1
    assert (np.abs(levels) >= 0.125).all() and (np.abs(levels) <= 0.25).all()
    assert auto_exposure_gain(msgspec.structs.replace(settings, seed=4), 0.3) != gains[120]


@pytest.mark.parametrize("frames", [6, 7])
def test_the_fourier_content_of_the_gain_returns_the_gain(frames):
    settings = msgspec.structs.replace(with_effects(SMALL, "exposure", "auto_exposure"), frames=frames)
    times = np.arange(frames) / frames
    gain = gain_series(settings, times)
    spectrum = gain_spectrum(gain)
    angle = 2 * np.pi * spectrum.cycles * times[:, None]
    np.testing.assert_allclose(np.cos(angle) @ spectrum.cosine + np.sin(angle) @ spectrum.sine, gain, atol=1e-14)
    assert gain_spectrum(np.ones((frames, 3))).cosine[0] == pytest.approx(1)
    drift = gain_spectrum(gain_series(with_effects(settings, "exposure"), times))
    assert drift.sine[1, 0] == pytest.approx(0.15) and np.abs(np.delete(drift.sine[:, 0], 1)).max() < 1e-14


# Instruments


def test_further_instruments_cover_more_and_keep_the_first():
    one = draw(with_effects(SMALL, "instrument"), 0.3)
    two = draw(with_effects(SMALL, "instrument", "more_instruments"), 0.3)
    three = draw(with_settings(with_effects(SMALL, "instrument"), more_instruments={"on": True, "count": 2}), 0.3)
    sizes = [drawing.coverage.sum() for drawing in (one, two, three)]
    assert sizes[0] < sizes[1] < sizes[2]
    first = one.coverage == 1
    assert (two.coverage[first] == 1).all() and (one.excluded & ~two.excluded).sum() == 0
    assert draw(with_effects(SMALL), 0.3) is None


def test_the_right_camera_sees_the_instrument_shifted():
    settings = with_effects(SMALL, "instrument")
    left, right = draw(settings, 0.3), draw(settings, 0.3, -4 / 64)
    np.testing.assert_allclose(right.coverage[:, :-4], left.coverage[:, 4:], atol=1e-12)


def test_shadows_lie_where_the_line_to_the_lamp_is_covered():
    """A covered pixel darkens the tissue that its line to the lamp continues to, found by geometry in space."""
    settings = with_effects(SMALL, "shadows")
    scene = make_scene(settings)
    camera, lamp = scene.cameras[0], np.array([5.0, 0.0, 0.0])
    view = see(scene.surface, camera, 0.0)
    cover = np.zeros((48, 64))
    cover[20:26, 30:36] = 1.0
    factor = shadow(settings, Blocker(cover, camera), lamp, view)
    assert factor.min() == pytest.approx(0.4) and factor.max() == 1
    row, column = np.argwhere(factor < 0.41)[3]
    point = view.point[:, row, column]
    crossing = lamp + (35.0 - lamp[2]) / (point[2] - lamp[2]) * (point - lamp)
    x, y, z = to_camera(camera, crossing)
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    assert 30 <= u <= 36 and 20 <= v <= 26
    plain, shaded = (
        shade(settings, scene.texture, view, lit_by_all(settings, view, camera, blocker), 0.0).light
        for blocker in (None, Blocker(cover, camera))
    )
    np.testing.assert_allclose(shaded / plain, np.broadcast_to(factor, plain.shape), rtol=1e-12)


# Motion blur


@pytest.mark.parametrize("right", [False, True])
@pytest.mark.parametrize(
    ("effects", "bound"), [(("breathing", "camera_motion", "highlights"), 0.15), (("breathing", "cutting"), 0.25)]
)
def test_blur_is_the_mean_over_sharp_moments(effects, bound, right):
    """Against pictures of the tissue at twenty times of the exposure, each solved and shaded in full."""
    settings = with_effects(SimulatorSettings(width=96, height=64, frames=24, focal=2.0), *effects)
    blur = {"on": True, "shutter": 1.0, "samples": 20}
    settings = with_settings(settings, motion_blur=blur, breathing={"cycles": 4.0})
    scene = make_scene(with_settings(settings, cutting={"start": 0.3, "stop": 0.4}))
    t = 0.35

    def light(at):
        camera, lamp = (make_cameras(settings, [at], which)[0] for which in (right, False))
        view = see(scene.surface, camera, at)
        lamps = lit_by_all(settings, view, lamp, None, camera)
        return shade(settings, scene.texture, view, lamps, t).light

    cameras = [make_cameras(settings, [t], which)[0] for which in (right, False)]
    eye = Eye(see(scene.surface, cameras[0], t), cameras[0], right)
    found = tissue_light(scene, eye, cameras[1], None, t).light
    expected = np.mean([light(t + u) for u in shutter_times(settings)], axis=0)
    assert np.abs(shutter_times(settings)).max() == pytest.approx(0.95 * 0.5 * open_span(settings))
    effect = np.sqrt(np.mean((light(t) - expected) ** 2))
    assert np.sqrt(np.mean((found - expected) ** 2)) < bound * effect and effect > 0.01


def test_the_material_during_an_exposure_is_that_of_its_moments():
    for effects in (("breathing", "pull"), ("breathing", "cutting"), ("camera_motion",)):
        settings = with_effects(SimulatorSettings(width=160, height=128), *effects)
        surface, times = make_surface(settings), np.array([-0.02, -0.01, 0.0, 0.01, 0.02])
        cameras = make_cameras(settings, 0.5 + times)
        middle = see(surface, cameras[2], 0.5)
        for camera, moment, found in zip(cameras, times, views_during(surface, cameras[::2], middle, 0.5, times)):
            exact = see(surface, camera, 0.5 + moment)
            wound = np.zeros((128, 160), bool) if exact.wound is None else exact.wound
            same = ~wound & (True if found.wound is None else ~found.wound)
            assert same.sum() > 0.99 * (~wound).sum()
            np.testing.assert_allclose(found.material[:, same], exact.material[:, same], atol=0.02)
            if exact.wound is not None:
                assert found.wound.any() and (found.wound != exact.wound).sum() <= 0.05 * exact.wound.sum()


def test_blur_reaches_the_instruments_and_their_mask():
    settings = with_effects(SMALL, "instrument")
    fast = with_settings(settings, instrument={"travel": 0.2}, motion_blur={"on": True, "shutter": 1.0})
    sharp, smeared = draw(with_settings(fast, motion_blur={"on": False}), 0.2), draw(fast, 0.2)
    soft = [((d.coverage > 0.02) & (d.coverage < 0.98)).sum() for d in (sharp, smeared)]
    assert soft[1] > 1.5 * soft[0] and (smeared.coverage > 0).sum() > (sharp.coverage > 0).sum()
    simulated = simulate(fast)
    assert not (simulated.truth.instrument & simulated.sequence.masks).any()


# Stereo and depth


def test_the_right_picture_is_the_left_one_at_its_disparity():
    settings = with_effects(SimulatorSettings(width=160, height=128, frames=3), "stereo")
    frame = next(simulated_frames(make_scene(settings)))
    disparity = 0.89 * 160 * 4.0 / frame.depth
    from endotsr.clips.opencv.flow import warp_bilinear

    moved = warp_bilinear(frame.image_right.astype(float), np.stack([-disparity, np.zeros_like(disparity)]))
    seen = np.broadcast_to(frame.tissue, moved.shape)
    assert np.abs(moved - frame.image)[seen].mean() < 3 < np.abs(frame.image_right - frame.image.astype(float)).mean()
    column = np.arange(160) + 0.5
    np.testing.assert_array_equal(frame.tissue, column >= disparity)
    np.testing.assert_array_equal(frame.prior > 0, frame.tissue)


def test_rounded_depth_is_the_nearest_step():
    prior = simulate(with_effects(SMALL, "depth_rounding")).sequence.depth
    exact = simulate(with_effects(SMALL)).sequence.depth
    np.testing.assert_array_equal(prior, np.rint(exact))
    steps = with_settings(SMALL_STILL, depth_rounding={"on": True, "step": 2.5})
    coarse = simulate(steps).sequence.depth
    assert np.abs(coarse - exact).max() <= 1.25 and set(np.unique(coarse % 2.5)) == {0.0}
