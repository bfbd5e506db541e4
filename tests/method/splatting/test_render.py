"""The whole render: threads, presets, deviations of `legacy`, zero residuals, extreme and real inputs, input checks."""

import numpy as np
import pytest
from made_up_scenes import (
    FIELDS,
    Y00,
    as_dtype,
    assert_bitwise,
    assert_close,
    assert_close_l2,
    assert_finite,
    deviating,
    plain_camera,
    random_scene,
    run,
    select,
    threads,
    turned_camera,
)

from data_folder import data_folder
from endotsr.config import ModelConfig
from endotsr.definition import render as definition
from endotsr.definition.compositing import composite_reverse as composite_by_definition
from endotsr.definition.covariance import covariance_matrix
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import Scene, check_scene, render_forward, render_reverse
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER, PRESETS
from endotsr.training.fitting.model import scene_at, spectral_from
from endotsr.training.scene.gaussians import Gaussians

__all__ = ["threads"]
BACKGROUND = np.array([0.3, 0.6, 0.1])
CAMERA = turned_camera()


def paths(settings):
    return ["definition", "blocks"] if settings is PAPER else ["definition"]


CASES = [(name, path) for name, settings in PRESETS.items() for path in paths(settings)]


# --- reproducible, whatever the number of threads ---


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("preset, path", CASES)
def test_one_and_two_threads_and_two_runs_agree_bit_by_bit(preset, path, dtype, threads):
    scene = random_scene(0, 700, CAMERA, dtype=dtype)  # several blocks of 256
    results = []
    for count in (1, 2, 2, 1):
        threads(count)
        results.append(run(scene, CAMERA, PRESETS[preset], path, background=BACKGROUND))
    for images, gradients in results[1:]:
        assert_bitwise(images, results[0][0])
        assert_bitwise(gradients, results[0][1])


@pytest.mark.parametrize("preset, path", CASES)
def test_float32_against_float64_at_the_same_rounded_inputs(preset, path):
    """Cosine >= 1 - 1e-6 and relative L2 <= 1e-4 for every gradient."""
    scene = random_scene(1, 150, CAMERA, dtype=np.float32)
    small = run(scene, CAMERA, PRESETS[preset], path, background=BACKGROUND, given=None)
    given = tuple(np.float64(np.float32(a)) for a in cotangents_of(small[0]))
    small = run(
        scene, CAMERA, PRESETS[preset], path, background=BACKGROUND, given=tuple(a.astype(np.float32) for a in given)
    )
    large = run(as_dtype(scene, np.float64), CAMERA, PRESETS[preset], path, background=BACKGROUND, given=given)
    for one, two in zip(small, large):
        assert all(a.dtype == np.float32 for a in one.values())
        assert_close_l2(one, two, 1e-4)


def cotangents_of(images):
    rng = np.random.default_rng(2)
    return tuple(rng.normal(0, 1, images[name].shape) for name in ("colour", "depth", "opacity"))


def test_gradients_that_nobody_asks_for_are_not_made():
    scene = random_scene(4, 30, CAMERA)._replace(residual=None)
    out, saved = render_forward(scene, CAMERA, PAPER)
    grads = render_reverse(np.ones_like(out.colour), np.ones_like(out.depth), None, saved)
    assert grads.d_background is None and grads.d_camera is None and grads.d_residual is None
    zero = render_reverse(np.ones_like(out.colour), np.ones_like(out.depth), np.zeros_like(out.depth), saved)
    for name in FIELDS[:5]:
        np.testing.assert_array_equal(getattr(grads, f"d_{name}"), getattr(zero, f"d_{name}"))


@pytest.mark.parametrize("preset, path", CASES)
def test_visible_is_who_reaches_a_pixel_box(preset, path):
    scene = random_scene(5, 120, CAMERA)
    out, saved = render_forward(scene, CAMERA, PRESETS[preset], compositor=path)
    grads = render_reverse(np.ones_like(out.colour), np.ones_like(out.depth), None, saved)
    hidden = ~grads.visible
    assert hidden.any() and grads.visible.any()
    for name in (*FIELDS, "mean2d"):
        assert (getattr(grads, f"d_{name}")[..., hidden] == 0).all(), name


# --- nothing to see ---


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("preset, path", CASES)
@pytest.mark.parametrize("size", [(1, 1), (2, 40), (65, 47)])
def test_no_gaussians_or_none_in_view_give_the_background(preset, path, size, dtype):
    camera = plain_camera(*size)
    some = random_scene(6, 12, camera, dtype=dtype)
    behind = some._replace(position=some.position * np.array([[1], [1], [0]], dtype) - dtype(1))
    for scene in (select(some, []), behind):
        images, gradients = run(scene, camera, PRESETS[preset], path, background=BACKGROUND)
        wanted = np.broadcast_to(BACKGROUND.astype(dtype)[:, None, None], images["colour"].shape)
        np.testing.assert_array_equal(images["colour"], wanted)
        assert not images["depth"].any() and not images["opacity"].any()
        assert all(not gradients[name].any() for name in FIELDS)


# --- components that are off or zero ---


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_zero_coefficients_leave_image_and_base_gradients_bitwise_unchanged(dtype):
    """Equations (2) and (3) with A = C = 0 against the model without them."""
    n, model = 80, ModelConfig(bases=3)
    raw = random_scene(7, n, CAMERA, dtype=dtype)
    spectral = spectral_from(model, np.arange(20) / 20)
    rng = np.random.default_rng(8)
    curves = [rng.normal(0, 0.05, (10, 3, n)).astype(dtype) for _ in range(3)]
    base = Gaussians(*raw[:5], *curves)
    zeros = np.zeros((3, 2 * model.frequencies, n), dtype)
    results = []
    for gaussians in (base, base._replace(appearance_coefficients=zeros, motion_coefficients=zeros)):
        scene, _ = scene_at(gaussians, spectral, model, 0.37)
        results.append(run(scene, CAMERA, PAPER, background=BACKGROUND))
    (images, gradients), (same, more) = results
    assert_bitwise(images, same)
    assert set(more) - set(gradients) == {"residual"}
    assert_bitwise(gradients, {name: more[name] for name in gradients})


# --- deviations of `legacy`, each alone ---


def deviation_scene():
    """Opaque ones, off-axis ones, small determinants."""
    camera = turned_camera(33, 29, 24.0)
    scene = random_scene(9, 60, camera, size=(0.05, 6.0))
    scene.opacity_logit[::3] = 7.0
    seen = camera.rotation @ scene.position + camera.translation[:, None]
    seen[2] = np.abs(seen[2])
    seen[0, :10] = 1.2 * seen[2, :10]
    scene.log_scale[:, :10] = np.log(0.3 * seen[2, :10])
    scene.position[:] = camera.rotation.T @ (seen - camera.translation[:, None])
    return scene, camera, seen


FLAGS = ("drop_depth_to_z", "pass_clamped_alpha", "double_clamp_term", "conic_epsilon")


@pytest.mark.parametrize("flag", FLAGS)
def test_a_deviation_leaves_the_forward_pass_alone_and_changes_a_gradient(flag):
    scene, camera, _ = deviation_scene()
    plain = run(scene, camera, PAPER, "definition", background=BACKGROUND)
    other = run(scene, camera, deviating(PAPER, **{flag: True}), "definition", background=BACKGROUND)
    assert_bitwise(plain[0], other[0])
    changed = {name for name in plain[1] if not np.array_equal(plain[1][name], other[1][name])}
    pose = {"rotation_matrix", "translation"}
    footprint = {"position", "quaternion", "log_scale"}
    wanted = {
        "drop_depth_to_z": {"position"} | pose,
        "pass_clamped_alpha": footprint | pose | {"opacity_logit", "mean2d"},
        "double_clamp_term": {"position"} | pose,
        "conic_epsilon": footprint | pose,
    }[flag]
    assert changed == wanted


def test_legacy_drop_depth_to_z_drops_exactly_the_share_of_z():
    scene, camera, _ = deviation_scene()
    images, _ = run(scene, camera, PAPER, "definition")
    rng = np.random.default_rng(10)
    g = rng.normal(0, 1, images["depth"].shape)
    given = (np.zeros_like(images["colour"]), g, np.zeros_like(g))
    plain = run(scene, camera, PAPER, "definition", given=given)[1]
    dropped = run(scene, camera, deviating(PAPER, drop_depth_to_z=True), "definition", given=given)[1]
    # sum over pixels of alpha T g, from a render whose colour is 1 for one Gaussian and whose loss is <g, red>
    red = (np.stack([g, 0 * g, 0 * g]), 0 * g, 0 * g)
    flat = scene._replace(harmonics=np.ones((1, 3, 60)), residual=None)
    share = run(flat, camera, PAPER, "definition", given=red)[1]["harmonics"][0, 0] / Y00
    difference = plain["position"] - dropped["position"]
    assert_close({"z": difference}, {"z": camera.rotation[2][:, None] * share}, 1e-10)
    assert np.linalg.norm(difference) > 0.1 * np.linalg.norm(plain["position"])


def test_legacy_double_clamp_term_doubles_exactly_the_share_of_z_under_the_clamp():
    """Exact: f x' / z^3 g_J02; CUDA rasterisers: twice that; the same for y. Free centres do not deviate."""
    scene, camera, seen = deviation_scene()
    plain = run(scene, camera, PAPER, "definition")[1]
    double = run(scene, camera, deviating(PAPER, double_clamp_term=True), "definition")[1]
    limit_x, limit_y = 1.3 * camera.width / (2 * camera.fx), 1.3 * camera.height / (2 * camera.fy)
    clamped_x, clamped_y = np.abs(seen[0] / seen[2]) > limit_x, np.abs(seen[1] / seen[2]) > limit_y
    difference = camera.rotation @ (double["position"] - plain["position"])
    free = ~(clamped_x | clamped_y)
    assert (difference[:, free] == 0).all() and np.abs(difference[:2]).max() <= 1e-12 * np.abs(difference).max()
    # g_J02 and g_J12 from the gradient by (a, b, c), which the definition's compositing reverse gives
    _, saved = definition.render_forward(scene, camera, PAPER)
    abc = composite_by_definition(*cotangents_as_in_run(camera), saved.composite).d_covariance2d
    sigma, z = covariance_matrix(saved.projection.shape), np.where(saved.projection.visible, seen[2], 1)
    slope_x, slope_y = np.clip(seen[0] / z, -limit_x, limit_x), np.clip(seen[1] / z, -limit_y, limit_y)
    nil = np.zeros_like(z)
    j = np.array([[camera.fx / z, nil, -camera.fx * slope_x / z], [nil, camera.fy / z, -camera.fy * slope_y / z]])
    in_camera = np.einsum("ij,jkn,lk->iln", camera.rotation, sigma, camera.rotation)
    g2 = np.array([[abc[0], abc[1] / 2], [abc[1] / 2, abc[2]]])
    g_j = 2 * np.einsum("ijn,jkn,kln->iln", g2, j, in_camera)
    wanted = np.where(clamped_x, camera.fx * slope_x / z**2 * g_j[0, 2], 0.0)
    wanted += np.where(clamped_y, camera.fy * slope_y / z**2 * g_j[1, 2], 0.0)
    assert_close({"z": difference[2]}, {"z": wanted}, 1e-9)


def cotangents_as_in_run(camera):
    rng = np.random.default_rng(0)
    shapes = ((3, camera.height, camera.width), (camera.height, camera.width), (camera.height, camera.width))
    colour, depth, opacity = (rng.normal(0, 1, shape) for shape in shapes)
    return colour, depth * 0.1, opacity


def test_legacy_conic_epsilon_scales_the_gradient_of_the_shape():
    """By det^2 / (det^2 + 1e-7): a factor of 1 - 1.2e-5 for a splat of nothing but the low-pass."""
    scene, camera, _ = deviation_scene()
    plain = run(scene, camera, PAPER, "definition")[1]
    other = run(scene, camera, deviating(PAPER, conic_epsilon=True), "definition")[1]
    _, saved = definition.render_forward(scene, camera, PAPER)
    square = saved.composite.projected.determinant**2
    factor = square / (square + 1e-7)
    assert factor.min() < 1 - 1e-7
    for name in ("log_scale", "quaternion"):
        assert_close({name: other[name]}, {name: factor * plain[name]}, 1e-13)


def test_the_preset_legacy_has_every_deviation():
    assert all(LEGACY.deviations) and not any(PAPER.deviations) and not any(EXACT.deviations)
    assert FLAGS == LEGACY.deviations._fields


# --- extreme but finite ---


def extreme_scene(dtype):
    """Every field at its ends, one at a time, beside ordinary Gaussians."""
    big = float(np.finfo(dtype).max) / 4
    camera = plain_camera(33, 29, 25.0)
    near = float(np.nextafter(dtype(0.2), dtype(1)))
    scene = random_scene(11, 64, camera, dtype=dtype)
    scene.position[2] = np.abs(scene.position[2]) + dtype(0.3)
    ends = {
        "position": [(0, 1e15), (0, -1e15), (1, 1e15), (2, 1e6), (2, near), (2, -big), (0, big), (1, -big)],
        "quaternion": [(0, 1e-37), (1, 1e37), (2, -1e37), (3, 1e-45)],
        "log_scale": [(0, -800.0), (1, 800.0), (2, 40.0), (0, 1e30), (1, -1e30), (2, 12.0)],
    }
    k = 0
    for name, entries in ends.items():
        for axis, value in entries:
            if name == "quaternion" and abs(value) < 1:
                scene.quaternion[:, k] = 0
            getattr(scene, name)[axis, k] = value
            k += 1
    for value in (big, -big, 800.0, -800.0):
        scene.opacity_logit[k] = value
        k += 1
    scene.position[:, k : k + 3] = [[1e3], [1e3], [near]]  # u = 1e5 px, just behind the near plane
    scene.log_scale[:, k : k + 3] = [[5.0, -30.0, 0.0]]
    scene.harmonics[:, :, k + 3] = 0
    scene.harmonics[0, :, k + 3] = 1e15
    assert k + 3 < 64
    return scene, camera


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("preset, path", CASES)
def test_finite_extreme_inputs_give_finite_images_and_gradients(preset, path, dtype):
    scene, camera = extreme_scene(dtype)
    check_scene(scene)
    images, gradients = run(scene, camera, PRESETS[preset], path, background=BACKGROUND)
    assert_finite(images, gradients)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", [name for name in FIELDS])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_hard_P6_input_that_is_not_finite_is_refused_with_name_and_index(name, value, dtype):
    scene = random_scene(12, 30, CAMERA, dtype=dtype)
    check_scene(scene)
    check_scene(scene._replace(residual=None))
    array = getattr(scene, name)
    index = tuple(np.random.default_rng(13).integers(0, array.shape))
    array[index] = value
    place = ", ".join(str(int(i)) for i in index)
    with pytest.raises(ValueError, match=rf"{name}\[{place}\] is {value}"):
        check_scene(scene)


# --- real scenes ---


@pytest.mark.data
@pytest.mark.parametrize("name", ["biker_splats", "guitar_splats"])
def test_trained_real_scenes_in_float32(name):
    """Needles of tiny scale, seen from outside and from within: finite, and both paths agree."""
    with np.load(data_folder("trained_splats") / f"{name}.npz") as file:
        data = {key: file[key][::4] for key in ("xyz", "log_scale", "quat_wxyz", "rgb", "opacity")}
    opacity = np.clip(data["opacity"].astype(np.float64), 1e-6, 1 - 1e-6)
    scene = as_dtype(
        Scene(
            data["xyz"].T, data["quat_wxyz"].T, data["log_scale"].T + np.log(4) / 3,
            np.log(opacity / (1 - opacity)), ((data["rgb"].T - 0.5) / Y00)[None],
        ),
        np.float32,
    )  # fmt: skip
    low, high = np.percentile(data["xyz"], [5, 95], axis=0)
    for distance in (1.5, 0.1):
        middle = (low + high) / 2 - np.array([0, 0, distance * np.max(high - low)])
        camera = Camera(np.eye(3), -middle, 130.0, 130.0, 80.0, 60.0, 160, 120)
        results = []
        for path in ("definition", "blocks"):
            images, gradients = run(scene, camera, PAPER, path, background=BACKGROUND)
            assert_finite(images, gradients)
            results.append((images, gradients))
        assert (results[0][0]["opacity"] > 0.5).mean() > 0.02
        assert_close(
            results[1][0], results[0][0], 2e-2
        )  # a pixel within rounding of cutoff or stop may decide otherwise
        assert_close_l2(results[1][0], results[0][0], 1e-4)
        assert_close_l2(results[1][1], results[0][1], 2e-4)
