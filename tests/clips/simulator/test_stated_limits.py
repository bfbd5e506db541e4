"""Limits, sizes and formulas that the texts of the simulator state, against what it computes."""

import msgspec
import numpy as np
import pytest

from endotsr.clips.simulator.bleeding import with_blood
from endotsr.clips.simulator.cameras import camera_centres, make_cameras
from endotsr.clips.simulator.coarse import see_coarsely
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.gain import exposure_gain
from endotsr.clips.simulator.instrument import FIRST, wrist_at
from endotsr.clips.simulator.lamps import BEAM, GAIN, WRAP, bent_normal
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.shading import lit_by_all, shade
from endotsr.clips.simulator.slit import LARGEST_STRETCH, STEEPEST, half_width, make_slit, parting
from endotsr.clips.simulator.smoke import smoke_fraction
from endotsr.clips.simulator.surface import make_surface, surface_point
from endotsr.clips.simulator.texture import make_texture, sample
from endotsr.clips.simulator.views import pixel_of, see

TIMES = np.linspace(0, 1, 721)


def changed(settings: SimulatorSettings, **sections: dict) -> SimulatorSettings:
    parts = {name: msgspec.structs.replace(getattr(settings, name), **keys) for name, keys in sections.items()}
    return msgspec.structs.replace(settings, **parts)


def test_the_largest_shift_of_an_orbit_and_of_a_hand():
    orbit = changed(SimulatorSettings(), camera_motion={"on": True, "amplitude": 3.0})
    right, down, forward = np.abs(camera_centres(orbit, TIMES)).max(axis=0)
    assert (right, down, forward) == (pytest.approx(3.0, abs=1e-3), pytest.approx(3.0, abs=1e-3), 0.0)
    assert np.hypot(*camera_centres(orbit, TIMES)[:, :2].T).max() == pytest.approx(3.0 * 4 / 12**0.5, abs=1e-3)
    hand = changed(orbit, camera_motion={"path": "hand"})
    assert np.hypot(*camera_centres(hand, TIMES)[:, :2].T).max() == pytest.approx(3.0, abs=0.01)


def test_the_drift_of_each_channel():
    drift = changed(SimulatorSettings(), exposure={"on": True, "amplitude": 0.2})
    most = np.abs([exposure_gain(drift, float(t)) - 1 for t in TIMES]).max(axis=0) / 0.2
    np.testing.assert_allclose(most, [1.0, 0.85, 1.07], atol=0.005)


def test_the_path_of_the_wrist_is_an_ellipse():
    settings = changed(SimulatorSettings(), instrument={"on": True, "travel": 0.06})
    path = np.array([wrist_at(settings, FIRST, float(t)) for t in TIMES])
    np.testing.assert_allclose(np.ptp(path, axis=0), [2 * 0.06, 2 * 0.6 * 0.06], atol=1e-5)


def test_folds_of_the_tissue_stay_within_their_limit():
    a, b = np.meshgrid(np.linspace(-60, 60, 301), np.linspace(-60, 60, 301))
    for seed in range(10):
        surface = make_surface(SimulatorSettings(seed=seed))
        assert surface.amplitude.sum() < 5.1
        assert 4.0 < np.abs(surface_point(surface, np.stack([a, b]), 0.0)[2] - 50).max() < 5.1


def test_smoke_and_texture_are_those_of_an_aspect_ratio():
    smoky = with_effects(SimulatorSettings(), "smoke")
    small = smoke_fraction(smoky, 0.5)
    large = smoke_fraction(msgspec.structs.replace(smoky, width=320, height=256), 0.5)
    assert np.abs(large.reshape(128, 2, 160, 2).mean(axis=(1, 3)) - small).max() < 1e-3
    other = smoke_fraction(msgspec.structs.replace(smoky, height=120), 0.5)
    assert np.abs(other - small[:120]).max() > 0.1
    points = np.stack(np.meshgrid(np.linspace(-20, 20, 41), np.linspace(-15, 15, 31)))
    sizes = [SimulatorSettings(), SimulatorSettings(width=320, height=256), SimulatorSettings(height=120)]
    same, finer, shorter = (sample(make_texture(settings), points)[0] for settings in sizes)
    assert np.median(np.abs(finer - same)) < 0.01 < np.median(np.abs(shorter - same))


@pytest.mark.parametrize(("width", "low", "high"), [(16, 0.1, 1.0), (48, 0.1, 1.0), (160, 0.0, 0.05), (320, 0.0, 0.03)])
def test_the_error_of_a_coarse_view_by_size(width, low, high):
    settings = with_effects(SimulatorSettings(width=width, height=width * 4 // 5), "breathing", "pull")
    surface, camera = make_surface(settings), make_cameras(settings, np.array([0.5]))[0]
    exact, coarse = (pixel_of(camera, surface_point(surface, one(surface, camera, 0.5).material, 0.5))[:2]
                     for one in (see, see_coarsely))  # fmt: skip
    assert low <= np.hypot(*(exact - coarse)).max() < high


def test_the_formula_of_the_light_pixel_by_pixel():
    effects = ("breathing", "brightening", "highlights", "second_light", "bleeding")
    settings = with_effects(SimulatorSettings(width=24, height=20), *effects)
    scene, t = make_scene(settings), 0.6
    camera = scene.cameras[0]
    view = see(scene.surface, camera, t)
    found = shade(settings, scene.texture, view, lit_by_all(settings, view, camera), t).light
    second, shine = settings.second_light, settings.highlights
    maps = sample(scene.texture, view.material)
    reflectance, bent = with_blood(settings, maps[:3], view.material, t), bent_normal(view.normal, maps[3:])
    for row, column in ((0, 0), (7, 11), (19, 23), (10, 3)):
        at = (slice(None), row, column)
        point, n, total = view.point[at], view.normal[at], np.zeros(3)
        a, b = view.material[at] - settings.distance * np.array([-0.14, -0.12])
        paler = 1 + settings.brightening.amplitude * np.sin(np.pi * settings.brightening.cycles * t) ** 2 * np.exp(
            -(a**2 + b**2) / (2 * settings.brightening.width**2)
        )
        for lamp, beam, strength in ((np.zeros(3), BEAM, 1.0), (np.array([second.right, second.down, 0]), 0, 0.5)):
            r, eye = np.linalg.norm(lamp - point), -point / np.linalg.norm(point)
            to = (lamp - point) / r
            received = strength * GAIN * (settings.distance / r) ** 2 * (view.depth[row, column] / r) ** beam
            total += reflectance[at] * paler * received * max(n @ to + WRAP, 0) / (1 + WRAP)
            half = (to + eye) / np.linalg.norm(to + eye)
            total += shine.strength * received * max(bent[at] @ half, 0) ** shine.exponent
        np.testing.assert_allclose(found[at], total, rtol=1e-10)


def test_the_tissue_beside_a_slit_is_compressed_most_at_its_reach():
    """At the edge it keeps its length; at y = reach, the displacement falls most steeply."""
    settings = with_effects(SimulatorSettings(), "cutting")
    slit = make_slit(settings)
    y = np.linspace(0, 4 * slit.reach, 4001)
    a, b = slit.centre[:, None] + slit.across[:, None] * y
    moved, by_a, by_b = parting(slit, a, b, None, 0.9)
    slope = by_a * slit.across[0] + by_b * slit.across[1]
    assert slope[0] == pytest.approx(0, abs=1e-12) and moved[0] == half_width(slit, np.zeros(1), 0.9)[0][0]
    assert y[np.argmin(slope)] == pytest.approx(slit.reach, abs=0.02)
    assert -slope.min() == pytest.approx(slit.half_opening * STEEPEST / slit.reach) and -slope.min() < LARGEST_STRETCH


def test_prior_depth_beside_an_instrument_is_kept_where_the_right_camera_does_not_see_the_tissue():
    """The instrument is nearer and hides other tissue from the right camera; the prior depth ends at the left alone."""
    settings = with_effects(SimulatorSettings(width=96, height=80), "stereo", "instrument")
    frame = next(iter(simulated_frames(make_scene(settings))))
    strip = settings.focal * settings.width * settings.stereo.baseline / frame.depth
    unseen = (frame.prior == 0) & ~frame.excluded
    np.testing.assert_array_equal(unseen, (np.arange(96) + 0.5 < strip) & ~frame.excluded)


def test_without_a_right_picture_a_pixel_without_prior_depth_counts_as_tissue():
    settings = with_effects(SimulatorSettings(width=48, height=40), "instrument", "depth_errors")
    frame = next(iter(simulated_frames(make_scene(settings))))
    assert (frame.tissue & (frame.prior == 0)).any()
    stereo = next(iter(simulated_frames(make_scene(with_effects(settings, "instrument", "depth_errors", "stereo")))))
    assert not (stereo.tissue & (stereo.prior == 0)).any()
