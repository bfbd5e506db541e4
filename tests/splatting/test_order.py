"""Depth order and tile lists: hard cases S1-S4."""

import numpy as np
import pytest
from made_up_scenes import U64, assert_bitwise, assert_close, plain_camera, random_scene, run, screen_scene, select

from endotsr.splatting.binning import depth_order, tile_lists
from endotsr.splatting.settings import EXACT, PAPER

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


@pytest.mark.parametrize("path, settings", [("definition", EXACT), ("rows", PAPER)])
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


@pytest.mark.parametrize("path", ["definition", "rows"])
def test_hard_S1_equal_depths_are_blended_in_index_order(path):
    rgb = np.array([[0.9, 0.1, 0.4], [0.2, 0.8, 0.3], [0.5, 0.4, 0.7]])
    scene = screen_scene(CAMERA, 16.5, 14.5, 3.0, 5.0, [0.3, 0.6, 0.8], rgb)
    a = np.array([0.3, 0.6, 0.8])
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        images, _ = run(select(scene, order), CAMERA, PAPER, path, background=BACKGROUND)
        front = np.concatenate([[1.0], np.cumprod(1 - a[order])])
        wanted = (rgb[:, order] * a[order] * front[:3]).sum(axis=1) + front[3] * BACKGROUND
        np.testing.assert_allclose(images["colour"][:, 14, 16], wanted, rtol=1e-12)


def test_hard_S1_repeated_runs_are_identical():
    scene = random_scene(1, 200, CAMERA)
    scene.position[2] = np.round(np.abs(scene.position[2]))
    first = run(scene, CAMERA, PAPER)
    for _ in range(3):
        for one, two in zip(run(scene, CAMERA, PAPER), first):
            assert_bitwise(one, two)


def test_hard_S2_depths_one_rounding_apart_are_told_apart():
    far = 100.0
    z = np.array([np.nextafter(far, 200), far, np.nextafter(far, 0)])
    np.testing.assert_array_equal(depth_order(z, np.ones(3, bool)), [2, 1, 0])


@pytest.mark.parametrize("path", ["definition", "rows"])
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


def test_order_of_the_tiles_does_not_matter_for_gradients():
    """A splat over many tiles collects the same sum as in one image row at a time (to rounding)."""
    camera = plain_camera(129, 5, 25.0)
    scene = screen_scene(camera, 64.0, 2.5, 3.0, 60.0, 0.7, [0.9, 0.2, 0.5])
    one, two = run(scene, camera, PAPER, "rows")[1], run(scene, camera, PAPER, "definition")[1]
    assert_close(one, two, 64 * U64)
