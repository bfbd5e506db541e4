"""Spherical harmonics: the basis is orthonormal, hard cases H1, H2, H4, H5, clamps, residual."""

import numpy as np
import pytest
from made_up_scenes import U64, Y00, assert_bitwise, random_scene, run, turned_camera
from scipy.spatial.transform import Rotation

from endotsr.config import ModelConfig
from endotsr.definition import harmonics as definition
from endotsr.method.kernels.groups import GROUP
from endotsr.method.splatting.camera import camera_centre
from endotsr.method.splatting.harmonics import harmonics_forward, harmonics_reverse
from endotsr.method.splatting.settings import PAPER
from endotsr.training.fitting.model import scene_at, spectral_from
from endotsr.training.scene.gaussians import Gaussians


def directions(seed, count):
    v = np.random.default_rng(seed).normal(0, 1, (3, count))
    return v / np.linalg.norm(v, axis=0)


def basis_of_the_package(direction):
    """(16, N) by asking for the colour of one coefficient at a time."""
    n = direction.shape[1]
    out = np.empty((16, n))
    for k in range(16):
        h = np.zeros((16, 3, n))
        h[k] = 0.5
        out[k] = (harmonics_forward(h, None, direction, np.zeros(3), 3)[0][0] - 0.5) / 0.5
        h[k] = -0.5
        below = (harmonics_forward(h, None, direction, np.zeros(3), 3)[0][0] - 0.5) / -0.5
        out[k] = np.where(np.abs(below) > np.abs(out[k]), below, out[k])  # the side that is not clamped at zero
    return out


def test_basis_equals_the_definition_and_is_orthonormal():
    cosine, weight = np.polynomial.legendre.leggauss(8)
    longitude = np.arange(16) * (2 * np.pi / 16)
    sine = np.sqrt(1 - cosine**2)
    points = np.array(
        [
            (sine[:, None] * np.cos(longitude)).ravel(),
            (sine[:, None] * np.sin(longitude)).ravel(),
            np.repeat(cosine, 16),
        ]
    )
    y = basis_of_the_package(points)
    np.testing.assert_allclose(y, definition.basis(points, 16), atol=16 * U64)
    gram = (y * np.repeat(weight, 16) * (2 * np.pi / 16)) @ y.T
    np.testing.assert_allclose(gram, np.eye(16), atol=1e-13)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_bands_above_the_active_degree_are_not_read(degree):
    rng = np.random.default_rng(degree)
    h, position = rng.normal(0, 0.1, (16, 3, 30)), rng.normal(0, 1, (3, 30))
    h[(degree + 1) ** 2 :] = np.nan
    colour, saved = harmonics_forward(h, None, position, np.array([0.1, 0.2, 5.0]), degree)
    assert np.isfinite(colour).all()
    back = harmonics_reverse(np.ones((3, 30)), saved)
    assert np.isfinite(back.d_position).all() and back.d_residual is None
    assert (back.d_harmonics[(degree + 1) ** 2 :] == 0).all()
    assert back.d_harmonics[: (degree + 1) ** 2].any(axis=(1, 2)).all()
    for wrong in (-1, 4):
        with pytest.raises(ValueError, match="degree"):
            harmonics_forward(h, None, position, np.zeros(3), wrong)
    if degree < 3:
        with pytest.raises(ValueError, match="coefficients"):
            harmonics_forward(h[: (degree + 1) ** 2], None, position, np.zeros(3), degree + 1)


@pytest.mark.parametrize("count", [GROUP - 1, 2 * GROUP + 3])
def test_gradients_above_the_active_degree_are_zero_whatever_the_memory_held(count, monkeypatch):
    """Every group of Gaussians writes its own zeros: new arrays hold NaN here, and none is left."""
    h, position = np.full((16, 3, count), 0.1), np.ones((3, count))
    _, saved = harmonics_forward(h, None, position, np.zeros(3), 1)
    monkeypatch.setattr(np, "empty_like", lambda array: np.full_like(array, np.nan))
    back = harmonics_reverse(np.ones((3, count)), saved)
    assert (back.d_harmonics[4:] == 0).all() and np.isfinite(back.d_harmonics).all()


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_H1_at_the_camera_centre_band_0_only(dtype):
    rng = np.random.default_rng(1)
    centre = np.array([0.25, -0.5, 2.0], dtype)
    h = rng.normal(0, 0.1, (16, 3, 2)).astype(dtype)
    position = np.stack([centre, centre + dtype(1)], axis=1)
    colour, saved = harmonics_forward(h, None, position, centre, 3)
    np.testing.assert_allclose(colour[:, 0], 0.5 + Y00 * h[0, :, 0], rtol=4 * np.finfo(dtype).eps)
    back = harmonics_reverse(np.ones((3, 2), dtype), saved)
    assert (back.d_position[:, 0] == 0).all() and (back.d_harmonics[1:, :, 0] == 0).all()
    assert back.d_position[:, 1].any() and all(
        np.isfinite(a).all() for a in (back.d_position, back.d_harmonics, back.d_centre)
    )


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_H2_below_zero_the_colour_is_zero_with_zero_gradient(dtype):
    h = np.zeros((1, 3, 3), dtype)
    h[0] = np.array([-1.0, 0.0, 1.0]) / Y00
    colour, saved = harmonics_forward(h, None, np.ones((3, 3), dtype), np.zeros(3, dtype), 0)
    eps = np.finfo(dtype).eps
    np.testing.assert_allclose(colour, np.tile([0.0, 0.5, 1.5], (3, 1)), atol=2 * eps)  # and no upper clamp
    back = harmonics_reverse(np.ones((3, 3), dtype), saved)
    np.testing.assert_array_equal(back.d_harmonics[0], np.tile(np.array([0.0, Y00, Y00], dtype), (3, 1)))


def test_hard_H5_rotating_camera_scene_and_harmonics_together():
    """Every band turned by its own matrix, found from the values of the harmonics at rotated directions."""
    camera = turned_camera(33, 29, 25.0)
    scene = random_scene(2, 60, camera)
    turn = Rotation.from_euler("zyx", [0.7, -1.1, 0.4])
    matrix = turn.as_matrix()
    sample = directions(3, 400)
    harmonics = scene.harmonics.copy()
    for degree in range(1, 4):
        band = slice(degree**2, (degree + 1) ** 2)
        before, after = (definition.basis(points, 16)[band] for points in (sample, matrix @ sample))
        mixing = np.linalg.lstsq(after.T, before.T, rcond=None)[0]  # before = mixing^T after
        harmonics[band] = np.einsum("jk,kcn->jcn", mixing, scene.harmonics[band])
    quaternion = np.ascontiguousarray(
        (turn * Rotation.from_quat(scene.quaternion.T, scalar_first=True)).as_quat(scalar_first=True).T
    )
    turned = scene._replace(position=matrix @ scene.position, quaternion=quaternion, harmonics=harmonics)
    seen_from = camera._replace(rotation=camera.rotation @ matrix.T)
    images, _ = run(scene, camera, PAPER, "definition")
    other, _ = run(turned, seen_from, PAPER, "definition")
    for name in images:
        assert np.abs(other[name] - images[name]).max() <= 1e-12 * max(1.0, np.abs(images[name]).max())


@pytest.mark.parametrize("dtype, bound", [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_hard_H4_the_viewing_direction_is_that_of_the_deformed_centre(dtype, bound):
    """A deformed scene with harmonics equals one of degree 0 coloured at the deformed centres, not at the canonical."""
    camera, model = turned_camera(33, 29, 25.0), ModelConfig(bases=1)
    raw = random_scene(5, 40, camera)
    raw.harmonics[1:4] = np.random.default_rng(6).normal(0, 0.6, (3, 3, 40))
    weight = np.zeros((10, 1, 40))
    weight[:3] = np.random.default_rng(7).normal(0, 0.8, (3, 1, 40))
    curves = (weight, np.full((10, 1, 40), 0.4), np.full((10, 1, 40), 0.2))
    gaussians = Gaussians(*(np.ascontiguousarray(a, dtype) for a in (*raw[:5], *curves)))
    scene, _ = scene_at(gaussians, spectral_from(model, np.arange(20) / 20), model, 0.4)
    images, gradients = run(scene, camera, PAPER, degree=1)
    assert gradients["position"].any()
    centre = camera_centre(camera)
    shown = {}
    for name, position in (("deformed", scene.position), ("canonical", gaussians.position)):
        rgb, _ = definition.harmonics_forward(scene.harmonics, None, position, centre, 1)
        flat = scene._replace(harmonics=((rgb - 0.5) / Y00)[None].astype(dtype), residual=None)
        shown[name] = run(flat, camera, PAPER, degree=0)[0]["colour"]
    assert np.abs(shown["deformed"] - images["colour"]).max() <= bound
    assert np.abs(shown["canonical"] - images["colour"]).max() > 0.05


@pytest.mark.parametrize("count", [1, 300])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_zero_residual_changes_no_bit(dtype, count):
    rng = np.random.default_rng(4)
    h, position = rng.normal(0, 0.5, (16, 3, count)).astype(dtype), rng.normal(0, 1, (3, count)).astype(dtype)
    results = []
    for residual in (None, np.zeros((3, count), dtype)):
        colour, saved = harmonics_forward(h, residual, position, np.zeros(3), 3)
        back = harmonics_reverse(np.ones((3, count), dtype), saved)
        results.append({"colour": colour, "harmonics": back.d_harmonics, "position": back.d_position})
    assert_bitwise(*results)
    np.testing.assert_array_equal(back.d_residual, back.d_harmonics[0])
