"""What the charts show, as laws: error within five times the cutoff, monotone dials, lossless dials, growth of work."""

import math

import numpy as np
import pytest
from made_up import moving_scene
from pages.tradeoff.dials import EXPONENTIALS, TILES
from pages.tradeoff.kernels import Variant, exponential_coefficients

from endotsr.method.splatting.render import render_forward
from endotsr.method.splatting.settings import EXACT
from endotsr.studies.tradeoff import settings
from endotsr.studies.tradeoff.measure import errors, frame, prepare
from endotsr.studies.tradeoff.settings import ACCURATE, CLOSE, Setting
from endotsr.studies.tradeoff.study import reference_setting
from endotsr.training.fitting.model import scene_at

pytestmark = pytest.mark.slow

CUTOFFS = sorted(settings.CUTOFFS.values())
STOPS = sorted(settings.STOPS.values())


@pytest.fixture(scope="module")
def scene():
    return moving_scene()


@pytest.fixture(scope="module")
def reference(scene):
    return frame(prepare(scene, reference_setting(scene)))[0]


def measured(scene, reference, setting: Setting):
    found, visits = frame(prepare(scene, setting))
    return errors(found, reference), visits


def with_raster(**changes) -> Setting:
    return ACCURATE._replace(raster=CLOSE._replace(**changes))


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_the_largest_error_is_at_most_five_times_the_cutoff(seed):
    scene = moving_scene(seed=seed)
    reference = frame(prepare(scene, reference_setting(scene)))[0]
    for cutoff in CUTOFFS:
        error, _ = measured(scene, reference, with_raster(alpha_cutoff=cutoff))
        assert 0 < error.max <= 5 * cutoff, cutoff


@pytest.mark.parametrize(("field", "values"), [("alpha_cutoff", CUTOFFS), ("transmittance_stop", STOPS)])
def test_errors_rise_and_visits_fall_with_the_dial(field, values):
    """Opaque Gaussians, so that the stop is met."""
    scene = moving_scene(count=300)
    scene.gaussians.opacity_logit[:] += 2
    reference = frame(prepare(scene, reference_setting(scene)))[0]
    found = [measured(scene, reference, with_raster(**{field: value})) for value in values]
    for quantity in ("max", "rms"):
        series = [getattr(error, quantity) for error, _ in found]
        assert series == sorted(series) and series[-1] > series[0], quantity
    visits = [count for _, count in found]
    assert visits == sorted(visits, reverse=True) and visits[-1] < visits[0]


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_tiles_change_no_bit_of_the_image(scene, precision):
    base = with_raster(alpha_cutoff=1 / 255)._replace(compositor="definition", precision=precision)
    images = [frame(prepare(scene, base._replace(kernels=Variant(tile=side))))[0].colour for side in (None, *TILES)]
    assert all(np.array_equal(image, images[0]) for image in images)


def test_tiles_change_gradients_by_rounding_only(scene):
    """Sums over a Gaussian's pixels are grouped by tile: another grouping, another last digit."""
    base = with_raster(alpha_cutoff=1 / 255)._replace(compositor="definition")
    one, other = (frame(prepare(scene, base._replace(kernels=Variant(tile=side))))[0] for side in (8, 32))
    assert errors(one, other).gradient < 1e-13


@pytest.mark.parametrize("path", ["blocks", "definition"])
def test_threads_change_no_bit(scene, path):
    base = with_raster(alpha_cutoff=1 / 255)._replace(compositor=path)
    one, two = (frame(prepare(scene, base._replace(threads=threads)))[0] for threads in (1, 2))
    assert np.array_equal(one.colour, two.colour)
    assert all(np.array_equal(one.gradients[name], two.gradients[name]) for name in one.gradients)


def test_the_ellipse_loses_nothing_against_every_pixel(scene):
    base = with_raster(alpha_cutoff=1 / 255)._replace(compositor="definition")
    everywhere = base._replace(raster=base.raster._replace(support="everywhere"))
    (one, few), (other, many) = frame(prepare(scene, base)), frame(prepare(scene, everywhere))
    assert np.array_equal(one.colour, other.colour)
    assert few < many


def test_visits_grow_like_the_logarithm_of_one_over_the_cutoff():
    """The ellipse alpha >= cutoff has the area 2 pi sqrt(det) ln(o / cutoff): a straight line, of known slope."""
    scene = moving_scene(count=60, width=160)
    g = scene.gaussians
    centre = np.abs(g.position[:2] / g.position[2]).max(axis=0)
    keep = np.flatnonzero(centre < 0.2)  # the largest ellipse ends within the picture
    scale = np.full_like(g.log_scale, np.log(0.09))
    small = {name: np.ascontiguousarray(a[..., keep]) for name, a in g._replace(log_scale=scale)._asdict().items()}
    scene = type(scene)(**(scene.__dict__ | {"gaussians": g._replace(**small)}))
    cutoffs = np.array([1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
    visits = [frame(prepare(scene, with_raster(alpha_cutoff=c)))[1] for c in cutoffs]
    slopes = np.diff(visits) / np.diff(-np.log(cutoffs))
    view, _ = scene_at(scene.gaussians, scene.spectral, scene.model, scene.time)
    _, saved = render_forward(view, scene.camera, CLOSE)
    expected = 2 * math.pi * np.sqrt(saved.projected.determinant).sum()
    np.testing.assert_allclose(slopes, expected, rtol=0.05)


@pytest.mark.parametrize("degree", [2, *EXPONENTIALS])
def test_the_image_errs_no_more_than_the_exponential(scene, reference, degree):
    """An error of alpha by a factor 1 + d changes the image by less than d times the sum of alpha T, which is < 1."""
    f = np.linspace(-1, 0, 2001)
    relative = np.abs(np.polyval(exponential_coefficients(degree), f) / np.exp2(f) - 1).max()
    error, _ = measured(scene, reference, ACCURATE._replace(kernels=Variant(exponential=degree)))
    brightest = 2 * np.abs(reference.colour).max() + 1
    assert error.max <= relative * brightest + 5 * CLOSE.alpha_cutoff
    assert degree > 3 or error.max > 1e-3 * relative


def test_the_reference_is_the_exact_path(scene, reference):
    assert reference_setting(scene).raster == EXACT._replace(near=scene.near)
    assert measured(scene, reference, reference_setting(scene))[0].max == 0
