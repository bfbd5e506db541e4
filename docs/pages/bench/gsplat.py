"""gsplat's pure-torch reference, with autograd, on scenes of this package: an independent image and gradient.

torch and gsplat are optional (`pip install 'endotsr[peers]'`) and imported inside the functions. Covariance,
projection, harmonics and alpha are gsplat's own Python formulas. Two parts of that reference need a GPU and are
replaced here: the list of (Gaussian, pixel) pairs, computed by a CUDA kernel, and nerfacc, which sums along rays.
"""
# pyright: reportMissingImports=false

import sys
from types import ModuleType
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, camera_centre
from endotsr.method.splatting.render import Scene
from endotsr.method.splatting.settings import RasterSettings

ALPHA_MAX = 0.999  # a constant inside gsplat's Python reference
JACOBIAN_CLAMP = 1.3  # likewise; measured from the image border, so it equals ours for a centred principal point only


class PeerRender(NamedTuple):
    """One view and the gradients with respect to every array of the scene, under the scene's names and shapes."""

    colour: FloatArray  # (3, H, W)
    depth: FloatArray  # (H, W) sum of z alpha T
    gradients: dict[str, FloatArray]


def available() -> str | None:
    """None if torch and gsplat can be imported, else the reason."""
    try:
        import torch  # noqa: F401
        from gsplat.cuda import _torch_impl  # noqa: F401
    except Exception as error:  # an optional library may also fail while it is imported
        return f"{type(error).__name__}: {error}"
    return None


def difference_of_rules(scene: Scene, camera: Camera, settings: RasterSettings) -> str | None:
    """The rule of gsplat that differs from `settings` on this scene, or None; the constants of gsplat are fixed."""
    if settings.support == "three_sigma_tiles" or any(settings.deviations):
        return "support by 3 sigma tiles and the deviations of `legacy` have no counterpart"
    if scene.residual is not None:
        return "there is no colour residual; add it to the harmonics"
    opacity = 1 / (1 + np.exp(-scene.opacity_logit))
    if settings.alpha_max != ALPHA_MAX and opacity.max(initial=0) > min(settings.alpha_max, ALPHA_MAX):
        return f"alpha is clamped at {ALPHA_MAX}: give alpha_max = {ALPHA_MAX} or opacities below both clamps"
    x, y, z = camera.rotation @ scene.position + camera.translation[:, None]
    seen = z > settings.near
    for slope, focal, centre, pixels in (
        (x, camera.fx, camera.cx, camera.width),
        (y, camera.fy, camera.cy, camera.height),
    ):
        slope = slope[seen] / z[seen]
        margin = (JACOBIAN_CLAMP - 1) * pixels / 2
        low, high = -(centre + margin) / focal, (pixels - centre + margin) / focal
        ours = settings.jacobian_clamp * pixels / (2 * focal) if settings.jacobian_clamp > 0 else np.inf
        if not np.allclose(np.clip(slope, low, high), np.clip(slope, -ours, ours), rtol=1e-13, atol=0):
            return "a centre lies beyond the limit of the Jacobian clamp, and the limits differ"
    return None


def render_with_gradients(
    scene: Scene,
    camera: Camera,
    settings: RasterSettings,
    d_colour: FloatArray,
    d_depth: FloatArray,
    *,
    degree: int = 3,
    background: FloatArray | None = None,
) -> PeerRender:
    """Colour, depth and the gradients of sum(d_colour * colour) + sum(d_depth * depth), in the dtype of the scene.

    scene, camera, settings, degree, background   as for `endotsr.method.splatting.render.render_forward`
    d_colour (3, H, W), d_depth (H, W)            gradients of a loss with respect to the two images
    Raises: ValueError if gsplat's rules and `settings` differ on this scene, see `difference_of_rules`.
    """
    import torch

    difference = difference_of_rules(scene, camera, settings)
    if difference is not None:
        raise ValueError(f"no comparison with gsplat: {difference}")
    leaves = {name: torch.tensor(a, requires_grad=True) for name, a in scene._asdict().items() if a is not None}
    means2d, depth, conics, opacity = _screen(leaves, camera, settings)
    colour = _colour(leaves, camera, degree)
    screen = _values(means2d), _values(depth), _values(conics), _values(opacity)
    gaussian, pixel = pair_list(*screen, camera.width, camera.height, settings)
    painted, covered = _accumulate(
        means2d, conics, opacity, torch.cat([colour, depth[:, None]], dim=1), gaussian, pixel, camera
    )
    back = torch.zeros(3, dtype=painted.dtype) if background is None else torch.tensor(background, dtype=painted.dtype)
    image = painted[..., :3] + (1 - covered) * back
    image, depth_image = image.permute(2, 0, 1), painted[..., 3]
    loss = (image * torch.tensor(d_colour)).sum() + (depth_image * torch.tensor(d_depth)).sum()
    loss.backward()
    gradients = {
        name: np.zeros_like(a) if leaves[name].grad is None else leaves[name].grad.numpy()
        for name, a in scene._asdict().items()
        if a is not None
    }
    return PeerRender(_values(image), _values(depth_image), gradients)


def _values(tensor: Any) -> FloatArray:
    return tensor.detach().numpy()


def _screen(leaves: dict[str, Any], camera: Camera, settings: RasterSettings) -> tuple[Any, Any, Any, Any]:
    """Means (N, 2), depths (N,), conics (N, 3), opacities (N,) of all Gaussians, by gsplat's formulas."""
    import torch
    from gsplat.cuda import _torch_impl as gsplat

    position = leaves["position"]
    view, lens = torch.eye(4, dtype=position.dtype), torch.eye(3, dtype=position.dtype)
    view[:3, :3], view[:3, 3] = torch.tensor(camera.rotation), torch.tensor(camera.translation)
    lens[0, 0], lens[1, 1], lens[0, 2], lens[1, 2] = camera.fx, camera.fy, camera.cx, camera.cy
    covariance, _ = gsplat._quat_scale_to_covar_preci(
        leaves["quaternion"].T, leaves["log_scale"].exp().T, compute_preci=False
    )
    _, means2d, depth, conics, _ = gsplat._fully_fused_projection(
        position.T, covariance, view[None], lens[None], camera.width, camera.height,
        eps2d=settings.low_pass, near_plane=settings.near,
    )  # fmt: skip
    return means2d[0], depth[0], conics[0], leaves["opacity_logit"].sigmoid()


def _colour(leaves: dict[str, Any], camera: Camera, degree: int) -> Any:
    """(N, 3) display colour from harmonics, computed as in gsplat's `rasterization`."""
    import torch
    from gsplat.cuda import _torch_impl as gsplat

    direction = leaves["position"].T - torch.tensor(camera_centre(camera), dtype=leaves["position"].dtype)
    shown = gsplat._spherical_harmonics(degree, direction, leaves["harmonics"].permute(2, 0, 1))
    return torch.clamp_min(shown + 0.5, 0.0)


def pair_list(
    means2d: FloatArray,
    depth: FloatArray,
    conics: FloatArray,
    opacity: FloatArray,
    width: int,
    height: int,
    settings: RasterSettings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of Gaussian and pixel that are blended, pixels row by row and front to back within a pixel.

    means2d (N, 2) px, depth (N,) scene units, conics (N, 3) inverse covariance, opacity (N,)
    returns (M,) Gaussian, (M,) pixel = row * width + column, after near plane, cutoff and stop
    """
    nearest_first = np.argsort(depth, kind="stable")
    nearest_first = nearest_first[depth[nearest_first] > settings.near]
    front = nearest_first
    x0, y0, columns, rows = _boxes(means2d[front], conics[front], opacity[front], width, height, settings)
    size = columns * rows
    gaussian = np.repeat(nearest_first, size)
    inside = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
    in_row, wide = inside % np.maximum(np.repeat(columns, size), 1), np.repeat(columns, size)
    column, row = np.repeat(x0, size) + in_row, np.repeat(y0, size) + inside // np.maximum(wide, 1)
    dx, dy = column + 0.5 - means2d[gaussian, 0], row + 0.5 - means2d[gaussian, 1]
    a, b, c = conics[gaussian].T
    alpha = np.minimum(opacity[gaussian] * np.exp(-0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy), ALPHA_MAX)
    pixel = row * width + column
    kept = alpha >= settings.alpha_cutoff
    by_pixel = np.flatnonzero(kept)[np.argsort(pixel[kept], kind="stable")]
    gaussian, pixel, alpha = gaussian[by_pixel], pixel[by_pixel], alpha[by_pixel]
    place = np.arange(pixel.size) - np.searchsorted(pixel, pixel)
    through = np.ones((width * height, place.max(initial=0) + 1))
    through[pixel, place] = 1 - alpha
    behind = np.cumprod(through, axis=1)[pixel, place]
    before_the_stop = behind >= settings.transmittance_stop
    return gaussian[before_the_stop], pixel[before_the_stop]


def _boxes(means2d, conics, opacity, width, height, settings):
    """First column, first row, number of columns and of rows of a box with every pixel of alpha >= cutoff."""
    if settings.alpha_cutoff > 0:
        a, b, c = conics.T
        determinant = a * c - b * b
        reach = 2 * np.maximum(np.log(opacity / settings.alpha_cutoff), 0)
        half = np.sqrt(reach * np.stack([c, a]) / determinant) + 1
    else:
        half = np.full((2, opacity.size), np.inf)
    size = np.array([[width], [height]])
    low = np.ceil(np.clip(means2d.T - half - 0.5, 0, size)).astype(np.int64)
    high = np.floor(np.clip(means2d.T + half - 0.5, -1, size - 1)).astype(np.int64)
    columns, rows = np.maximum(high - low + 1, 0)
    return low[0], low[1], columns, rows


def _accumulate(means2d, conics, opacity, channels, gaussian, pixel, camera: Camera) -> tuple[Any, Any]:
    """gsplat's `accumulate` (H, W, channels), (H, W, 1), with `_along_rays` instead of nerfacc."""
    import torch
    from gsplat.cuda import _torch_impl as gsplat

    index, image = torch.tensor(gaussian), torch.zeros(gaussian.size, dtype=torch.int64)
    batch = (t[None] for t in (means2d, conics, opacity, channels))
    with patch.dict(sys.modules, {"nerfacc": _along_rays()}):
        painted, covered = gsplat.accumulate(*batch, index, torch.tensor(pixel), image, camera.width, camera.height)
    return painted[0], covered[0]


def _along_rays() -> ModuleType:
    """The two functions of nerfacc that gsplat calls, in torch: a dense table (rays, longest list) of 1 - alpha."""
    import torch

    def render_weight_from_alpha(alphas, ray_indices, n_rays):
        place = torch.arange(ray_indices.numel()) - torch.searchsorted(ray_indices, ray_indices)
        longest = int(place.max()) + 1 if place.numel() else 0
        table = torch.ones((n_rays, longest + 1), dtype=alphas.dtype)
        through = table.index_put((ray_indices, place + 1), 1 - alphas).cumprod(dim=1)[ray_indices, place]
        return through * alphas, through

    def accumulate_along_rays(weights, values, ray_indices, n_rays):
        summand = weights[:, None] if values is None else weights[:, None] * values
        return torch.zeros((n_rays, summand.shape[1]), dtype=summand.dtype).index_add(0, ray_indices, summand)

    module = ModuleType("nerfacc")
    module.__dict__.update(
        render_weight_from_alpha=render_weight_from_alpha, accumulate_along_rays=accumulate_along_rays
    )
    return module
