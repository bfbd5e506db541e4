"""Projection: hard cases P1-P7, C1, C2, C3 and the identities of B3."""

import mpmath
import numpy as np
import pytest
from made_up_scenes import (
    U32,
    U64,
    as_dtype,
    assert_bitwise,
    assert_finite,
    plain_camera,
    random_scene,
    run,
    screen_scene,
    select,
    turned_camera,
    world,
)
from scipy.spatial.transform import Rotation

from endotsr.definition import projection as definition
from endotsr.definition.render import render_forward as render_by_definition
from endotsr.method.splatting.camera import backproject, camera_centre, project, scale_camera
from endotsr.method.splatting.covariance import (
    Shape,
    covariance_forward,
)
from endotsr.method.splatting.projection import (
    AXIS_LIMIT,
    footprint,
    projection_forward,
    projection_reverse,
    projection_reverse_footprint,
)
from endotsr.method.splatting.records import INVERSE_C, PRECISION, SLOPE, log_opacity, pack_records
from endotsr.method.splatting.render import Scene
from endotsr.method.splatting.settings import EXACT, PAPER
from oracle.determinant import determinant

CAMERA = plain_camera(33, 29, 25.0)
BACKGROUND = np.array([0.3, 0.6, 0.1])
PLACES = [(sx * f, sy * g) for f, g in ((0.9, 0.2), (1.1, 0.2), (0.2, 0.9), (0.2, 1.1), (1.1, 1.1))
          for sx, sy in ((1, 1), (-1, -1))]  # fmt: skip


# --- the near plane ---


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("settings", [EXACT, PAPER], ids=["exact", "paper"])
@pytest.mark.parametrize("near", [0.2, 1e-6, 50.0])
def test_hard_P1_at_or_before_the_near_plane_nothing_happens(settings, near, dtype):
    settings = settings._replace(near=near)
    plane = float(dtype(near))
    tiny = 1e-300 if dtype == np.float64 else 1e-40
    hidden = [-1.0, -1e-12, 0.0, -0.0, tiny, plane, float(np.nextafter(dtype(near), dtype(0)))]
    scene = random_scene(6, 40, CAMERA)
    scene.position[:] = np.where(scene.position[2] > 0, 1, -1) * scene.position  # all in front
    scene.position[2] += near
    scene = as_dtype(scene, dtype)
    extra = select(scene, np.arange(len(hidden)))
    extra.position[2] = hidden
    extra.position[:2] *= 0.01
    extra.opacity_logit[:] = 5.0
    n = len(hidden)
    # every visible one keeps its index and the hidden ones stand before them
    mixed = Scene(*(np.concatenate([a, b], axis=-1) if a is not None else None for a, b in zip(extra, scene)))
    images, _ = run(scene, CAMERA, settings)
    with_hidden, gradients = run(mixed, CAMERA, settings)
    assert_bitwise(with_hidden, images)
    for name in ("position", "quaternion", "log_scale", "opacity_logit", "harmonics", "residual", "mean2d"):
        assert (gradients[name][..., :n] == 0).all(), name
        assert gradients[name][..., n:].any(), name


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_P1_just_behind_the_near_plane_it_is_drawn(dtype):
    scene = as_dtype(screen_scene(CAMERA, 16.0, 14.0, 0.2, 3.0, 0.8, [1, 1, 1]), dtype)
    scene.position[2] = np.nextafter(dtype(0.2), dtype(1))
    images, gradients = run(scene, CAMERA, PAPER)
    assert images["opacity"].max() > 0.7 and gradients["position"].any()
    assert_finite(images, gradients)


@pytest.mark.parametrize("settings", [EXACT, PAPER], ids=["exact", "paper"])
@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_hard_P1_scale_invariance(settings, factor):
    """Positions, axes, near and camera translation times a factor: the image stays, depth scales."""
    camera = turned_camera(33, 29, 25.0)
    scene = random_scene(7, 60, camera)
    images, gradients = run(scene, camera, settings, "definition")
    bigger = scene._replace(position=scene.position * factor, log_scale=scene.log_scale + np.log(factor))
    far = camera._replace(translation=camera.translation * factor)
    scaled, back = run(bigger, far, settings._replace(near=settings.near * factor), "definition", given=None)
    assert np.abs(scaled["colour"] - images["colour"]).max() <= 1e-12
    assert np.abs(scaled["opacity"] - images["opacity"]).max() <= 1e-12
    assert np.abs(scaled["depth"] / factor - images["depth"]).max() <= 1e-12 * images["depth"].max()
    del gradients, back


# --- projection (B3) ---


def clamp_scene(settings=PAPER):
    """Centres at 0.9 and 1.1 of the limit of the Jacobian clamp, both signs, both axes."""
    limit = np.array([CAMERA.width / (2 * CAMERA.fx), CAMERA.height / (2 * CAMERA.fy)]) * settings.jacobian_clamp
    z = 3.0 + 0.3 * np.arange(len(PLACES))
    xy = np.array(PLACES).T * limit[:, None] * z
    rng = np.random.default_rng(8)
    n = len(PLACES)
    return np.vstack([xy, z]), rng.normal(0, 1, (4, n)), np.log(rng.uniform(0.4, 1.5, (3, n)))


@pytest.mark.parametrize("stage", ["mean2d", "covariance2d", "depth"])
def test_hard_P2_P7_gradient_by_position_through_mean_jacobian_and_depth(stage):
    """Against the complex step, each output of the projection alone, free and clamped centres."""
    position, q, s = clamp_scene()
    shape, _ = covariance_forward(q, s)
    _, saved = projection_forward(position, shape, CAMERA, PAPER)
    n = position.shape[1]
    rng = np.random.default_rng(9)
    given = {"mean2d": np.zeros((2, n)), "covariance2d": np.zeros((3, n)), "depth": np.zeros(n)}
    given[stage] = rng.normal(0, 1, given[stage].shape)
    found = projection_reverse(given["mean2d"], given["covariance2d"], given["depth"], saved).d_position
    for axis in range(3):
        moved = position.astype(complex)
        moved[axis] += 1e-40j
        output = getattr(definition.projection_forward(moved, shape, CAMERA, PAPER)[0], stage)
        wanted = (given[stage].reshape(-1, n) * output.reshape(-1, n).imag / 1e-40).sum(axis=0)
        np.testing.assert_allclose(found[axis], wanted, rtol=1e-11, atol=1e-13 * np.abs(found).max())


def test_hard_P2_the_clamp_acts_on_the_jacobian_and_not_on_the_centre():
    position, q, s = clamp_scene()
    shape, _ = covariance_forward(q, s)
    clamped, _ = projection_forward(position, shape, CAMERA, PAPER)
    free, _ = projection_forward(position, shape, CAMERA, EXACT)
    np.testing.assert_array_equal(clamped.mean2d, free.mean2d)
    same = (clamped.covariance2d == free.covariance2d).all(axis=0)
    np.testing.assert_array_equal(same, [max(abs(x), abs(y)) < 1 for x, y in PLACES])


@pytest.mark.parametrize("dtype, far", [(np.float64, 1e70), (np.float64, -1e70), (np.float32, 1e20)])
@pytest.mark.parametrize("place", ["x", "y", "quaternion", "log_scale"])
def test_out_of_range_or_not_a_number_is_not_visible_and_all_zero(place, dtype, far):
    position, q, s = (
        np.array([[0.1], [0.2], [3.0]], dtype),
        np.array([[1.0], [0], [0], [0]], dtype),
        np.zeros((3, 1), dtype),
    )
    if place in "xy":
        position["xy".index(place)] = far
    (q if place == "quaternion" else s)[0] = np.nan if len(place) > 1 else 0.5
    shape, _ = covariance_forward(q, s)
    projected, _ = projection_forward(position, shape, plain_camera(), PAPER)
    assert not projected.visible[0]
    for name in ("mean2d", "covariance2d", "determinant", "depth"):
        assert not getattr(projected, name).any(), name


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_depth_that_overflows_is_not_visible(dtype):
    """Seen along the diagonal of two coordinates that are just finite: the middle of the picture, at infinity."""
    camera = plain_camera()._replace(rotation=Rotation.from_euler("x", 45, degrees=True).as_matrix())
    largest = np.finfo(dtype).max
    position = np.array([[0], [largest], [largest]], dtype)
    shape = Shape(np.eye(3, dtype=dtype)[:, :, None], np.ones((3, 1), dtype))
    with np.errstate(over="ignore", invalid="ignore"):  # scalars, where nothing is compiled
        projected, _ = projection_forward(position, shape, camera, PAPER)
    assert not projected.visible.any() and not projected.depth.any()


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_centre_exactly_at_the_limit_is_drawn(side, axis, dtype):
    camera, limit = plain_camera(focal=1.0)._replace(fy=1.0, cx=0.0, cy=0.0), dtype(AXIS_LIMIT[np.dtype(dtype)])
    position = np.array([[0, 0], [0, 0], [1, 1]], dtype)
    position[axis] = side * limit, side * np.nextafter(limit, dtype(np.inf))
    shape = Shape(np.repeat(np.eye(3, dtype=dtype)[:, :, None], 2, axis=2), np.ones((3, 2), dtype))
    assert projection_forward(position, shape, camera, PAPER)[0].visible.tolist() == [True, False]


def on_screen(position, rotation, camera):
    """(2, 3, N) images of the unit axes, px: J W R."""
    x, y, z = camera.rotation @ position + camera.translation[:, None]
    zero = np.zeros_like(z)
    j = np.array([[camera.fx / z, zero, -camera.fx * x / z**2], [zero, camera.fy / z, -camera.fy * y / z**2]])
    return np.einsum("ijn,jk,kln->iln", j, camera.rotation, rotation)


@pytest.mark.parametrize("dtype, bound", [(np.float64, 1e-9), (np.float32, 1e-3)])
def test_an_axis_beyond_the_limit_is_as_long_as_the_limit_with_zero_gradient(dtype, bound):
    camera, n, limit = turned_camera(), 90, AXIS_LIMIT[np.dtype(dtype)]
    scene = as_dtype(random_scene(21, n, camera), dtype)
    shape, _ = covariance_forward(scene.quaternion, scene.log_scale)
    unit = on_screen(scene.position.astype(float), shape.rotation.astype(float), camera)
    longest = limit / np.abs(unit).sum(axis=0)  # (3, N) scene units
    huge, factor = (np.arange(n) % 3, np.arange(n)), np.resize([0.5, 0.9, 1.1, 2.0, 1e3], n)
    given, taken = shape.scale.copy(), shape.scale.copy()
    given[huge], taken[huge] = (factor * longest[huge]), np.minimum(factor, 1 - bound / 100) * longest[huge]
    d_mean2d, d_footprint = np.zeros((2, n), dtype), np.random.default_rng(22).normal(size=(3, n)).astype(dtype)
    found, wanted = (
        projection_forward(scene.position, Shape(shape.rotation, s), camera, EXACT) for s in (given, taken)
    )
    for one, two in zip(found[0], wanted[0], strict=True):
        np.testing.assert_allclose(one, two, rtol=bound)
    a, b = (projection_reverse_footprint(d_mean2d, d_footprint, d_mean2d[0], saved) for _, saved in (found, wanted))
    clipped, seen = np.zeros((3, n), bool), found[0].visible
    clipped[huge] = factor > 1
    assert seen.sum() > 80 and b.d_scale[:, seen].all()
    np.testing.assert_array_equal((a.d_scale == 0)[:, seen], clipped[:, seen])
    assert not a.d_rotation[:, clipped].any()
    np.testing.assert_allclose(a.d_scale[~clipped], b.d_scale[~clipped], rtol=bound)
    np.testing.assert_allclose(a.d_rotation[:, ~clipped], b.d_rotation[:, ~clipped], rtol=bound)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_exactly_at_the_limit_is_not_clipped(axis, dtype):
    """The kink from both sides: the same footprint, and a gradient at the limit but none just beyond it."""
    camera, limit = plain_camera(focal=1.0)._replace(fy=1.0), dtype(AXIS_LIMIT[np.dtype(dtype)])
    seen = []
    for length in (limit, np.nextafter(limit, dtype(np.inf))):
        shape = Shape(np.eye(3, dtype=dtype)[:, :, None], np.ones((3, 1), dtype))
        shape.scale[axis] = length
        out, saved = projection_forward(np.array([[0], [0], [1]], dtype), shape, camera, EXACT)
        back = projection_reverse_footprint(np.zeros((2, 1), dtype), np.ones((3, 1), dtype), np.zeros(1, dtype), saved)
        seen.append((*out.covariance2d[:, 0], out.determinant[0], back.d_scale[axis, 0] != 0))
    assert seen[0][:-1] == seen[1][:-1] and seen[0][-1] and not seen[1][-1]


def test_the_footprint_of_what_is_not_visible_is_zero():
    camera, one = plain_camera(), np.array([[1.0], [0], [0], [0]])
    shape, _ = covariance_forward(np.repeat(one, 2, axis=1), np.zeros((3, 2)))
    projected, _ = projection_forward(np.array([[0.0, 0], [0, 0], [3.0, -3.0]]), shape, camera, PAPER)
    found = footprint(projected)
    assert projected.visible.tolist() == [True, False] and (found[:, 1] == 0).all() and (found[[0, 2], 0] > 0).all()


@pytest.mark.parametrize("clamp", [0.0, 0.4, 1.3])
def test_the_clamp_of_the_jacobian_is_a_share_of_the_half_picture(clamp):
    """Beyond clamp x tan(fov / 2) the slope that enters the Jacobian is constant; 0 means no clamp."""
    camera = plain_camera(64, 48, 40.0)
    limits = [clamp * 64 / 80, clamp * 48 / 88] if clamp else [np.inf, np.inf]
    settings = PAPER._replace(jacobian_clamp=clamp, low_pass=0.0)
    for slope in (0.1, 0.5, 0.9):
        position = np.array([[slope], [-slope], [1.0]])
        shape, _ = covariance_forward(np.array([[1.0], [0], [0], [0]]), np.log(np.full((3, 1), 0.01)))
        projected, _ = projection_forward(position, shape, camera, settings)
        x, y = min(slope, limits[0]), -min(slope, limits[1])
        jacobian = np.array([[40.0, 0, -40.0 * x], [0, 44.0, -44.0 * y]]) * 0.01
        a, b, c = projected.covariance2d[:, 0]
        np.testing.assert_allclose([[a, b], [b, c]], jacobian @ jacobian.T, rtol=1e-12)


@pytest.mark.parametrize("width, height", [(64, 48), (65, 47), (1, 1), (640, 512)])
def test_hard_P3_project_of_backproject_is_the_pixel_centre(width, height):
    camera = turned_camera(width, height, 40.0)
    rng = np.random.default_rng(10)
    column, row = rng.integers(0, width, 200), rng.integers(0, height, 200)
    position = backproject(camera, column, row, rng.uniform(0.5, 200, 200))
    shape, _ = covariance_forward(np.ones((4, 200)), np.zeros((3, 200)))
    out, _ = projection_forward(position, shape, camera, PAPER)
    assert np.abs(out.mean2d[0] - (column + 0.5)).max() <= 1e-11
    assert np.abs(out.mean2d[1] - (row + 0.5)).max() <= 1e-11
    half = scale_camera(camera, 2 * width, 2 * height)
    out2, _ = projection_forward(position, shape, half, PAPER)
    np.testing.assert_allclose(out2.mean2d, 2 * out.mean2d, rtol=1e-12, atol=1e-11)


def test_the_position_of_points_is_that_of_the_projection_kernel_and_of_backprojection():
    camera = turned_camera(65, 47, 40.0)._replace(fy=44.0, cx=30.0, cy=25.5, translation=np.array([0.3, -0.2, 0.5]))
    rng = np.random.default_rng(11)
    column, row, depth = rng.integers(0, 65, 50), rng.integers(0, 47, 50), rng.uniform(0.5, 200, 50)
    position = backproject(camera, column, row, depth)
    u, v, z = project(camera, position)
    np.testing.assert_allclose([u, v, z], [column + 0.5, row + 0.5, depth], rtol=1e-11)
    shape, _ = covariance_forward(np.ones((4, 50)), np.zeros((3, 50)))
    out, _ = projection_forward(position, shape, camera, PAPER)
    np.testing.assert_allclose([u, v], out.mean2d, rtol=1e-12)


def test_a_point_behind_the_camera_keeps_its_depth():
    camera = plain_camera(33, 29, 25.0)
    _, _, z = project(camera, np.array([[0.1, 0.1], [0.2, 0.2], [-3.0, 0.0]]))
    assert z.tolist() == [-3.0, 0.0]


def test_hard_P4_no_epsilon_is_added_to_the_depth():
    z = np.array([1e-9, 1e-6, 1e-3, 1.0, 1e6, 1e12])
    position = np.stack([0.3 * z, -0.2 * z, z])
    shape, _ = covariance_forward(np.ones((4, 6)), np.full((3, 6), -10.0))
    out, _ = projection_forward(position, shape, CAMERA, PAPER._replace(near=1e-12))
    np.testing.assert_allclose(out.mean2d[0], CAMERA.fx * 0.3 + CAMERA.cx, rtol=8 * U64)
    np.testing.assert_allclose(out.mean2d[1], CAMERA.fy * -0.2 + CAMERA.cy, rtol=8 * U64)


@pytest.mark.parametrize("path, settings", [("definition", EXACT), ("definition", PAPER), ("blocks", PAPER)])
@pytest.mark.parametrize("dtype, bound", [(np.float64, 1e-9), (np.float32, 1e-6)])
def test_hard_P5_splat_far_larger_than_the_image(path, settings, dtype, bound):
    """Covariance 1e12 px^2: o c + (1 - o) background everywhere, next to no gradient by the mean."""
    scene = as_dtype(screen_scene(CAMERA, 10.0, 12.0, 4.0, 1e6, 0.7, [0.2, 0.5, 0.8]), dtype)
    images, gradients = run(scene, CAMERA, settings, path, background=BACKGROUND)
    wanted = 0.7 * np.array([0.2, 0.5, 0.8]) + 0.3 * BACKGROUND
    assert np.abs(images["colour"] - wanted[:, None, None]).max() <= bound
    assert np.abs(gradients["mean2d"]).max() <= 1e-6 and gradients["opacity_logit"].any()


# --- determinant and Mahalanobis form ---


def needles(seed, count, dtype, low=-2.0, high=5.0):
    """Semi-axes of 10^low to 10^high pixels at z = 2..9, random rotations; the rounded inputs are the exact ones."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(2, 9, count)
    position = np.stack([rng.uniform(-0.3, 0.3, count) * z, rng.uniform(-0.3, 0.3, count) * z, z]).astype(dtype)
    rotation = Rotation.random(count, random_state=seed).as_matrix().transpose(1, 2, 0)
    scale = 10 ** rng.uniform(low, high, (3, count)) * z / CAMERA.fx
    return position, Shape(np.ascontiguousarray(rotation, dtype), scale.astype(dtype))


def exact_screen(position, shape, i):
    low_pass = position.dtype.type(0.3)
    return determinant(position[:, i], shape.rotation[:, :, i], shape.scale[:, i], CAMERA, low_pass)


@pytest.mark.parametrize("dtype, u", [(np.float64, U64), (np.float32, U32)])
def test_hard_C1_determinant_of_needles_against_mpmath(dtype, u):
    position, shape = needles(11, 150, dtype)
    out, _ = projection_forward(position, shape, CAMERA, EXACT)
    assert (out.determinant >= dtype(0.3) * dtype(0.3)).all()
    for i in range(150):
        det, a, _, c = exact_screen(position, shape, i)
        with mpmath.workdps(60):
            smaller = (a + c) / 2 - mpmath.sqrt(((a + c) / 2) ** 2 - det) - float(dtype(0.3))
            second = float(mpmath.sqrt(max(smaller, 0)))  # second largest projected semi-axis, px
            error = abs(float((mpmath.mpf(float(out.determinant[i])) - det) / det))
        assert error <= (16 + 4 * second) * u, (i, error / u, second)


@pytest.mark.parametrize("dtype, u", [(np.float64, U64), (np.float32, U32)])
def test_hard_C2_mahalanobis_form_never_negative_and_accurate_along_needles(dtype, u):
    """|error of q| <= 16 u (q + sqrt(q / 0.3) |d| + u |d|^2 / 0.3), along the needle and anywhere; inputs are exact.

    16 = the roundings that m = b / c collects from the entries of T on.
    """
    count = 60
    position, shape = needles(12, count, dtype, -2.0, 3.5)
    out, _ = projection_forward(position, shape, CAMERA, EXACT)
    records = pack_records(
        np.arange(count, dtype=np.int32), out, log_opacity(np.zeros(count, dtype)), np.zeros((3, count), dtype)
    )
    rng = np.random.default_rng(13)
    for i in range(count):
        det, a, b, c = exact_screen(position, shape, i)
        with mpmath.workdps(60):
            angle = 0.5 * float(mpmath.atan2(2 * b, a - c))
            longest = float(mpmath.sqrt((a + c) / 2 + mpmath.sqrt(((a + c) / 2) ** 2 - det)))
        along = np.array([np.cos(angle), np.sin(angle)]) * longest
        for d in (along, -0.5 * along, rng.normal(0, 3, 2), along + rng.normal(0, 1, 2)):
            dx, dy = d.astype(dtype)
            e = dx - records[i, SLOPE] * dy
            q = records[i, INVERSE_C] * dy * dy + records[i, PRECISION] * e * e
            assert q >= 0 and q.dtype == dtype
            with mpmath.workdps(60):
                x, y = mpmath.mpf(float(dx)), mpmath.mpf(float(dy))
                exact = (c * x * x - 2 * b * x * y + a * y * y) / det
                length = float(mpmath.sqrt(x * x + y * y))
                bound = float(exact + mpmath.sqrt(exact / 0.3) * length) + u * length**2 / 0.3
                error = abs(float(mpmath.mpf(float(q)) - exact))
            assert error <= 16 * u * bound, (i, error / (u * bound))


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_C3_determinant_is_at_least_the_low_pass_squared(dtype):
    position, shape = needles(14, 2000, dtype, -9.0, 5.0)
    out, _ = projection_forward(position, shape, CAMERA, PAPER)
    assert (out.determinant >= dtype(0.3) * dtype(0.3)).all() and np.isfinite(out.determinant).all()


def test_hard_C5_shear_gradient_end_to_end():
    """A tilted splat, loss = one pixel: the gradient by the quaternion, through b, against the complex step."""
    scene = screen_scene(CAMERA, 16.2, 13.8, 4.0, [3.0], 0.6, [1, 1, 1])
    scene.log_scale[:, 0] += np.array([0.8, -0.9, 0.1])
    scene.quaternion[:, 0] = [0.8, 0.1, -0.2, 0.5]
    given = [np.zeros((3, CAMERA.height, CAMERA.width)), np.zeros((CAMERA.height, CAMERA.width)), None]
    given[0][0, 15, 18] = 1.0
    _, gradients = run(scene, CAMERA, EXACT, given=(given[0], given[1], np.zeros_like(given[1])))
    for k in range(4):
        moved = {"quaternion": scene.quaternion.astype(complex)}
        moved["quaternion"][k, 0] += 1e-40j
        image = render_by_definition(scene._replace(**moved), CAMERA, EXACT, degree=0)[0].colour
        wanted = image[0, 15, 18].imag / 1e-40
        assert abs(gradients["quaternion"][k, 0] - wanted) <= 1e-12 * np.abs(gradients["quaternion"]).max()


# --- pose ---


def test_moving_scene_and_camera_together_changes_nothing():
    """The sum of the gradients by position equals rotation^T times that by the camera translation."""
    camera = turned_camera(33, 29, 25.0)
    scene = random_scene(15, 60, camera)
    scene = scene._replace(harmonics=scene.harmonics[:1].copy())
    _, gradients = run(scene, camera, PAPER, "definition")
    np.testing.assert_allclose(
        gradients["position"].sum(axis=1), camera.rotation.T @ gradients["translation"], rtol=1e-10, atol=1e-11
    )
    np.testing.assert_allclose(camera.rotation @ camera_centre(camera), -camera.translation, atol=1e-15)
    np.testing.assert_allclose(world(camera, camera.rotation @ scene.position + camera.translation[:, None]),
                               scene.position, atol=1e-12)  # fmt: skip
