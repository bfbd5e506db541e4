"""Every compiled function against its definition in plain NumPy: made-up inputs, and the hard ones of golden/."""

import numpy as np
import pytest

from endotsr.definition.calibration import calibrate as plain_calibrate
from endotsr.definition.covariance import covariance_forward as plain_covariance
from endotsr.definition.render import render_forward as plain_render
from endotsr.definition.render import render_reverse as plain_reverse
from endotsr.method.equations.calibration import calibrate
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.covariance import covariance_forward
from endotsr.method.splatting.render import Scene, render_forward, render_reverse
from endotsr.method.splatting.settings import PRESETS
from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.operations.definition import definition_operations
from endotsr.port.operations.registry import method_operations
from makers.registry import JUDGED
from makers.twins import BOUNDS, distances, golden_requests, made_up, scaled

OPERATIONS, TWINS = method_operations(), definition_operations()
STORED = list(golden_requests(read_golden(golden_folder())))
REFERENCE_ALONE = {"determinism"}  # asks for the same bits twice, of one program


@pytest.mark.parametrize("name", TWINS)
def test_the_compiled_function_computes_its_definition(name):
    requests = [*made_up(OPERATIONS[name]), *(request for operation, request in STORED if operation == name)]
    found = distances(OPERATIONS[name], TWINS[name], requests, JUDGED[name])
    assert {d.output for d in found} <= JUDGED[name].keys() and found
    assert [d for d in found if not d.distance <= d.bound] == []


def test_every_operation_has_a_twin():
    assert OPERATIONS.keys() - TWINS.keys() == REFERENCE_ALONE
    for name, twin in TWINS.items():
        assert (twin.reverse is None) == (OPERATIONS[name].reverse is None), name
        assert twin.function.startswith("endotsr.definition."), name


def test_a_wrong_function_is_seen():
    """A gradient that is off by 1e-12 in one entry, a missing one and another integer."""
    operation, twin = OPERATIONS["motion"], TWINS["motion"]

    def wrong(cotangents, saved):
        found = twin.reverse(cotangents, saved)
        found["d_phi"] = found["d_phi"] * (1 + 1e-12 * (np.arange(6) == 2))
        return {name: found[name] for name in ("d_phi",)}

    found = {
        d.output: d for d in distances(operation, twin._replace(reverse=wrong), made_up(operation), JUDGED["motion"])
    }
    assert found["d_phi"].distance > found["d_phi"].bound
    assert found["d_motion_coefficients"].distance == np.inf
    assert found["translation"].distance <= found["translation"].bound
    assert scaled(np.array([1, 2]), np.array([1, 3]), "exact") == np.inf
    assert scaled(np.array([np.nan, 1.0]), np.array([0.0, 1.0]), "max") == np.inf


def test_a_larger_bound_has_a_reason():
    assert all(reason for _, reason in BOUNDS.values())


def test_a_view_whose_photometric_gradient_is_infinite_is_dropped_by_both():
    """Before, its ratio was 0 in the definition."""
    views = [("broken", np.inf, 1.0), ("right", 1.0, 2.0)]
    for function in (plain_calibrate, calibrate):
        assert function(views, 0.25).lambda_lap == 0.125 and function(views, 0.25).ratios.tolist() == [2.0]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("preset, path", [("exact", "definition"), ("legacy", "definition"), ("paper", "blocks")])
def test_an_opacity_that_is_no_number_is_seen_in_the_same_pixels(preset, path, dtype):
    """Where its support reaches; the ellipse of `paper` has none. Before, the definition drew the Gaussian opaque."""
    camera = Camera(np.eye(3), np.zeros(3), 20.0, 20.0, 8.0, 6.0, 40, 12)  # more than one tile of `legacy`
    shape = (np.tile(np.eye(4)[:, :1], 4), np.full((3, 4), np.log(0.05)))
    position = np.array([[0, 0.3, -0.5, 0.1], [0, 0.1, 0.2, 0.0], [4.0, 5.0, 6.0, 7.0]])
    logits, colour = np.array([0.5, np.nan, 1.0, np.nan]), np.random.default_rng(1).normal(0, 0.3, (1, 3, 4))
    scene = Scene(*(array.astype(dtype) for array in (position, *shape, logits, colour)))
    given = [np.ones(size, dtype) for size in ((3, 12, 40), (12, 40), (12, 40))]
    out, saved = render_forward(scene, camera, PRESETS[preset], degree=0, compositor=path)
    plain, plain_saved = plain_render(scene, camera, PRESETS[preset], degree=0)
    assert np.isnan(out.opacity).any() == (preset != "paper")
    pairs = [*zip(out, plain), *zip(render_reverse(*given, saved)[:5], plain_reverse(*given, plain_saved)[:5])]
    for found, expected in pairs:
        np.testing.assert_allclose(found, expected, rtol=1e-9 if dtype == np.float64 else 1e-3, atol=1e-4)


def test_a_log_scale_that_is_no_number_is_not_clipped_by_either():
    """Before, the definition drew such a Gaussian with the largest scale."""
    quaternion, log_scale = np.eye(4)[:, :1], np.array([[np.nan], [41.0], [-41.0]])
    for function in (plain_covariance, covariance_forward):
        scale = function(quaternion, log_scale)[0].scale[:, 0]
        assert np.isnan(scale[0]) and np.allclose(scale[1:], np.exp([40.0, -40.0]), rtol=1e-14)
