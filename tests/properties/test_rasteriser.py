"""Properties of the render (B2-B5) that hold for every scene."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from made_up_scenes import FIELDS, as_dtype, assert_bitwise, assert_close, assert_finite, run, select
from scipy.spatial.transform import Rotation

from endotsr.method.splatting.binning import screen_boxes
from endotsr.method.splatting.projection import Projected
from endotsr.method.splatting.render import Scene
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER
from properties.strategies import CAMERA, HIDDEN, RASTER, SEEDS, Y00, scenes

BACKGROUND = np.array([0.3, 0.6, 0.1])


def joined(one: Scene, two: Scene) -> Scene:
    return Scene(*(None if a is None else np.concatenate([a, b], axis=-1) for a, b in zip(one, two)))


def single(z: float, dtype, logit: float = 1.0, log_scale: float = -1.0, x: float = 0.0) -> Scene:
    """One Gaussian, on the axis of CAMERA where x is 0."""
    parts = ([[x], [0.0], [z]], [[1.0], [0.0], [0.0], [0.0]], [[log_scale]] * 3, [logit], [[[1.0]] * 3])
    return Scene(*(np.array(a, dtype) for a in parts))


@given(scenes(), RASTER)
@example(single(float(np.nextafter(0.2, 1)), np.float32, 800.0), ("blocks", PAPER))
@example(single(1.0, np.float32, log_scale=12.0), ("definition", LEGACY))  # det^2 of conic_epsilon was infinite
@example(single(1.0, np.float32, x=1e15), ("blocks", PAPER))  # a centre that no pixel index can hold
def test_finite_scenes_give_finite_images_and_gradients(scene, how):
    path, settings = how
    assert_finite(*run(scene, CAMERA, settings, path, background=BACKGROUND))


@given(scenes(), RASTER)
def test_weights_and_transmittance_make_one(scene, how):
    """Black Gaussians on a white background: the image is T, and T + opacity = 1."""
    path, settings = how
    black = scene._replace(harmonics=np.full_like(scene.harmonics, -0.5 / Y00 - 1))
    images, _ = run(black, CAMERA, settings, path, background=np.ones(3))
    slack = 8 * (1 + scene.position.shape[1]) * np.finfo(scene.position.dtype).eps
    assert np.abs(images["colour"] + images["opacity"] - 1).max() <= slack
    assert images["opacity"].min() >= 0 and images["opacity"].max() <= 1 + slack


@given(scenes(), RASTER)
def test_colour_and_depth_stay_between_what_is_mixed(scene, how):
    path, settings = how
    images, _ = run(scene, CAMERA, settings, path, background=BACKGROUND)
    slack = 64 * np.finfo(scene.position.dtype).eps
    shown = np.concatenate([np.maximum(0.5 + Y00 * scene.harmonics[0], 0), BACKGROUND[:, None]], axis=1)
    assert (images["colour"] >= shown.min(axis=1)[:, None, None] - 2 * slack).all()
    assert (images["colour"] <= shown.max(axis=1)[:, None, None] + 2 * slack).all()
    nearest, farthest = (scene.position[2].clip(0.2).min(), scene.position[2].max()) if scene.position.size else (0, 0)
    assert (images["depth"] >= (1 - slack) * nearest * images["opacity"] - slack).all()
    assert (images["depth"] <= (1 + slack) * max(farthest, 0) * images["opacity"] + slack).all()


@given(scenes(distinct=True), RASTER, SEEDS)
def test_order_of_the_input_does_not_matter(scene, how, seed):
    path, settings = how
    order = np.random.default_rng(seed).permutation(scene.position.shape[1])
    images, gradients = run(scene, CAMERA, settings, path, background=BACKGROUND)
    other, back = run(select(scene, order), CAMERA, settings, path, background=BACKGROUND)
    assert_bitwise(other, images)
    for name in (*FIELDS[:5], "mean2d"):
        np.testing.assert_array_equal(back[name], gradients[name][..., order], err_msg=name)


@given(scenes(), RASTER, HIDDEN)
def test_what_is_not_in_front_of_the_near_plane_changes_no_bit(scene, how, z):
    path, settings = how
    images, gradients = run(scene, CAMERA, settings, path, background=BACKGROUND)
    more = joined(single(z, scene.position.dtype), scene)
    other, back = run(more, CAMERA, settings, path, background=BACKGROUND)
    assert_bitwise(other, images)
    for name in FIELDS[:5]:
        np.testing.assert_array_equal(back[name][..., 1:], gradients[name], err_msg=name)
        assert not back[name][..., 0].any(), name


@given(scenes(depths=st.floats(0.5, 9.0)), RASTER)
def test_what_is_behind_takes_no_weight_from_what_is_in_front(scene, how):
    """The gradient by a colour is its weight: the same bits with and without a Gaussian behind all others."""
    path, settings = how
    given_images = (np.ones((3, 7, 9), scene.position.dtype), *(np.zeros((7, 9), scene.position.dtype),) * 2)
    alone = run(scene, CAMERA, settings, path, given=given_images)[1]
    more = joined(scene, single(50.0, scene.position.dtype))
    both = run(more, CAMERA, settings, path, given=given_images)[1]
    np.testing.assert_array_equal(both["harmonics"][..., :-1], alone["harmonics"])


@given(scenes(), RASTER, st.permutations(range(3)))
def test_colour_channels_do_not_mix(scene, how, order):
    path, settings = how
    images, _ = run(scene, CAMERA, settings, path, background=BACKGROUND)
    turned = scene._replace(harmonics=np.ascontiguousarray(scene.harmonics[:, order]))
    other, _ = run(turned, CAMERA, settings, path, background=BACKGROUND[list(order)])
    np.testing.assert_array_equal(other["colour"], images["colour"][list(order)])
    np.testing.assert_array_equal(other["depth"], images["depth"])


@given(scenes(tame=True, distinct=True, dtype=np.float64), SEEDS)
def test_moving_scene_and_camera_together_moves_gradients_along(scene, seed):
    """Images equal, gradients by position turned, all others equal. Equal depths would part by rounding: distinct."""
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(random_state=rng), rng.normal(0, 3, 3)
    matrix = turn.as_matrix()
    quaternion = (turn * Rotation.from_quat(scene.quaternion.T, scalar_first=True)).as_quat(scalar_first=True).T
    length = np.linalg.norm(scene.quaternion, axis=0)
    moved = scene._replace(
        position=matrix @ scene.position + shift[:, None], quaternion=np.ascontiguousarray(quaternion * length)
    )
    seen_from = CAMERA._replace(rotation=matrix.T.copy(), translation=-matrix.T @ shift)
    images, gradients = run(scene, CAMERA, EXACT, background=BACKGROUND)
    other, back = run(moved, seen_from, EXACT, background=BACKGROUND)
    assert_close(other, images, 1e-9)
    back["position"] = matrix.T @ back["position"]
    largest = max(float(np.abs(gradients[name]).max(initial=0)) for name in FIELDS[:5])
    for name in ("position", "log_scale", "opacity_logit", "harmonics"):
        assert np.abs(back[name] - gradients[name]).max(initial=0) <= 1e-8 * max(largest, 1e-6), name


@given(scenes(tame=True, depths=st.floats(1.0, 9.0), dtype=np.float64))
def test_a_mirrored_scene_gives_the_mirrored_image(scene):
    mirror = np.array([[-1.0], [1.0], [1.0]])
    flipped = scene._replace(
        position=scene.position * mirror, quaternion=scene.quaternion * np.array([[1.0], [1.0], [-1.0], [-1.0]])
    )
    camera = CAMERA._replace(cx=CAMERA.width - CAMERA.cx)
    images, _ = run(scene, CAMERA, EXACT, background=BACKGROUND)
    other, _ = run(flipped, camera, EXACT, background=BACKGROUND)
    assert_close({name: a[..., ::-1] for name, a in other.items()}, images, 1e-10)


@given(scenes(tame=True, depths=st.floats(1.0, 9.0), dtype=np.float64), st.sampled_from([1e-3, 0.1, 25.4, 1e3]))
def test_the_unit_of_length_does_not_matter(scene, factor):
    scaled = scene._replace(position=scene.position * factor, log_scale=scene.log_scale + np.log(factor))
    images, _ = run(scene, CAMERA, EXACT, background=BACKGROUND)
    other, _ = run(scaled, CAMERA, EXACT._replace(near=EXACT.near * factor), background=BACKGROUND)
    other["depth"] = other["depth"] / factor
    assert_close(other, images, 1e-10)


@given(scenes(dtype=np.float64), st.sampled_from([1e-1, 1e-2, 1e-4, 1e-6]))
def test_the_stop_costs_at_most_the_transmittance_it_leaves(scene, stop):
    """Dropped behind the stop: T < stop / (1 - alpha) <= 100 stop, in colours up to 1.2."""
    free = PAPER._replace(transmittance_stop=0.0)
    exact = run(scene, CAMERA, free, "definition", background=BACKGROUND)[0]
    short = run(scene, CAMERA, PAPER._replace(transmittance_stop=stop), "definition", background=BACKGROUND)[0]
    assert np.abs(short["colour"] - exact["colour"]).max() <= 1.2 * min(1.0, 100 * stop) + 1e-12


@given(scenes(dtype=np.float32), RASTER)
def test_the_dtype_of_the_scene_is_that_of_every_result(scene, how):
    path, settings = how
    for group in run(scene, CAMERA, settings, path, background=BACKGROUND):
        assert all(a.dtype == np.float32 for a in group.values())
    wide = as_dtype(scene, np.float64)
    for group in run(wide, CAMERA, settings, path, background=BACKGROUND):
        assert all(a.dtype == np.float64 for a in group.values())


@given(st.floats(0.3, 1e4), st.floats(0.3, 1e4), st.floats(-1, 1), st.floats(-5, 60), st.floats(-5, 60))
@example(0.999999, 0.3, 0.0, 30.4999, 20.5)  # 0.13 of the opacity is cut
def test_the_tiles_of_three_sigma_cut_less_than_an_e_squared_th(a, c, correlation, u, v):
    """Specification B5: towards larger indices the tiles can end a pixel inside the radius, which is at least 3."""
    b = 0.999 * correlation * np.sqrt((a - 0.3) * (c - 0.3))  # the low-pass is included in a and c
    one = [np.array([x]) for x in ((u, v), (a, b, c), a * c - b * b, 1.0, True)]
    box, _ = screen_boxes(Projected(one[0].T, one[1].T, *one[2:]), np.zeros(1), LEGACY, 64, 64)
    dy, dx = np.mgrid[:64, :64] + 0.5 - np.array([v, u])[:, None, None]
    value = np.exp(-(c * dx**2 - 2 * b * dx * dy + a * dy**2) / (a * c - b * b) / 2)
    value[box[0, 2] : box[0, 3] + 1, box[0, 0] : box[0, 1] + 1] = 0
    assert value.max() < np.exp(-2)
