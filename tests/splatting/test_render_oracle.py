"""The definition of the render against an independent oracle: images, and every gradient by complex step."""

import numpy as np
import pytest
from made_up_scenes import IMAGES, assert_close, deviating, lens, random_scene, rules, run, turned_camera

from endotsr.splatting.settings import EXACT, LEGACY, PAPER, LegacyDeviations
from oracle import splatting_oracle as oracle

PRESETS = {"exact": EXACT, "paper": PAPER, "legacy": LEGACY, "between": PAPER._replace(support="everywhere")}
BACKGROUND = np.array([0.2, 0.5, 0.9])
H = 1e-40
CAMERA = turned_camera(33, 29, 24.0)


def scene_of(seed, count=60):
    """Wide field of view: some centres lie beyond the limit of the Jacobian clamp; some Gaussians are opaque."""
    scene = random_scene(seed, count, CAMERA, size=(0.5, 6.0))
    seen = CAMERA.rotation @ scene.position + CAMERA.translation[:, None]
    seen[0, 1:5] = np.abs(seen[2, 1:5]) * [1.1, -1.1, 0.2, 0.1]
    seen[1, 1:5] = np.abs(seen[2, 1:5]) * [0.2, 0.1, 1.1, -1.1]
    scene.position[:] = CAMERA.rotation.T @ (seen - CAMERA.translation[:, None])
    scene.log_scale[:, 1:5] = np.log(np.abs(seen[2, 1:5]) * 0.4)
    scene.opacity_logit[5:10] = 6.0
    return scene


def oracle_images(inputs, settings, degree=3):
    pose = (inputs["rotation_matrix"], inputs["translation"])
    return oracle.render(inputs, pose, lens(CAMERA), rules(settings), inputs["background"], degree)[:3]


def inputs_of(scene):
    named = {name: a for name, a in scene._asdict().items() if a is not None}
    pose = {"rotation_matrix": CAMERA.rotation, "translation": CAMERA.translation}
    return named | pose | {"background": BACKGROUND}


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("preset", list(PRESETS))
def test_images_equal_the_oracle(preset, degree):
    scene = scene_of(degree)
    images, _ = run(scene, CAMERA, PRESETS[preset], "definition", background=BACKGROUND, degree=degree)
    wanted = oracle_images(inputs_of(scene), PRESETS[preset], degree)
    assert np.ptp(images["colour"]) > 0.3 and (images["opacity"] > 0.1).mean() > 0.5
    assert_close(images, dict(zip(IMAGES, wanted)), 1e-12)


@pytest.mark.parametrize("preset, path", [*((preset, "definition") for preset in PRESETS), ("paper", "blocks")])
def test_every_gradient_equals_the_complex_step(preset, path):
    """Decisions are those of the point itself: valid on both sides of every kink, clamped Jacobians included."""
    settings = PRESETS[preset]._replace(deviations=LegacyDeviations())
    scene = scene_of(7)
    inputs = inputs_of(scene)
    images, _ = run(scene, CAMERA, settings, path, background=BACKGROUND)
    rng = np.random.default_rng(3)
    given = tuple(rng.normal(0, 1, images[name].shape) for name in IMAGES)
    _, gradients = run(scene, CAMERA, settings, path, background=BACKGROUND, given=given)
    blocks = {name: (name, np.ones(inputs[name].shape, bool)) for name in inputs}
    for axis in range(3):
        mask = np.zeros(scene.position.shape, bool)
        mask[axis] = True
        blocks[f"position {axis}"] = ("position", mask)
    clamped = np.zeros(scene.position.shape, bool)
    clamped[:, 1:5] = True
    blocks["position under the clamp"] = ("position", clamped)
    for label, (name, mask) in blocks.items():
        direction = rng.normal(0, 1, inputs[name].shape) * mask
        moved = {key: a.astype(complex) for key, a in inputs.items()}
        moved[name] = moved[name] + 1j * H * direction
        derivative = sum(np.sum(g * image.imag) / H for g, image in zip(given, oracle_images(moved, settings)))
        found = np.sum(gradients[name] * direction)
        scale = np.linalg.norm(gradients[name] * mask) * np.linalg.norm(direction)
        assert scale > 1e-3, label
        assert abs(found - derivative) <= 1e-10 * abs(derivative) + 1e-13 * scale, label


def staged(scene, settings):
    """What the compositing of the oracle takes, and the gradients it returns, for a scene of degree 0."""
    pose = (CAMERA.rotation, CAMERA.translation)
    sigma = oracle.covariance(scene.quaternion, scene.log_scale)
    u, v, a, b, c, z = oracle.project(scene.position, sigma, pose, lens(CAMERA), rules(settings))
    centre = -CAMERA.rotation.T @ CAMERA.translation
    rgb = oracle.colour(scene.harmonics, scene.residual, scene.position, centre, 0)
    return u, v, a, b, c, z, oracle.sigmoid(scene.opacity_logit), z > settings.near, rgb


@pytest.mark.parametrize("passes", [False, True])
@pytest.mark.parametrize("preset", ["exact", "paper", "legacy"])
def test_compositing_reverse_equals_the_loop_of_the_oracle(preset, passes):
    """mean2d, logit, degree-0 colour and background, with and without the pass through the alpha clamp."""
    settings = deviating(PRESETS[preset], pass_clamped_alpha=passes)
    scene = scene_of(11)
    scene.position[:, 1:5] *= 0.1
    scene.position[:] += CAMERA.rotation.T @ np.array([[0.0], [0.0], [1.0]])
    images, _ = run(scene, CAMERA, settings, "definition", background=BACKGROUND, degree=0)
    rng = np.random.default_rng(5)
    given = tuple(rng.normal(0, 1, images[name].shape) for name in IMAGES)
    _, found = run(scene, CAMERA, settings, "definition", background=BACKGROUND, degree=0, given=given)
    size = (CAMERA.width, CAMERA.height)
    stages = staged(scene, settings)
    wanted = oracle.composite_reverse(*given, *stages, BACKGROUND, *size, rules(settings), passes)
    wanted["residual"] = np.where(stages[-1] > 0, wanted["colour"], 0.0) * oracle.C0
    compared = ("mean2d", "opacity_logit", "residual", "background")
    assert_close({n: found[n] for n in compared}, {n: wanted[n] for n in compared}, 1e-11)
