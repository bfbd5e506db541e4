"""The compiled render against its definition in plain NumPy: images, and every gradient by complex step."""

import numpy as np
import pytest
from made_up_scenes import IMAGES, assert_close, deviating, random_scene, run, turned_camera

from endotsr.definition import render as definition
from endotsr.method.splatting.render import Scene
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER, LegacyDeviations

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


def images_of(inputs, settings, degree=3):
    scene = Scene(*(inputs[name] for name in Scene._fields))
    camera = CAMERA._replace(rotation=inputs["rotation_matrix"], translation=inputs["translation"])
    return definition.render_forward(scene, camera, settings, degree=degree, background=inputs["background"])


def inputs_of(scene):
    named = {name: a for name, a in scene._asdict().items() if a is not None}
    pose = {"rotation_matrix": CAMERA.rotation, "translation": CAMERA.translation}
    return named | pose | {"background": BACKGROUND}


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("preset", list(PRESETS))
def test_images_equal_the_definition(preset, degree):
    scene = scene_of(degree)
    images, _ = run(scene, CAMERA, PRESETS[preset], "definition", background=BACKGROUND, degree=degree)
    wanted, _ = images_of(inputs_of(scene), PRESETS[preset], degree)
    assert np.ptp(images["colour"]) > 0.3 and (images["opacity"] > 0.1).mean() > 0.5
    assert_close(images, wanted._asdict(), 1e-12)


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
    written = by_definition(inputs, settings, given)
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
        derivative = sum(np.sum(g * image.imag) / H for g, image in zip(given, images_of(moved, settings)[0]))
        for found in (gradients[name], written[name]):
            scale = np.linalg.norm(found * mask) * np.linalg.norm(direction)
            assert scale > 1e-3, label
            assert abs(np.sum(found * direction) - derivative) <= 1e-10 * abs(derivative) + 1e-13 * scale, label


def by_definition(inputs, settings, given, degree=3):
    """All gradients by name."""
    grads = definition.render_reverse(*given, images_of(inputs, settings, degree)[1])._asdict()
    camera = grads.pop("d_camera")
    grads |= {"d_rotation_matrix": camera.d_rotation, "d_translation": camera.d_translation}
    return {name.removeprefix("d_"): array for name, array in grads.items()}


@pytest.mark.parametrize("passes", [False, True])
@pytest.mark.parametrize("preset", ["exact", "paper", "legacy"])
def test_compositing_reverse_equals_the_loop_of_the_definition(preset, passes):
    """mean2d, logit, degree-0 colour and background, with and without the pass through the alpha clamp."""
    settings = deviating(PRESETS[preset], pass_clamped_alpha=passes)
    scene = scene_of(11)
    scene.position[:, 1:5] *= 0.1
    scene.position[:] += CAMERA.rotation.T @ np.array([[0.0], [0.0], [1.0]])
    images, _ = run(scene, CAMERA, settings, "definition", background=BACKGROUND, degree=0)
    rng = np.random.default_rng(5)
    given = tuple(rng.normal(0, 1, images[name].shape) for name in IMAGES)
    _, found = run(scene, CAMERA, settings, "definition", background=BACKGROUND, degree=0, given=given)
    wanted = by_definition(inputs_of(scene), settings, given, degree=0)
    compared = ("mean2d", "opacity_logit", "residual", "background")
    assert_close({n: found[n] for n in compared}, {n: wanted[n] for n in compared}, 1e-11)
