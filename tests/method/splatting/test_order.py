"""Depth order, boxes and tile lists: hard cases C7 and S1-S4."""

import numpy as np
import pytest
from made_up_scenes import (
    U64,
    as_dtype,
    assert_bitwise,
    assert_close,
    plain_camera,
    random_scene,
    run,
    screen_scene,
    select,
)

from endotsr.method.kernels.exponential import LOG2_E
from endotsr.method.splatting.binning import depth_order, screen_boxes, tile_lists
from endotsr.method.splatting.covariance import covariance_forward
from endotsr.method.splatting.projection import Projected, projection_forward
from endotsr.method.splatting.records import INVERSE_C, LOG2_OPACITY, PRECISION, log_opacity, pack_records
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER

CAMERA = plain_camera(33, 29, 25.0)
BACKGROUND = np.array([0.3, 0.6, 0.1])


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("count", [0, 1, 2, 5000])
def test_hard_S1_stable_sort_by_depth_then_index(dtype, count):
    rng = np.random.default_rng(count)
    for depth in (rng.uniform(1e-3, 1e3, count), rng.integers(1, 9, count), 10.0 ** rng.uniform(-37, 37, count)):
        depth = depth.astype(dtype)
        visible = rng.random(count) < 0.8
        wanted = np.flatnonzero(visible)[np.argsort(depth[visible], kind="stable")]
        np.testing.assert_array_equal(depth_order(depth, visible), wanted)


@pytest.mark.parametrize("path, settings", [("definition", EXACT), ("blocks", PAPER)])
def test_hard_S1_permuting_the_input_changes_no_bit_for_distinct_depths(path, settings):
    scene = random_scene(0, 80, CAMERA)
    scene.position[2] = np.abs(scene.position[2])
    images, gradients = run(scene, CAMERA, settings, path, background=BACKGROUND)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(80)
        other, back = run(select(scene, order), CAMERA, settings, path, background=BACKGROUND)
        assert_bitwise(other, images)
        for name in ("position", "quaternion", "log_scale", "opacity_logit", "harmonics", "residual", "mean2d"):
            np.testing.assert_array_equal(back[name], gradients[name][..., order], err_msg=name)


@pytest.mark.parametrize("path", ["definition", "blocks"])
def test_hard_S1_equal_depths_are_blended_in_index_order(path):
    rgb = np.array([[0.9, 0.1, 0.4], [0.2, 0.8, 0.3], [0.5, 0.4, 0.7]])
    scene = screen_scene(CAMERA, 16.5, 14.5, 3.0, 5.0, [0.3, 0.6, 0.8], rgb)
    a = np.array([0.3, 0.6, 0.8])
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        images, _ = run(select(scene, order), CAMERA, PAPER, path, background=BACKGROUND)
        front = np.concatenate([[1.0], np.cumprod(1 - a[order])])
        wanted = (rgb[:, order] * a[order] * front[:3]).sum(axis=1) + front[3] * BACKGROUND
        np.testing.assert_allclose(images["colour"][:, 14, 16], wanted, rtol=1e-12)


def test_hard_S2_depths_one_rounding_apart_are_told_apart():
    far = 100.0
    z = np.array([np.nextafter(far, 200), far, np.nextafter(far, 0)])
    np.testing.assert_array_equal(depth_order(z, np.ones(3, bool)), [2, 1, 0])


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_S2_view_depth_keeps_every_value_that_ndc_depth_loses(dtype):
    """200 001 depths in [20, 100]: the order follows view z; NDC depth in float32 (planes 0.01, 100) keeps 3 %."""
    z = np.linspace(20, 100, 200_001).astype(dtype)
    near, far = np.float32(0.01), np.float32(100)
    ndc = (far * (z.astype(np.float32) - near)) / (z.astype(np.float32) * (far - near))
    assert np.unique(ndc).size < 0.04 * z.size and np.unique(z).size == z.size
    shuffle = np.random.default_rng(4).permutation(z.size)
    found = depth_order(z[shuffle], np.ones(z.size, bool))
    np.testing.assert_array_equal(shuffle[found], np.arange(z.size))


@pytest.mark.parametrize("path", ["definition", "blocks"])
def test_hard_S3_the_image_jumps_where_two_depths_cross(path):
    """By alpha1 alpha2 T (c1 - c2), T in front of both."""
    c = np.array([[0.1, 0.9, 0.1], [0.1, 0.2, 0.8], [0.1, 0.5, 0.4]])
    images = []
    for sign in (-1, 1):
        scene = screen_scene(CAMERA, 16.5, 14.5, [2.0, 5.0 + sign * 1e-9, 5.0], 4.0, [0.5, 0.3, 0.6], c)
        images.append(run(scene, CAMERA, PAPER, path, background=BACKGROUND)[0]["colour"][:, 14, 16])
    np.testing.assert_allclose(images[0] - images[1], 0.3 * 0.6 * 0.5 * (c[:, 1] - c[:, 2]), atol=1e-9)


def test_hard_S4_what_is_not_visible_never_reaches_the_sort():
    depth = np.array([3.0, np.nan, 1.0, 0.0, -5.0, np.inf, 2.0])
    visible = np.array([True, False, True, False, False, False, True])
    np.testing.assert_array_equal(depth_order(depth, visible), [2, 6, 0])


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_C7_largest_eigenvalue_of_round_and_long_splats(dtype):
    """lambda = h + sqrt(max(0.1, h^2 - det)): round splats make the root's argument 0 or, rounded, negative.

    The 3 sigma tiles equal those of lambda = h + hypot((a - c) / 2, b) in float64; in float32 the radius may differ by
    one part in 1e3 (the square root of a rounding), so by one tile at the border.
    """
    camera = plain_camera(4000, 3000, 500.0)
    rng = np.random.default_rng(5)
    sigma = np.concatenate([np.geomspace(0.01, 1e4, 300), np.geomspace(1, 300, 300)])
    scene = screen_scene(camera, rng.uniform(0, 4000, 600), rng.uniform(0, 3000, 600), 4.0, sigma, 0.5, [1, 1, 1])
    scene.log_scale[0, 300:] += np.log(20.0)
    scene.quaternion[:, 300:] = rng.normal(0, 1, (4, 300))
    scene = as_dtype(scene, dtype)
    shape, _ = covariance_forward(scene.quaternion, scene.log_scale)
    projected, _ = projection_forward(scene.position, shape, camera, LEGACY)
    box, seen = screen_boxes(projected, log_opacity(scene.opacity_logit), LEGACY, 4000, 3000)
    assert seen.all()  # a NaN radius reaches nothing
    a, b, c = projected.covariance2d.astype(np.float64)
    spread = np.maximum(np.hypot((a - c) / 2, b), np.sqrt(0.1))
    radius = np.ceil(3 * np.sqrt((a + c) / 2 + spread))
    for axis, pixels in enumerate((4000, 3000)):
        middle = projected.mean2d[axis].astype(np.float64) - 0.5
        first = 16 * np.clip(np.trunc((middle - radius) / 16), 0, None)
        last = np.minimum(16 * np.trunc((middle + radius + 15) / 16) - 1, pixels - 1)
        bound = 0 if dtype is np.float64 else 16 * np.ceil(1e-3 * radius / 16)
        assert (np.abs(box[:, 2 * axis] - first) <= bound).all()
        assert (np.abs(box[:, 2 * axis + 1] - last) <= bound).all()


def test_the_radius_of_a_small_round_splat_has_the_floor_of_the_published_rule():
    """3 sqrt(h + sqrt(0.1)) with h = 0.75 is 3.1, so 4 pixels: one tile more to the left than 3 would reach."""
    one = np.ones(1)
    covariance = np.array([[0.75], [0.0], [0.75]])
    projected = Projected(np.array([[20.0], [20.0]]), covariance, 0.75**2 * one, one, np.ones(1, bool))
    box, _ = screen_boxes(projected, np.log(0.5 * one), LEGACY, 64, 64)
    assert box.tolist() == [[0, 31, 0, 31]]


def test_tile_lists_hold_every_pair_once_in_depth_order():
    rng = np.random.default_rng(2)
    n, width, height = 300, 65, 47
    x, y = np.sort(rng.integers(0, width, (2, n)), axis=0), np.sort(rng.integers(0, height, (2, n)), axis=0)
    box = np.stack([x[0], x[1], y[0], y[1]], axis=1).astype(np.int32)
    order = rng.permutation(n)[:250].astype(np.int32)
    lists = tile_lists(box, order, 32, 16, width, height)
    tiles_x, tiles_y = 3, 3
    assert lists.starts.size == tiles_x * tiles_y + 1 and lists.starts[-1] == lists.ranks.size == lists.slots.size
    for t in range(tiles_x * tiles_y):
        left, top = 32 * (t % tiles_x), 16 * (t // tiles_x)
        wanted = [
            k for k, i in enumerate(order)
            if box[i, 0] < left + 32 and box[i, 1] >= left and box[i, 2] < top + 16 and box[i, 3] >= top
        ]  # fmt: skip
        np.testing.assert_array_equal(lists.ranks[lists.starts[t] : lists.starts[t + 1]], wanted)
    for k in range(order.size):
        slots = lists.slots[lists.pair_starts[k] : lists.pair_starts[k + 1]]
        assert (lists.ranks[slots] == k).all() and (np.diff(slots) > 0).all()
    np.testing.assert_array_equal(np.sort(lists.slots), np.arange(lists.slots.size))
    assert lists.starts[0] == lists.pair_starts[0] == 0 and lists.pair_starts[-1] == lists.slots.size


def test_boxes_are_no_wider_than_the_ellipse_and_a_rounding():
    """A box that is too wide changes no picture; it only takes time."""
    camera = plain_camera(200, 150, 80.0)
    scene = random_scene(9, 400, camera)
    shape, _ = covariance_forward(scene.quaternion, scene.log_scale)
    projected, _ = projection_forward(scene.position, shape, camera, PAPER)
    opacity = log_opacity(scene.opacity_logit)
    box, seen = screen_boxes(projected, opacity, PAPER, 200, 150)
    reach = np.sqrt(np.maximum(2 * (opacity - np.log(PAPER.alpha_cutoff)), 0) * projected.covariance2d[[0, 2]])
    for axis, pixels in enumerate((200, 150)):
        middle = projected.mean2d[axis, seen] - 0.5
        first = np.clip(np.ceil(middle - reach[axis, seen]), 0, None)
        last = np.clip(np.floor(middle + reach[axis, seen]), None, pixels - 1)
        wide, narrow = first - box[seen, 2 * axis], box[seen, 2 * axis + 1] - last
        assert ((wide == 0) | (wide == 1)).all() and ((narrow == 0) | (narrow == 1)).all()
        assert (wide == 0).mean() > 0.95 and (narrow == 0).mean() > 0.95


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_pixel_on_the_very_edge_of_a_footprint_is_in_its_box(axis, side):
    """Round footprints, near and far, whose edge goes through a pixel's centre.

    With this cutoff the roundings of its two logarithms, one of the box and one of the pixels, draw apart: without a
    margin many boxes would be too small.
    """
    rng, f32, n, settings = np.random.default_rng(8), np.float32, 2000, PAPER._replace(alpha_cutoff=3e-4)
    log_cutoff, pixel = np.log(settings.alpha_cutoff), rng.integers(10, 90, n)
    mean, one = np.full((2, n), 50.5, f32), np.ones(n, f32)
    mean[axis] = pixel + 0.5 - side * 10 ** rng.uniform(-0.3, 6, n)
    e = (pixel + 0.5).astype(f32) - mean[axis]
    log_alpha = (log_cutoff + rng.uniform(0.01, 1, n)).astype(f32)
    variance = (e.astype(float) ** 2 / (2 * (log_alpha - log_cutoff))).astype(f32)
    projected = Projected(mean, np.stack([variance, 0 * one, variance]), variance * variance, one, one > 0)
    box, seen = screen_boxes(projected, log_alpha, settings, 100, 100)
    records = pack_records(np.arange(n, dtype=np.int32), projected, log_alpha, np.zeros((3, n), f32))
    steepness = f32(0.5 * LOG2_E) * records[:, (PRECISION, INVERSE_C)[axis]]
    reached = records[:, LOG2_OPACITY] - steepness * e * e >= f32(np.log2(settings.alpha_cutoff))
    assert reached.sum() > 1000
    assert (seen & (box[:, 2 * axis] <= pixel) & (pixel <= box[:, 2 * axis + 1]))[reached].all()


@pytest.mark.parametrize("support", ["everywhere", "ellipse"])
def test_without_a_cutoff_every_box_is_the_picture(support):
    """An ellipse has no end then. The Gaussian behind the camera, between the two others, has no box."""
    scene = screen_scene(CAMERA, [-500.0, 0.0, 16.0], 14.5, 3.0, 0.1, [1e-6, 0.5, 0.9], [1, 1, 1])
    scene.position[2, 1] *= -1
    shape, _ = covariance_forward(scene.quaternion, scene.log_scale)
    projected, _ = projection_forward(scene.position, shape, CAMERA, EXACT)
    settings = PAPER._replace(alpha_cutoff=0.0, support=support)
    box, seen = screen_boxes(projected, log_opacity(scene.opacity_logit), settings, 33, 29)
    assert seen.tolist() == [True, False, True] and (box[seen] == [0, 32, 0, 28]).all()


def test_order_of_the_tiles_does_not_matter_for_gradients():
    """A splat over many tiles collects the same sum as in one image row at a time (to rounding)."""
    camera = plain_camera(129, 5, 25.0)
    scene = screen_scene(camera, 64.0, 2.5, 3.0, 60.0, 0.7, [0.9, 0.2, 0.5])
    one, two = run(scene, camera, PAPER, "blocks")[1], run(scene, camera, PAPER, "definition")[1]
    assert_close(one, two, 64 * U64)
