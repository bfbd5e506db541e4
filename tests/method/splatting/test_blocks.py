"""The fast path against the definition: images and every gradient, random scenes and hard ones, float64 and float32.

Float64: 1e-12 of the largest entry, 1e-11 where alphas at the clamp of .99 are stacked (the fast path divides by
1 - alpha >= 0.01, see `test_stacks_cost_at_most_a_hundred_roundings`). Float32: 1e-4 in relative L2.
"""

import functools

import numpy as np
import pytest
from made_up_scenes import (
    U64,
    as_dtype,
    assert_bitwise,
    assert_close,
    assert_close_l2,
    assert_finite,
    plain_camera,
    random_scene,
    run,
    screen_scene,
    select,
    turned_camera,
)

from endotsr.method.kernels.exponential import LOG2_E
from endotsr.method.kernels.vectors import lanes
from endotsr.method.splatting import compositing
from endotsr.method.splatting.binning import depth_order, screen_boxes, tile_lists
from endotsr.method.splatting.camera import Camera, camera_centre
from endotsr.method.splatting.covariance import covariance_forward
from endotsr.method.splatting.fast import blocks as compositing_blocks
from endotsr.method.splatting.fast import tiles as compositing_tiles
from endotsr.method.splatting.fast.tiles import BLOCKS_ACROSS, TILE_HEIGHT, TILE_WIDTH, place
from endotsr.method.splatting.harmonics import harmonics_forward
from endotsr.method.splatting.projection import projection_forward
from endotsr.method.splatting.records import (
    DEPTH,
    INVERSE_C,
    LOG2_OPACITY,
    OPACITY,
    PRECISION,
    RECORD,
    RED,
    SLOPE,
    SUM_RED,
    SUM_S,
    U,
    V,
    log_opacity,
    pack_records,
)
from endotsr.method.splatting.render import Scene, choose_compositor, render_forward
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER

BACKGROUND = np.array([0.9, 0.1, 0.4])
PATHS = {
    "definition": (compositing, compositing.composite_forward, compositing.composite_reverse),
    "blocks": (
        compositing_blocks,
        compositing_blocks.composite_blocks_forward,
        compositing_blocks.composite_blocks_reverse,
    ),
}
CAMERA = plain_camera()


def rgb_for(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.05, 1.0, (3, count))


def random_65x47() -> tuple[Scene, Camera]:
    camera = turned_camera()
    return random_scene(1, 200, camera), camera


def small_ones() -> tuple[Scene, Camera]:
    """Nothing but the low-pass: footprints of two pixels."""
    camera = turned_camera()
    return random_scene(2, 400, camera, size=(1e-6, 0.3)), camera


def needles() -> tuple[Scene, Camera]:
    """Up to 3000 px long and thinner than a pixel, at all angles."""
    scene = random_scene(3, 60, CAMERA)
    rng = np.random.default_rng(4)
    z = np.abs(scene.position[2])
    scene.position[2] = z
    axes = np.stack([10 ** rng.uniform(1, 3.5, 60), 10 ** rng.uniform(-3, 0, 60), 10 ** rng.uniform(-3, 0, 60)])
    return scene._replace(log_scale=np.log(axes * z / CAMERA.fx)), CAMERA


def huge() -> tuple[Scene, Camera]:
    """Covariances up to 1e12 px^2, centres inside and far outside the image."""
    rng = np.random.default_rng(5)
    u, v = rng.uniform(-2000, 2000, 30), rng.uniform(-2000, 2000, 30)
    return screen_scene(
        CAMERA, u, v, rng.uniform(2, 9, 30), 10 ** rng.uniform(2, 6, 30), rng.uniform(0.02, 0.9, 30), rgb_for(6, 30)
    ), CAMERA


def opaque() -> tuple[Scene, Camera]:
    """Opacities beyond the alpha clamp, from 0.98 to 1 exactly."""
    scene = random_scene(7, 150, CAMERA, size=(2.0, 10.0))
    scene.opacity_logit[:] = np.random.default_rng(8).uniform(4, 40, 150)
    return scene, CAMERA


def stacked() -> tuple[Scene, Camera]:
    """2000 on one spot, alpha just above the cutoff: every pixel near it meets the stop."""
    z = 3.0 + np.random.default_rng(9).permutation(2000) * 1e-3
    return screen_scene(CAMERA, 30.2, 20.7, z, 8.0, 0.01, rgb_for(10, 2000)), CAMERA


def equal_depths() -> tuple[Scene, Camera]:
    scene = random_scene(11, 200, CAMERA)
    scene.position[2] = 5.0
    return scene, CAMERA


def on_borders() -> tuple[Scene, Camera]:
    """Centres on the borders of tiles and of the image, on pixel centres and just outside."""
    u, v = np.meshgrid([0.0, 0.5, 15.5, 16.0, 31.5, 32.0, 48.0, 64.5, 65.0, 70.0], [-3.0, 0.0, 15.5, 16, 32, 46.5, 47])
    n = u.size
    sigma = np.random.default_rng(12).uniform(0.1, 6, n)
    z = 3 + np.random.default_rng(13).permutation(n) * 0.1
    return screen_scene(CAMERA, u.ravel(), v.ravel(), z, sigma, 0.8, rgb_for(14, n)), CAMERA


def outside() -> tuple[Scene, Camera]:
    """Nothing reaches a pixel."""
    scene = random_scene(15, 20, CAMERA)
    scene.position[0] = 1e4
    return scene, CAMERA


def none_at_all() -> tuple[Scene, Camera]:
    return select(random_scene(16, 5, CAMERA), []), CAMERA


def only_one() -> tuple[Scene, Camera]:
    return screen_scene(CAMERA, 20.3, 30.1, 4.0, 5.0, 0.7, [0.2, 0.5, 0.8]), CAMERA


def one_pixel() -> tuple[Scene, Camera]:
    camera = plain_camera(1, 1)
    return random_scene(17, 40, camera, size=(0.5, 3.0)), camera


def extreme_logits() -> tuple[Scene, Camera]:
    scene = random_scene(18, 60, CAMERA)
    scene.opacity_logit[:] = np.resize([800.0, -800.0, 40.0, -40.0, 0.0, 1.0], 60)
    return scene, CAMERA


def tall_and_narrow() -> tuple[Scene, Camera]:
    camera = turned_camera(3, 101)
    return random_scene(19, 80, camera), camera


SCENES = {
    f.__name__: f
    for f in (
        random_65x47, small_ones, needles, huge, opaque, stacked, equal_depths, on_borders, outside, none_at_all,
        only_one, one_pixel, extreme_logits, tall_and_narrow,
    )
}  # fmt: skip


BOUNDS = {
    "opaque": 1e-11,
    "stacked": 1e-11,
}


def both(scene: Scene, camera: Camera, settings=PAPER):
    """Images and gradients in one dictionary, of the definition and of the fast path."""
    background = BACKGROUND.astype(scene.position.dtype)
    results = []
    for path in ("definition", "blocks"):
        images, gradients = run(scene, camera, settings, path, background=background)
        assert_finite(images, gradients)
        results.append({f"image {k}": a for k, a in images.items()} | gradients)
    return results


@pytest.mark.parametrize("name", list(SCENES))
def test_fast_path_equals_definition_float64(name):
    definition, fast = both(*SCENES[name]())
    assert_close(fast, definition, BOUNDS.get(name, 1e-12))


@pytest.mark.parametrize("name", list(SCENES))
def test_fast_path_equals_definition_float32(name):
    scene, camera = SCENES[name]()
    definition, fast = both(as_dtype(scene, np.float32), camera)
    assert all(a.dtype == np.float32 for a in fast.values())
    assert_close_l2(fast, definition, 1e-4)


@pytest.mark.parametrize("path", ["definition", "blocks"])
def test_needles_keep_their_digits_in_float32(path):
    """Gradients of 3000 px needles, float32 against float64 at the same inputs: relative L2 <= 1e-4.

    Formed through (a, b, c), that by the length would be off by 5 to 10 %.
    """
    scene, camera = needles()
    small = as_dtype(scene, np.float32)
    large = as_dtype(small, np.float64)
    images, _ = run(large, camera, PAPER, path)
    rng = np.random.default_rng(21)
    given = [rng.normal(0, 1, images[name].shape).astype(np.float32) for name in ("colour", "depth", "opacity")]
    found = run(small, camera, PAPER, path, given=given)[1]
    wanted = run(large, camera, PAPER, path, given=[g.astype(np.float64) for g in given])[1]
    for name in ("position", "quaternion", "log_scale", "opacity_logit", "mean2d"):
        error = np.linalg.norm(found[name] - wanted[name])
        assert error <= 1e-4 * np.linalg.norm(wanted[name]), (name, error)


@pytest.mark.parametrize(
    "settings",
    [
        PAPER._replace(alpha_cutoff=1e-9),
        PAPER._replace(alpha_cutoff=0.3, transmittance_stop=0.05),
        PAPER._replace(transmittance_stop=0.0, alpha_max=0.999),
        PAPER._replace(low_pass=0.01, jacobian_clamp=0.0, alpha_max=0.5),
    ],
    ids=["fine cutoff", "coarse cutoff and stop", "no stop", "sharp"],
)
def test_fast_path_equals_definition_for_other_dials(settings):
    definition, fast = both(*random_65x47(), settings)
    assert_close(fast, definition, 1e-10 if settings.alpha_max > 0.99 else 1e-11)


def test_stacks_cost_at_most_a_hundred_roundings():
    """|fast - definition| <= 100 u n of the largest gradient when n opaque ones stand one behind the other."""
    n = 6
    scene = screen_scene(CAMERA, 30.2, 20.7, 3.0 + np.arange(n), 6.0, 0.985, rgb_for(20, n))
    definition, fast = both(scene, CAMERA, PAPER._replace(transmittance_stop=0.0))
    assert_close(fast, definition, 100 * n * U64)


def test_auto_takes_the_fast_path_exactly_where_it_computes_the_settings():
    assert choose_compositor(PAPER, "auto") == "blocks"
    others = (EXACT, LEGACY, PAPER._replace(alpha_cutoff=0.0), PAPER._replace(alpha_max=1.0))
    for settings in (*others, PAPER._replace(support="everywhere")):
        assert choose_compositor(settings, "auto") == "definition"
        with pytest.raises(ValueError, match="definition"):
            choose_compositor(settings, "blocks")
    assert choose_compositor(PAPER, "definition") == "definition"


KEPT = {
    "auto": compositing_blocks.BlocksSaved,
    "blocks": compositing_blocks.BlocksSaved,
    "definition": compositing.CompositeSaved,
}


@pytest.mark.parametrize("compositor, kind", KEPT.items(), ids=list(KEPT))
def test_the_render_is_made_by_the_chosen_compositor(compositor, kind):
    """Both give the same image up to rounding, so only what they keep tells them apart."""
    scene = screen_scene(CAMERA, 30.2, 20.7, 3.0, 6.0, 0.5, rgb_for(1, 1))
    _, saved = render_forward(scene, CAMERA, PAPER, degree=0, compositor=compositor)
    assert type(saved.composite) is kind


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", ["random_65x47", "needles", "huge", "on_borders"])
def test_hard_C8_lossless_box_fast_path(name, dtype):
    """Boxes of the whole image in place of the tight ones: the same image, bit by bit."""
    scene, camera = SCENES[name]()
    scene = as_dtype(scene, dtype)
    shape, _ = covariance_forward(scene.quaternion, scene.log_scale)
    projected, _ = projection_forward(scene.position, shape, camera, PAPER)
    degree = int(np.sqrt(scene.harmonics.shape[0])) - 1
    rgb, _ = harmonics_forward(scene.harmonics, scene.residual, scene.position, camera_centre(camera), degree)
    log_alpha = log_opacity(scene.opacity_logit)
    box, visible = screen_boxes(projected, log_alpha, PAPER, camera.width, camera.height)
    results = []
    for tight in (True, False):
        if not tight:
            visible = projected.visible
            box = np.tile(np.array([0, camera.width - 1, 0, camera.height - 1], np.int32), (visible.size, 1))
        order = depth_order(projected.depth, visible)
        records = pack_records(order, projected, log_alpha, rgb)
        lists = tile_lists(box, order, TILE_WIDTH, TILE_HEIGHT, camera.width, camera.height)
        out, _ = compositing_blocks.composite_blocks_forward(
            records, lists, PAPER, BACKGROUND.astype(dtype), camera.width, camera.height
        )
        results.append(out._asdict())
    assert_bitwise(*results)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", [name for name in SCENES if name != "stacked"])
def test_hard_C8_lossless_box_definition(name, dtype):
    """Ellipse boxes against no boxes at all, same cutoff: images and gradients equal bit by bit."""
    scene, camera = SCENES[name]()
    scene = as_dtype(scene, dtype)
    boxed = run(scene, camera, PAPER, "definition", background=BACKGROUND)
    free = run(scene, camera, PAPER._replace(support="everywhere"), "definition", background=BACKGROUND)
    for one, two in zip(boxed, free):
        assert_bitwise(one, two)


@pytest.mark.parametrize("width, height", [(64, 32), (32, 16), (96, 16)])
def test_a_picture_of_whole_tiles_has_no_tile_beside_it(width, height):
    camera = plain_camera(width, height, 40.0)
    u, v = np.linspace(3, width - 3, 5), np.linspace(2, height - 2, 5)
    scene = screen_scene(camera, u, v, np.arange(2.0, 7.0), 2.5, 0.7, rgb_for(5, 5))
    fast, slow = run(scene, camera, PAPER, "blocks"), run(scene, camera, PAPER, "definition")
    assert_close(fast[0], slow[0], 1e-12)
    assert_close(fast[1], slow[1], 1e-12)


@functools.cache
def places(dtype):
    """Where each pixel of a tile stands in a plane, (TILE_HEIGHT, TILE_WIDTH)."""
    like = np.empty(0, dtype)
    return np.array([[int(place(like, y, x)) for x in range(TILE_WIDTH)] for y in range(TILE_HEIGHT)])


def visited_and_lanes(record, top, left, log2_cutoff):
    """Of every pixel of a tile: whether it is visited, and e, log2 alpha on the centre line and dy of its lane."""
    count = lanes(record)
    visited = np.zeros(TILE_WIDTH * TILE_HEIGHT, bool)
    values = np.zeros((3, visited.size), record.dtype)
    tables = np.empty(compositing_blocks.TABLES, record.dtype)
    words = compositing_blocks._visits_kernel(record, top, left, log2_cutoff, np.empty(TILE_HEIGHT, np.int32))
    first_columns = (TILE_WIDTH // BLOCKS_ACROSS * np.arange(BLOCKS_ACROSS)).astype(record.dtype)
    for word in range(visited.size // (64 * count)):
        compositing_blocks._lane_tables_kernel(record, top, left, word, tables)
        for bit in range(64):
            base, row, across = compositing_blocks._visit_kernel(first_columns, word, np.uint64(bit))
            pixels = slice(int(base), int(base) + count)
            visited[pixels] = int(words[word]) >> bit & 1
            for k, part in enumerate((compositing_blocks.E, compositing_blocks.CENTRE_LINE, compositing_blocks.DY)):
                values[k, pixels] = tables[int(row) + part : int(row) + part + count]
            values[0, pixels] += across
    index = places(record.dtype)
    return visited[index], *values[:, index]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_pixel_of_a_tile_has_a_lane_of_its_own(dtype):
    """A footprint over the whole tile visits every block once, and each lane has e and dy of its own pixel."""
    record, (left, top) = np.zeros(RECORD, dtype), (128, 48)
    record[[U, V, SLOPE, LOG2_OPACITY]] = 150.25, 51.75, 0.75, -0.5
    record[[PRECISION, INVERSE_C]] = 1e-5, 2e-5
    assert np.array_equal(np.sort(places(record.dtype).ravel()), np.arange(TILE_WIDTH * TILE_HEIGHT))
    visited, e, centre_line, dy = visited_and_lanes(record, top, left, dtype(np.log2(1 / 255)))
    assert visited.all()
    x, y = left + np.arange(TILE_WIDTH) + 0.5, top + np.arange(TILE_HEIGHT)[:, None] + 0.5
    wanted = np.broadcast_to(y - 51.75, dy.shape)
    np.testing.assert_array_equal(dy, wanted)
    np.testing.assert_array_equal(e, x - 150.25 - 0.75 * wanted)
    tolerance = 4 * np.finfo(dtype).eps
    np.testing.assert_allclose(centre_line, -0.5 - 0.5 * LOG2_E * 2e-5 * wanted**2, rtol=tolerance)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("v", [-9.0, 2.3, 7.9, 31.0])
def test_only_blocks_that_the_ellipse_touches_are_visited(v, dtype):
    """Each visited block has a row that the ellipse reaches and, in it, one of the columns; no other block has one."""
    record, log2_cutoff = np.zeros(RECORD, dtype), dtype(np.log2(1 / 255))
    record[[U, V, SLOPE, LOG2_OPACITY]] = 30.7, v, -1.5, -0.25
    record[[PRECISION, INVERSE_C]] = 0.3, 0.05
    visited = visited_and_lanes(record, 0, 0, log2_cutoff)[0]
    x, dy = np.arange(TILE_WIDTH) + 0.5, (np.arange(TILE_HEIGHT) + 0.5 - v)[:, None]
    reach = (-0.25 - log2_cutoff) / (0.5 * LOG2_E) - 0.05 * dy * dy
    half_width = np.sqrt(np.maximum(reach, 0) / 0.3)
    touched = (reach >= 0) & (np.abs(x - 30.7 + 1.5 * dy) <= half_width + np.array([-0.01, 0.01])[:, None, None])
    rows = lanes(record) // 4
    blocks = touched.reshape(2, TILE_HEIGHT // rows, rows, TILE_WIDTH // 4, 4).any(axis=(2, 4))
    found = visited.reshape(TILE_HEIGHT // rows, rows, TILE_WIDTH // 4, 4)
    assert np.array_equal(found.any(axis=(1, 3)), found.all(axis=(1, 3)))
    seen = found.any(axis=(1, 3))
    assert not (blocks[0] & ~seen).any() and not (seen & ~blocks[1]).any()
    assert seen.any() == (v != 31.0)


@pytest.mark.parametrize("distance", [0.0, 1e2, 1e3, 1e4, 3e4, 1e5, 1e6])
def test_blocks_miss_no_pixel_of_a_far_away_edge_in_float32(distance):
    """Where the centre is far off, rounding of the edge is many times a pixel's margin, unless that grows with it."""
    rng, f32 = np.random.default_rng(int(distance)), np.float32
    log2_cutoff, (left, top) = f32(np.log2(1 / 255)), (320, 160)
    passing = 0
    for _ in range(400):
        angle = rng.choice([0, np.pi / 2, np.pi, -np.pi / 2]) + rng.normal(0, 1e-6)  # edges along rows and columns
        aim = np.array([left + 16, top + 8]) + rng.uniform(-8, 8, 2)
        centre = aim - distance * np.array([np.cos(angle), np.sin(angle)])
        log2_opacity = f32(rng.uniform(-4, 0))
        # a round footprint whose edge goes through `aim`, or one of about three pixels around it
        sigma = max(distance, 3.0) / np.sqrt(2 * np.log(2) * (log2_opacity - log2_cutoff))
        record = np.zeros(RECORD, f32)
        record[SLOPE] = slope = rng.choice([0.0, 0.7, -5.0])  # sheared, the same edge still goes through `aim`
        record[U], record[V] = centre[0] - slope * (aim[1] - centre[1]), centre[1]
        record[PRECISION] = record[INVERSE_C] = sigma**-2
        record[LOG2_OPACITY] = log2_opacity
        visited, e, centre_line, dy = visited_and_lanes(record, top, left, log2_cutoff)
        a2 = f32(0.5) * f32(LOG2_E) * record[PRECISION]
        reached = centre_line - a2 * e * e >= log2_cutoff
        passing += int(reached.sum())
        assert not (reached & ~visited).any()
        if distance <= 100:
            wanted = left + np.arange(TILE_WIDTH) + 0.5 - record[U] - record[SLOPE] * dy
            np.testing.assert_allclose(e, wanted, atol=1e-4)
    assert passing > 1000


@pytest.mark.parametrize("cutoff", [1 / 255, 3e-4])  # of the second, the natural and the binary logarithm draw apart
@pytest.mark.parametrize("side", [-1, 1])
def test_a_pixel_on_the_very_edge_of_a_footprint_is_visited(side, cutoff):
    """Round footprints whose edge goes through the centre of a pixel of their own row, and of their own column."""
    rng, f32 = np.random.default_rng(7), np.float32
    log2_cutoff, reached = f32(np.log2(cutoff)), 0
    for _ in range(300):
        distance, log_alpha = 10 ** rng.uniform(-0.3, 6), f32(np.log(cutoff) + rng.uniform(0.01, 4))
        column, row = int(rng.integers(10, 22)), int(rng.integers(3, 13))
        u, v = f32(column + 0.5 - side * distance), f32(row + 0.5 - side * distance)
        for e, dy in ((f32(column + 0.5) - u, f32(0)), (f32(0), f32(row + 0.5) - v)):
            reach = log_alpha - f32(np.log(cutoff))
            variance = f32((e.astype(float) ** 2 + dy.astype(float) ** 2) / (2 * reach))
            record = np.zeros(RECORD, f32)
            record[U], record[V] = (u, f32(row + 0.5)) if e else (f32(column + 0.5), v)
            record[PRECISION] = record[INVERSE_C] = f32(1) / variance
            record[LOG2_OPACITY] = log_alpha * f32(LOG2_E)
            visited, _, centre_line, _ = visited_and_lanes(record, 0, 0, log2_cutoff)
            if centre_line[row, column] - f32(0.5) * f32(LOG2_E) * record[PRECISION] * e * e >= log2_cutoff:
                reached += 1
                assert visited[row, column]
    assert reached > 200


AT_THE_EDGE = {
    "cutoff": ({"alpha_cutoff": 0.25}, 0.25),  # alpha = cutoff is drawn
    "stop": ({"alpha_cutoff": 0.01, "transmittance_stop": 0.5}, 0.5),  # T - alpha T = stop is not beyond the stop
    "clamp": ({"alpha_cutoff": 0.01, "alpha_max": 0.5}, 0.5),  # alpha = alpha_max is not clamped: the gradient passes
}


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("path", ["definition", "blocks"])
@pytest.mark.parametrize("edge", list(AT_THE_EDGE))
def test_a_pair_exactly_at_the_cutoff_the_stop_or_the_clamp_counts_in_both_passes(edge, path, dtype):
    changes, alpha = AT_THE_EDGE[edge]
    settings = PAPER._replace(**changes)
    record = np.zeros((1, RECORD), dtype)
    record[0, [U, V, PRECISION, INVERSE_C]] = 3.5, 2.5, 2.0, 2.0
    record[0, LOG2_OPACITY], record[0, OPACITY], record[0, RED:DEPTH] = np.log2(alpha), alpha, 0.5
    module, forward, reverse = PATHS[path]
    lists = tile_lists(np.array([[0, 7, 0, 5]], np.int32), np.zeros(1, np.int32), module.TILE_WIDTH, 16, 8, 6)
    out, saved = forward(record, lists, settings, np.zeros(3, dtype), 8, 6)
    assert out.colour[0, 2, 3] == 0.5 * alpha
    seen = np.zeros((6, 8), dtype)
    seen[2, 3] = 1
    pairs = reverse(np.stack([seen, 0 * seen, 0 * seen]), 0 * seen, 0 * seen, saved)
    assert pairs[0, SUM_RED] == alpha and pairs[0, SUM_S] == 0.5 * alpha


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("height", [16, 1])
def test_a_tile_with_more_pairs_than_a_batch_equals_the_definition(height, dtype):
    """Every batch is blended, and every record is asked for in its turn; small splats, so that the loops are short."""
    count = 2 * compositing_blocks.BATCH + 5
    places = np.random.default_rng(20).uniform(0, [[16], [height]], (2, count))
    camera = plain_camera(16, height)
    scene = screen_scene(camera, *places, 3 + 0.01 * np.arange(count), 0.5, 0.4, rgb_for(21, count))
    slow, fast = both(as_dtype(scene, dtype), camera)
    assert_close_l2(fast, slow, 1e-12 if dtype == np.float64 else 1e-4)
    assert np.abs(fast["opacity_logit"]).min() > 0  # every batch was blended


def test_a_tile_that_is_not_the_first_is_read_into_its_own_cells():
    rng, height, width = np.random.default_rng(0), TILE_HEIGHT, TILE_WIDTH
    plane = compositing_tiles.PLANE
    colour, d_colour = rng.normal(size=(2, 3, 3 * height, 3 * width))
    depth, d_depth, transmittance, d_opacity = rng.normal(size=(4, 3 * height, 3 * width))
    buffer = np.full(6 * plane, 7.0)
    compositing_tiles.clear(buffer, height, width)
    images = (colour, depth, transmittance, d_colour, d_depth, d_opacity)
    compositing_tiles.read_tile(buffer, height, width, *images)
    total = (d_colour * colour).sum(axis=0) + d_depth * depth - d_opacity * transmittance
    for k, image in enumerate((np.ones_like(depth), total, *d_colour, d_depth)):
        found = buffer[k * plane : (k + 1) * plane]
        np.testing.assert_allclose(
            found[places(buffer.dtype)], image[height : 2 * height, width : 2 * width], atol=1e-14
        )
        assert not found[height * width :].any()


def test_the_opacity_of_a_picture_of_one_row_counts():
    """`d_opacity` without rows means that nothing depends on it; one row is a picture."""
    d_opacity, transmittance = np.random.default_rng(0).normal(size=(2, 1, TILE_WIDTH))
    nothing, nothings = np.zeros((1, TILE_WIDTH)), np.zeros((3, 1, TILE_WIDTH))
    buffer = np.zeros(6 * compositing_tiles.PLANE)
    compositing_tiles.read_tile(buffer, 0, 0, nothings, nothing, transmittance, nothings, nothing, d_opacity)
    behind = buffer[compositing_tiles.PLANE :][places(buffer.dtype)][0]
    np.testing.assert_array_equal(behind, -(d_opacity * transmittance)[0])
