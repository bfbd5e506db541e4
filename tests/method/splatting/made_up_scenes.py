"""Cameras, scenes and comparisons for the tests of the rasteriser."""

from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut, Scene, render_forward, render_reverse
from endotsr.method.splatting.settings import LegacyDeviations, RasterSettings

U64 = 2.0**-53
U32 = 2.0**-24
IMAGES = ("colour", "depth", "opacity")
FIELDS = ("position", "quaternion", "log_scale", "opacity_logit", "harmonics", "residual")


def plain_camera(width: int = 65, height: int = 47, focal: float = 50.0) -> Camera:
    """At the origin, looking along z, principal point off centre."""
    return Camera(np.eye(3), np.zeros(3), focal, 1.1 * focal, width / 2 + 1.3, height / 2 - 0.7, width, height)


def turned_camera(width: int = 65, height: int = 47, focal: float = 50.0) -> Camera:
    """As `plain_camera`, rotated and shifted."""
    rotation = Rotation.from_euler("zyx", [0.3, -0.2, 0.15]).as_matrix()
    return plain_camera(width, height, focal)._replace(rotation=rotation, translation=np.array([0.3, -0.2, 0.4]))


def world(camera: Camera, seen: NDArray) -> NDArray:
    """World positions of points (3, N) given in camera axes."""
    return camera.rotation.T @ (seen - camera.translation[:, None])


def random_scene(seed: int, count: int, camera: Camera, size=(0.7, 12.0), dtype: Any = np.float64) -> Scene:
    """Gaussians in and around the image, semi-axes of `size` pixels, some behind the camera, depths not in order."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(2.0, 12.0, count)
    z[::17] *= -1.0
    u, v = (
        rng.uniform(-0.15 * camera.width, 1.15 * camera.width, count),
        rng.uniform(-0.15 * camera.height, 1.15 * camera.height, count),
    )
    seen = np.stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z])
    axes = np.exp(rng.uniform(np.log(size[0]), np.log(size[1]), (3, count)))
    harmonics = rng.normal(0, 0.15, (16, 3, count))
    harmonics[0] = rng.uniform(-1.2, 1.8, (3, count))
    scene = Scene(
        world(camera, seen),
        rng.normal(0, 1, (4, count)),
        np.log(axes * np.abs(z) / camera.fx),
        rng.normal(0.5, 2.5, count),
        harmonics,
        rng.uniform(-0.5, 0.5, (3, count)),
    )
    return as_dtype(scene, dtype)


def screen_scene(camera: Camera, u, v, z, sigma, opacity, rgb) -> Scene:
    """Round Gaussians of degree 0 at pixel coordinates (u, v); every argument may be a scalar."""
    u, v, z, sigma, opacity = (np.atleast_1d(np.asarray(x, float)) for x in (u, v, z, sigma, opacity))
    n = max(x.size for x in (u, v, z, sigma, opacity))
    u, v, z, sigma, opacity = (np.broadcast_to(x, n) for x in (u, v, z, sigma, opacity))
    rgb = np.broadcast_to(np.asarray(rgb, float).reshape(3, -1), (3, n))
    seen = np.stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z])
    quaternion = np.tile(np.array([[1.0], [0.0], [0.0], [0.0]]), (1, n))
    log_scale = np.tile(np.log(sigma * z / camera.fx), (3, 1))
    with np.errstate(divide="ignore"):
        logit = np.clip(np.log(opacity) - np.log1p(-opacity), -800, 800)
    return Scene(world(camera, seen), quaternion, log_scale, logit, ((rgb - 0.5) / Y00)[None].copy())


def as_dtype(scene: Scene, dtype: Any) -> Scene:
    """The same numbers, rounded."""
    return Scene(*(None if a is None else np.ascontiguousarray(a, dtype) for a in scene))


def select(scene: Scene, index) -> Scene:
    """The Gaussians named by `index`."""
    return Scene(*(None if a is None else np.ascontiguousarray(a[..., index]) for a in scene))


def cotangents(out: RenderOut, seed: int = 0) -> tuple[NDArray, NDArray, NDArray]:
    """Random gradients by the three images, in their dtype."""
    rng = np.random.default_rng(seed)
    colour, depth, opacity = (rng.normal(0, 1, image.shape).astype(image.dtype) for image in out)
    return colour, depth * out.depth.dtype.type(0.1), opacity


def run(
    scene: Scene,
    camera: Camera,
    settings: RasterSettings,
    path: Any = "auto",
    *,
    background=None,
    degree: int | None = None,
    given=None,
    seed: int = 0,
) -> tuple[dict[str, NDArray], dict[str, NDArray]]:
    """Images and all gradients, by name, for random (or `given`) gradients of the images."""
    degree = int(np.sqrt(scene.harmonics.shape[0])) - 1 if degree is None else degree
    out, saved = render_forward(scene, camera, settings, degree=degree, background=background, compositor=path)
    given = cotangents(out, seed) if given is None else given
    grads = render_reverse(*given, saved, background_gradient=True, pose_gradient=True)
    named = {name: getattr(grads, f"d_{name}") for name in (*FIELDS, "mean2d", "background")}
    assert grads.d_camera is not None
    named |= {"rotation_matrix": grads.d_camera.d_rotation, "translation": grads.d_camera.d_translation}
    return out._asdict(), {name: a for name, a in named.items() if a is not None}


def deviating(settings: RasterSettings, **flags: bool) -> RasterSettings:
    """The settings with exactly these deviations."""
    return settings._replace(deviations=LegacyDeviations(**flags))


def assert_bitwise(one: dict[str, NDArray], two: dict[str, NDArray]) -> None:
    """Equal names, dtypes and bits (0 and -0 count as equal)."""
    assert one.keys() == two.keys()
    for name in one:
        assert one[name].dtype == two[name].dtype, name
        np.testing.assert_array_equal(one[name], two[name], err_msg=name)


def natural_size(name: str, group: dict[str, NDArray], norm) -> float:
    """What rounding is measured against: the array's own size, or that of what it was summed or projected from.

    A round Gaussian has no gradient by rotation: there the gradient by log-scale is the measure. The pose gradient is
    a sum over all Gaussians, in which large terms cancel.
    """
    own = float(norm(group[name].astype(np.float64)))
    if name == "quaternion" and "log_scale" in group:
        return max(own, float(norm(group["log_scale"].astype(np.float64))))
    if name in ("translation", "rotation_matrix") and "position" in group:
        return max(own, float(np.abs(group["position"]).sum(dtype=np.float64)))
    return own


def assert_close(one: dict[str, NDArray], two: dict[str, NDArray], bound: float) -> None:
    """Largest difference of each array <= bound x its largest entry (see `natural_size`)."""
    for name in one:
        scale = natural_size(name, two, lambda a: np.abs(a).max(initial=0.0))
        worst = np.abs(one[name] - two[name]).max(initial=0.0)
        assert worst <= bound * scale, f"{name}: {worst:.3g} of {scale:.3g}"


def assert_close_l2(one: dict[str, NDArray], two: dict[str, NDArray], bound: float) -> None:
    """Relative L2 difference of each array <= bound (see `natural_size`)."""
    for name in one:
        scale = natural_size(name, two, np.linalg.norm)
        worst = np.linalg.norm(one[name].astype(np.float64) - two[name])
        assert worst <= bound * scale, f"{name}: {worst:.3g} of {scale:.3g}"


def assert_finite(*groups: dict[str, NDArray]) -> None:
    """No NaN and no infinity."""
    for group in groups:
        for name, array in group.items():
            assert np.isfinite(array).all(), f"{name}: {np.count_nonzero(~np.isfinite(array))} entries not finite"


@pytest.fixture
def threads():
    """Sets the number of threads; the old number comes back."""
    if numba.config.NUMBA_NUM_THREADS < 2:  # type: ignore[attr-defined]
        pytest.skip("one thread only (NUMBA_NUM_THREADS)")
    before = numba.get_num_threads()
    yield numba.set_num_threads
    numba.set_num_threads(before)
