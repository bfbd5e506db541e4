"""The moving scene is the canonical one plus what each component adds, and gradients return the same way."""

import msgspec
import numpy as np
import pytest

from endotsr.config import PAPER
from endotsr.method.equations.appearance import appearance_forward, appearance_reverse
from endotsr.method.equations.deformation import deformation_forward
from endotsr.method.equations.dictionary import atom_statistics, dictionary_forward, frequencies, normalised_atoms
from endotsr.method.equations.matern import matern_weights
from endotsr.method.equations.motion import motion_reverse
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderGrads, render_forward
from endotsr.method.splatting.settings import PRESETS
from endotsr.training.fitting.model import (
    OffsetsAhead,
    raster_settings,
    render_at,
    scene_at,
    scene_reverse,
    spectral_from,
    without,
)
from endotsr.training.scene.gaussians import Gaussians, arrays

N, T = 7, 0.37
MODEL = msgspec.structs.replace(PAPER.model, frequencies=3, bases=4, beta=0.4, correlation_length=0.2)
CONFIG = msgspec.structs.replace(PAPER, model=MODEL)
TIMES = np.arange(9) / 10
CAMERA = Camera(np.eye(3), np.zeros(3), 12.0, 12.0, 6.0, 5.0, 12, 10)


@pytest.fixture
def gaussians():
    rng = np.random.default_rng(3)
    position = np.stack([rng.uniform(-1, 1, N), rng.uniform(-1, 1, N), rng.uniform(2.5, 3.5, N)])
    return Gaussians(
        position=position,
        quaternion=rng.normal(size=(4, N)),
        log_scale=np.log(rng.uniform(0.1, 0.5, (3, N))),
        opacity_logit=rng.normal(size=N),
        harmonics=rng.normal(0, 0.3, (16, 3, N)),
        fdm_weight=rng.normal(0, 0.2, (10, 4, N)),
        fdm_centre=rng.uniform(0, 1, (10, 4, N)),
        fdm_width=rng.uniform(0.2, 0.5, (10, 4, N)),
        appearance_coefficients=rng.normal(0, 0.3, (3, 6, N)),
        motion_coefficients=rng.normal(0, 0.05, (3, 6, N)),
    )


SPECTRAL = spectral_from(MODEL, TIMES)


def test_the_spectral_constants_are_those_of_the_training_times():
    omega = frequencies(3, MODEL.frequency_min, MODEL.frequency_max)
    np.testing.assert_array_equal(SPECTRAL.omega, omega)
    for one, two in zip(SPECTRAL.statistics, atom_statistics(TIMES, omega), strict=True):
        np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(SPECTRAL.rho, matern_weights(omega, 0.2))


def test_every_component_is_added_where_it_belongs(gaussians):
    scene, saved = scene_at(gaussians, SPECTRAL, MODEL, T)
    offsets, _ = deformation_forward(gaussians.fdm_weight, gaussians.fdm_centre, gaussians.fdm_width, T, MODEL.basis)
    phi, _ = dictionary_forward(T, SPECTRAL.omega)
    translation = np.einsum("cki,k->ci", gaussians.motion_coefficients, phi)
    phi_bar = normalised_atoms(T, SPECTRAL.omega, SPECTRAL.statistics)
    residual, _ = appearance_forward(gaussians.appearance_coefficients, phi_bar, 0.4)
    wanted = {
        "position": gaussians.position + offsets[:3] + translation,
        "quaternion": gaussians.quaternion + offsets[3:7],
        "log_scale": gaussians.log_scale + offsets[7:],
        "opacity_logit": gaussians.opacity_logit,
        "harmonics": gaussians.harmonics,
        "residual": residual,
    }
    assert abs(translation).max() > 1e-3 and abs(offsets).max() > 1e-3 and abs(residual).max() > 1e-3
    for name, array in wanted.items():
        np.testing.assert_allclose(getattr(scene, name), array, rtol=1e-13, atol=1e-14, err_msg=name)
    assert None not in saved


@pytest.mark.parametrize("appearance", [True, False])
@pytest.mark.parametrize("motion", [True, False])
@pytest.mark.parametrize("deformation", [True, False])
def test_a_component_without_arrays_adds_nothing_and_gets_no_gradient(gaussians, appearance, motion, deformation):
    chosen = without(gaussians, appearance=appearance, spectral_motion=motion)
    if not deformation:
        chosen = chosen._replace(fdm_weight=None, fdm_centre=None, fdm_width=None)
    scene, saved = scene_at(chosen, SPECTRAL, MODEL, T)
    assert [s is not None for s in saved] == [deformation, appearance, motion]
    assert (scene.residual is not None) == appearance
    assert np.array_equal(scene.position, gaussians.position) == (not motion and not deformation)
    assert np.array_equal(scene.quaternion, gaussians.quaternion) == (not deformation)
    back = scene_reverse(gradients(appearance), saved)
    assert ("appearance_coefficients" in back.by_field) == appearance
    assert ("motion_coefficients" in back.by_field) == motion
    assert (back.d_offsets is not None) == deformation


def test_offsets_taken_ahead_serve_their_own_time_alone(gaussians):
    _, saved = scene_at(gaussians, SPECTRAL, MODEL, T)
    ahead = OffsetsAhead(T, np.full((10, N), 5.0))
    used, used_saved = scene_at(gaussians, SPECTRAL, MODEL, T, ahead)
    np.testing.assert_array_equal(used.log_scale, gaussians.log_scale + 5)
    np.testing.assert_array_equal(used.quaternion, gaussians.quaternion + 5)
    assert used_saved.deformation == saved.deformation  # the same arrays, time and basis
    later = scene_at(gaussians, SPECTRAL, MODEL, T + 1e-3)[0]
    for one, two in zip(scene_at(gaussians, SPECTRAL, MODEL, T + 1e-3, ahead)[0], later, strict=True):
        np.testing.assert_array_equal(one, two)
    with pytest.raises(ValueError, match=f"offsets of 3 Gaussians, the scene has {N}"):
        scene_at(gaussians, SPECTRAL, MODEL, T, OffsetsAhead(T, np.zeros((10, 3))))


def gradients(appearance=True):
    rng = np.random.default_rng(8)
    return RenderGrads(
        d_position=rng.normal(size=(3, N)), d_quaternion=rng.normal(size=(4, N)), d_log_scale=rng.normal(size=(3, N)),
        d_opacity_logit=rng.normal(size=N), d_harmonics=rng.normal(size=(16, 3, N)),
        d_residual=rng.normal(size=(3, N)) if appearance else None, d_mean2d=np.zeros((2, N)),
        visible=np.ones(N, bool), d_background=None, d_camera=None,
    )  # fmt: skip


def test_gradients_reach_every_raw_array(gaussians):
    _, saved = scene_at(gaussians, SPECTRAL, MODEL, T)
    grads = gradients()
    back = scene_reverse(grads, saved)
    wanted = {name: getattr(grads, f"d_{name}") for name in ("position", "quaternion", "log_scale", "opacity_logit")}
    wanted["harmonics"] = grads.d_harmonics
    wanted["appearance_coefficients"] = appearance_reverse(grads.d_residual, saved.appearance).d_appearance_coefficients
    wanted["motion_coefficients"] = motion_reverse(grads.d_position, saved.motion).d_motion_coefficients
    assert back.by_field.keys() == wanted.keys() == arrays(gaussians).keys() - {"fdm_weight", "fdm_centre", "fdm_width"}
    for name, array in wanted.items():
        np.testing.assert_array_equal(back.by_field[name], array, err_msg=name)
    np.testing.assert_array_equal(back.d_offsets[:3], grads.d_position)
    np.testing.assert_array_equal(back.d_offsets[3:7], grads.d_quaternion)
    np.testing.assert_array_equal(back.d_offsets[7:], grads.d_log_scale)


def test_settings_of_the_raster_that_are_set_replace_those_of_its_preset():
    paper = PRESETS["paper"]
    assert raster_settings(PAPER) == paper._replace(near=PAPER.raster.near)
    raster = msgspec.structs.replace(PAPER.raster, near=0.7, alpha_cutoff=0.01, transmittance_stop=0.02, alpha_max=0.9)
    found = raster_settings(msgspec.structs.replace(PAPER, raster=raster))
    assert found == paper._replace(near=0.7, alpha_cutoff=0.01, transmittance_stop=0.02, alpha_max=0.9)


@pytest.mark.parametrize("left_out", ["appearance", "spectral_motion", ""])
def test_a_view_at_any_time_with_and_without_a_component(gaussians, left_out):
    chosen = gaussians
    if left_out == "appearance":
        chosen = gaussians._replace(appearance_coefficients=None)
    elif left_out:
        chosen = gaussians._replace(motion_coefficients=None)
    background = np.array([0.2, 0.5, 0.9])
    scene, _ = scene_at(chosen, SPECTRAL, MODEL, T)
    wanted, _ = render_forward(scene, CAMERA, raster_settings(CONFIG), degree=3, background=background)
    options = {left_out: False} if left_out else {}
    found = render_at(gaussians, SPECTRAL, CONFIG, CAMERA, T, background=background, **options)
    for name, image in found._asdict().items():
        np.testing.assert_array_equal(image, getattr(wanted, name), err_msg=name)
    whole = render_at(gaussians, SPECTRAL, CONFIG, CAMERA, T, background=background)
    assert np.array_equal(found.colour, whole.colour) == (not left_out)


def test_a_scene_that_is_not_finite_is_refused(gaussians):
    gaussians.opacity_logit[4] = np.nan
    with pytest.raises(ValueError, match=r"opacity_logit\[4\]"):
        render_at(gaussians, SPECTRAL, CONFIG, CAMERA, T)


def test_what_is_not_finite_in_the_deformation_is_named_where_it_arrives(gaussians):
    """`render_at` looks at the deformed scene, before the render."""
    weight = gaussians.fdm_weight.copy()
    weight[1, 0, 3] = np.nan
    with pytest.raises(ValueError, match=r"^position\[1, 3\] is nan"):
        render_at(gaussians._replace(fdm_weight=weight), spectral_from(MODEL, TIMES), CONFIG, CAMERA, 0.0)
