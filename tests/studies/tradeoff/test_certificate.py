"""The certificate holds for the exact renderer and for nothing less."""

import numpy as np
import pytest
from made_up import moving_scene
from pages.tradeoff.certificate import certify

from endotsr.studies.tradeoff.measure import frame, prepare
from endotsr.studies.tradeoff.settings import ACCURATE, CLOSE
from endotsr.studies.tradeoff.study import reference_setting


@pytest.fixture(scope="module")
def scene():
    scene = moving_scene(count=80, width=48)
    scene.gaussians.quaternion[:, 3] = 0  # no rotation to normalise
    scene.gaussians.opacity_logit[:5] = 12
    return scene


@pytest.fixture(scope="module")
def exact(scene):
    return frame(prepare(scene, reference_setting(scene)))[0].colour


def test_the_exact_path_is_certified(scene, exact):
    found = certify(scene, exact, reference_setting(scene).raster)
    assert found.holds and found.pixels >= 20
    assert found.pixels_against_mpmath < 1e-14
    assert 0 < found.cut_1e12_against_1e14 <= 5e-12


@pytest.mark.parametrize("cutoff", [1e-9, 1 / 255])
def test_a_cut_image_is_not(scene, cutoff):
    colour = frame(prepare(scene, ACCURATE._replace(raster=CLOSE._replace(alpha_cutoff=cutoff))))[0].colour
    assert not certify(scene, colour, reference_setting(scene).raster).holds


def test_mpmath_alone_finds_a_wrong_image(scene, exact):
    """An error that the cutoffs share, such as a wrong colour."""
    found = certify(scene, exact + 1e-9, reference_setting(scene).raster)
    assert found.pixels_against_mpmath == pytest.approx(1e-9, rel=1e-3)


def test_digits_take_every_part_of_the_scene_in(scene, exact):
    """Leave out what the certificate must see: residual, harmonics of degree 3, low-pass."""
    raster = reference_setting(scene).raster
    for changed in (
        scene.gaussians._replace(appearance_coefficients=None),
        scene.gaussians._replace(harmonics=np.ascontiguousarray(scene.gaussians.harmonics[:9])),
    ):
        other = type(scene)(**(scene.__dict__ | {"gaussians": changed}))
        assert certify(other, exact, raster).pixels_against_mpmath > 1e-6
    assert certify(scene, exact, raster._replace(low_pass=0.2)).pixels_against_mpmath > 1e-6
