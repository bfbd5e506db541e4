"""A part that is off costs nothing: the same numbers as with zero coefficients, and not one array more."""

import numpy as np
import pytest
from terms import TERMS, alone, forward_functions

from endotsr.clips.effects.plan import with_setting
from endotsr.clips.effects.savings import numbers_of_a_gaussian
from endotsr.config import PAPER, LossConfig
from endotsr.method.equations import laplacian
from endotsr.method.equations.laplacian import support_masks
from endotsr.method.losses import smoothness
from endotsr.method.losses.smoothness import smoothness_forward, smoothness_reverse
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import render_forward, render_reverse
from endotsr.method.splatting.settings import PAPER as RASTER
from endotsr.training.fitting.model import scene_at, spectral_from, with_exposure, with_exposure_reverse
from endotsr.training.fitting.objective import LossWeights, frame_targets, full_weights, image_loss
from endotsr.training.fitting.state import bench_state
from endotsr.training.scene import workload
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.training.scene.initialisation import activate_residuals, gaussians_at
from endotsr.training.scene.parameters import Exposure

N, WIDTH, HEIGHT = 300, 48, 32
CAMERA = Camera(np.eye(3), np.zeros(3), 43.0, 43.0, WIDTH / 2, HEIGHT / 2, WIDTH, HEIGHT)


def made_up(changes: dict, residuals: bool = False) -> tuple[Gaussians, object]:
    """Random Gaussians with every coefficient of the parts that are on at its value at the start."""
    config = PAPER
    for key, value in changes.items():
        config = with_setting(config, key, value)
    rng = np.random.default_rng(3)
    position = np.stack([rng.uniform(-25, 25, N), rng.uniform(-18, 18, N), rng.uniform(40, 60, N)])
    fresh = gaussians_at(position, rng.uniform(0.1, 0.9, (3, N)), config.model, np.float32)
    if residuals:
        fresh = activate_residuals(
            fresh, config.model.frequencies, config.model.appearance, config.model.spectral_motion
        )
    return fresh, config


def view(gaussians, config, degree=None):
    """Images and gradients of one view at a time at which no time base is 0."""
    scene, _ = scene_at(gaussians, spectral_from(config.model, np.arange(10) / 10), config.model, 0.37)
    degree = config.model.harmonics_degree if degree is None else degree
    rendered, saved = render_forward(scene, CAMERA, RASTER, degree=degree)
    rng = np.random.default_rng(5)
    d_colour = rng.normal(size=rendered.colour.shape).astype(np.float32)
    d_depth = rng.normal(size=rendered.depth.shape).astype(np.float32)
    return rendered, render_reverse(d_colour, d_depth, None, saved)


SHARED = ("d_position", "d_quaternion", "d_log_scale", "d_opacity_logit", "d_mean2d", "visible")


@pytest.mark.parametrize(
    "off",
    [
        {"model.appearance": False},
        {"model.spectral_motion": False},
        {"model.deformation": False},
        {"model.harmonics_degree": 0},
        {"model.harmonics_degree": 1},
        {"model.harmonics_degree": 2},
        {"model.appearance": False, "model.spectral_motion": False, "model.deformation": False,
         "model.harmonics_degree": 0},
    ],
    ids=["appearance", "spectral_motion", "deformation", "degree 0", "degree 1", "degree 2", "all"],
)  # fmt: skip
def test_off_equals_on_with_zero_coefficients_bitwise(off):
    """Images, and the gradients of everything that both have."""
    everything, nothing = view(*made_up({}, residuals=True)), view(*made_up(off, residuals=True))
    assert everything[0].colour.max() > 0.1
    for one, two in zip(everything[0], nothing[0]):
        np.testing.assert_array_equal(one, two)
    for name in SHARED:
        np.testing.assert_array_equal(getattr(everything[1], name), getattr(nothing[1], name), err_msg=name)
    coefficients = nothing[1].d_harmonics.shape[0]
    np.testing.assert_array_equal(everything[1].d_harmonics[:coefficients], nothing[1].d_harmonics)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("residuals", [True, False])
def test_memory_is_that_of_the_parts_that_are_on(degree, residuals):
    """(degree + 1)^2 coefficients in the Gaussians and in both moments, and nothing for a part that is off."""
    off = {} if residuals else {"model.appearance": False, "model.spectral_motion": False, "model.deformation": False}
    gaussians, config = made_up({"model.harmonics_degree": degree} | off, residuals=True)
    state = bench_state(gaussians, config, 10)
    assert gaussians.harmonics.shape == ((degree + 1) ** 2, 3, N)
    assert sum(a.size for a in arrays(gaussians).values()) == N * numbers_of_a_gaussian(config)
    for moments in (state.adam.first, state.adam.second):
        assert sum(a.size for a in moments.values()) == N * numbers_of_a_gaussian(config)


def test_exposure_off_equals_an_exposure_of_zero_bitwise():
    rendered, _ = view(*made_up({}))
    zero = np.zeros(3, np.float32)
    (on, saved), (off, nothing) = with_exposure(rendered, Exposure(zero, zero)), with_exposure(rendered, None)
    assert nothing is None and saved is not None
    np.testing.assert_array_equal(on.colour, off.colour)
    d_colour = np.random.default_rng(6).normal(size=on.colour.shape).astype(np.float32)
    np.testing.assert_array_equal(with_exposure_reverse(d_colour, saved)[0], with_exposure_reverse(d_colour, None)[0])


def switched_off(term):
    """The configuration of the paper with one term off: by its weight, or as a component of the model."""
    of_loss = f"{term}_weight" in LossConfig.__struct_fields__
    return with_setting(PAPER, *((f"loss.{term}_weight", 0.0) if of_loss else (f"model.{term}", False)))


@pytest.mark.parametrize("name", TERMS)
def test_a_loss_that_is_off_equals_the_loss_of_weight_zero_bitwise(name, monkeypatch):
    """Loss and gradients; when it is off its functions are not called, and its target is not made."""
    rendered, _ = view(*made_up({}))
    frame, config = workload.sequence(WIDTH, HEIGHT, frames=4).frame(0), switched_off(name)
    weights = LossWeights(*(max(weight, 0.5) for weight in full_weights(PAPER.loss, 0.8)))._replace(**{name: 0.0})
    whole, bare = frame_targets(frame, PAPER), frame_targets(frame, config)
    assert {one for one, target in bare._asdict().items() if target is None} == targets_of(name, rendered, whole)
    value, *gradients = alone(name, rendered, frame, 0.0)
    assert value > 0 and not any(np.any(gradient) for gradient in gradients)
    on = image_loss(rendered, whole, weights, PAPER.loss)
    for function in forward_functions(name):
        monkeypatch.setattr(f"endotsr.training.fitting.objective.{function}", None)
    off = image_loss(rendered, bare, weights, config.loss)
    assert on.loss == off.loss and off.terms.keys() == {"l1", *TERMS} - {name}
    for gradient in ("d_colour", "d_depth"):
        np.testing.assert_array_equal(getattr(on, gradient), getattr(off, gradient))
    assert off.d_colour.any()


def targets_of(term, rendered, whole):
    """The targets without which a term is not evaluated; none for one that compares with image and mask alone."""
    on = LossWeights(*(0.5 for _ in TERMS))
    without = {one: whole._replace(**{one: None}) for one in set(whole._fields) - {"image", "mask"}}
    return {one for one, bare in without.items() if term not in image_loss(rendered, bare, on, PAPER.loss).terms}


# --- masks that exclude nothing ---


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (3, 5), (9, 12), (32, 48), (31, 17)])
@pytest.mark.parametrize("rule", ["co_sited", "half_pixel"])
def test_full_mask_needs_no_propagation(shape, rule, monkeypatch):
    """The bands are those that propagation gives, and propagation is not run."""
    mask, expected, valid = np.ones(shape, bool), [], np.ones(shape, bool)
    for _ in range(3):
        coarse = laplacian._reduce_support(valid)
        expected.append(valid & laplacian._expand_support(coarse, valid.shape, rule))
        valid = coarse
    monkeypatch.setattr(laplacian, "_reduce_support", None)
    found = support_masks(mask, 3, rule)
    assert [band.shape for band in found.bands] == [band.shape for band in expected]
    for band, wanted in zip(found.bands, expected):
        np.testing.assert_array_equal(band, wanted)


def test_full_mask_needs_no_total_variation(monkeypatch):
    """The terms under the mask are exactly 0 for a full mask, in value and gradient, and are not computed."""
    rng = np.random.default_rng(0)
    depth, image = rng.uniform(40, 60, (20, 30)), rng.uniform(0, 1, (3, 20, 30))
    mask, edges = np.ones((20, 30), bool), rng.random((20, 30)) < 0.1
    assert smoothness._total_variation(image, mask) == 0.0
    whole, saved = smoothness_forward(depth, image, mask, edges, 0.0)
    expected = smoothness_reverse(1.0, saved)
    monkeypatch.setattr(smoothness, "_total_variation", None)
    monkeypatch.setattr(smoothness, "_variation_reverse_kernel", None)
    loss, saved = smoothness_forward(depth, image, mask, edges, 30.0)
    assert loss == whole > 0
    for one, two in zip(smoothness_reverse(1.0, saved), expected):
        np.testing.assert_array_equal(one, two)
