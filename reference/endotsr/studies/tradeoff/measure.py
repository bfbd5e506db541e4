"""One setting on one scene: image and gradients, their costs, and their errors relative to the reference.

Errors are computed at full resolution in float64. The gradients are those of a fixed linear functional of colour and
depth with random weights, which resemble the signs of an L1 loss. Every setting differentiates the same functional.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numba
import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.threads import use_threads
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderGrads, RenderOut, RenderSaved, render_forward, render_reverse
from endotsr.studies.bench.pairs import count_pairs
from endotsr.studies.tradeoff.scenes import StudyScene, in_precision, scaled
from endotsr.studies.tradeoff.settings import Setting
from endotsr.training.fitting.model import SceneSaved, Spectral, scene_at, scene_reverse
from endotsr.training.scene.gaussians import Gaussians

BLOCKS = ("position", "quaternion", "log_scale", "opacity_logit", "harmonics", "residual")  # of the deformed scene
WEIGHT_SEED = 5


class Prepared(NamedTuple):
    """A setting applied to a scene: everything computed once, not per frame."""

    scene: StudyScene
    setting: Setting
    gaussians: Gaussians
    spectral: Any
    camera: Camera
    d_colour: FloatArray  # (3, h, w) weights of the functional
    d_depth: FloatArray  # (h, w)


class RenderedFrame(NamedTuple):
    """Image and gradients of a setting, at full resolution in float64."""

    colour: FloatArray  # (3, H, W) display units
    gradients: dict[str, FloatArray]  # by block, with respect to the deformed scene


class RenderErrors(NamedTuple):
    """Errors of a frame relative to the reference."""

    max: float  # of the colour, display units
    rms: float
    gradients: dict[str, float]  # relative L2 error by block

    @property
    def gradient(self) -> float:
        """Relative error of the worst block."""
        return max(self.gradients.values(), default=0.0)


Shared = dict[tuple[Any, ...], Any]  # arrays that several settings have in common


def prepare(scene: StudyScene, setting: Setting, shared: Shared | None = None) -> Prepared:
    """Cast the scene, remove the terms that the setting omits, and draw the weights of the functional.

    shared   arrays of other settings of the same scene, to which those of this one are added: without it, each of
             the many settings of a study would have a copy of the scene
    """
    shared = {} if shared is None else shared
    cast = (setting.precision, setting.bases, setting.frequencies)
    if cast not in shared:
        gaussians, spectral = _reduced(scene, setting)
        shared[cast] = in_precision(gaussians, setting.precision), spectral
    if (setting.precision, setting.scale) not in shared:
        shared[setting.precision, setting.scale] = _functional(scene, setting)
    gaussians, spectral = shared[cast]
    d_colour, d_depth = shared[setting.precision, setting.scale]
    return Prepared(scene, setting, gaussians, spectral, scaled(scene.camera, setting.scale), d_colour, d_depth)


def _functional(scene: StudyScene, setting: Setting) -> tuple[FloatArray, FloatArray]:
    """The weights of the functional for pictures of the setting's size."""
    camera, (d_colour, d_depth) = scaled(scene.camera, setting.scale), _weights(scene)
    if setting.scale != 1:
        rows, columns = upsampling(camera.height, scene.camera.height), upsampling(camera.width, scene.camera.width)
        d_colour, d_depth = rows.T @ d_colour @ columns, rows.T @ d_depth @ columns
    return np.ascontiguousarray(d_colour, setting.precision), np.ascontiguousarray(d_depth, setting.precision)


def _weights(scene: StudyScene) -> tuple[FloatArray, FloatArray]:
    """Standard normal weights, divided by the number of values; for depth also by the distance of the scene."""
    rng = np.random.default_rng(WEIGHT_SEED)
    height, width = scene.camera.height, scene.camera.width
    count = 3 * height * width
    seen = scene.camera.rotation[2] @ scene.gaussians.position + scene.camera.translation[2]
    distance = max(float(np.median(np.abs(seen))), 1e-12)
    return rng.normal(size=(3, height, width)) / count, rng.normal(size=(height, width)) / (count * distance)


def _reduced(scene: StudyScene, setting: Setting) -> tuple[Gaussians, Any]:
    """The Gaussians with the strongest `bases` of the FDM and the lowest `frequencies`, the same for all."""
    g, spectral = scene.gaussians, scene.spectral
    if setting.bases is not None and g.fdm_weight is not None:
        strength = np.abs(g.fdm_weight).sum(axis=(0, 2), dtype=np.float64)
        kept = np.sort(np.argsort(-strength, kind="stable")[: setting.bases])
        names = ("fdm_weight", "fdm_centre", "fdm_width")
        g = g._replace(**{n: np.ascontiguousarray(getattr(g, n)[:, kept]) if setting.bases else None for n in names})
    if setting.frequencies is not None and scene.frequencies:
        low = np.arange(setting.frequencies)
        atoms = np.concatenate([low, low + scene.frequencies])
        for name in ("appearance_coefficients", "motion_coefficients"):
            array = getattr(g, name)
            if array is not None:
                g = g._replace(**{name: np.ascontiguousarray(array[:, atoms]) if setting.frequencies else None})
        statistics = type(spectral.statistics)(*(values[atoms] for values in spectral.statistics))
        spectral = Spectral(spectral.omega[low], statistics, spectral.rho[low])
    return g, spectral


def upsampling(small: int, large: int) -> FloatArray:
    """Matrix (large, small) of the linear interpolation between pixel centres, with repeated borders."""
    at = np.clip((np.arange(large) + 0.5) * small / large - 0.5, 0, small - 1)
    left = np.minimum(at.astype(int), max(small - 2, 0))
    out = np.zeros((large, small))
    out[np.arange(large), left] = 1 - (at - left)
    if small > 1:
        out[np.arange(large), left + 1] = at - left
    return out


def forward(prepared: Prepared) -> tuple[RenderOut, RenderSaved, SceneSaved]:
    """Deform the scene and render it."""
    p, setting = prepared, prepared.setting
    scene, scene_saved = scene_at(p.gaussians, p.spectral, p.scene.model, p.scene.time)
    out, saved = render_forward(scene, p.camera, setting.raster, degree=setting.degree, compositor=setting.compositor)
    return out, saved, scene_saved


def reverse(prepared: Prepared, saved: RenderSaved, scene_saved: SceneSaved) -> RenderGrads:
    """The reverse pass to the parameters, without the FDM's, which is part of the optimiser step."""
    grads = render_reverse(prepared.d_colour, prepared.d_depth, None, saved)
    scene_reverse(grads, scene_saved)
    return grads


def frame(prepared: Prepared) -> tuple[RenderedFrame, int]:
    """The frame in float64 at full resolution, and its visits."""
    with prepared.setting.kernels(), threads(prepared.setting.threads):
        out, saved, scene_saved = forward(prepared)
        visits = count_pairs(saved).visited
        grads = reverse(prepared, saved, scene_saved)
    colour = out.colour.astype(np.float64)
    full, small = prepared.scene.camera, prepared.camera
    if small.height != full.height or small.width != full.width:
        colour = upsampling(small.height, full.height) @ colour @ upsampling(small.width, full.width).T
    found = {name: getattr(grads, f"d_{name}") for name in BLOCKS}
    return RenderedFrame(colour, {name: a.astype(np.float64) for name, a in found.items() if a is not None}), visits


def errors(found: RenderedFrame, reference: RenderedFrame) -> RenderErrors:
    """Largest and root mean square error of the colour; relative L2 error of every gradient block of the reference.

    Edges: a block with zero reference gradient is left out; a block missing from `found` counts as zeros.
    """
    difference = found.colour - reference.colour
    gradients = {}
    for name, exact in reference.gradients.items():
        size = float(np.linalg.norm(exact))
        if size > 0:
            got = found.gradients.get(name, np.zeros_like(exact))
            gradients[name] = float(np.linalg.norm(got - exact)) / size
    return RenderErrors(float(np.abs(difference).max()), float(np.sqrt(np.mean(difference**2))), gradients)


def terms(prepared: Prepared) -> int:
    """Basis terms evaluated per frame: per Gaussian 10 B of the FDM, and 2F per channel of the Fourier residuals."""
    g = prepared.gaussians
    present = (g.fdm_weight, g.appearance_coefficients, g.motion_coefficients)
    return sum(a.size for a in present if a is not None)


def seconds(prepared: Prepared) -> tuple[float, float]:
    """Seconds of one frame: (forward, forward + reverse)."""
    with prepared.setting.kernels(), threads(prepared.setting.threads):
        began = time.perf_counter()
        _, saved, scene_saved = forward(prepared)
        middle = time.perf_counter()
        reverse(prepared, saved, scene_saved)
        return middle - began, time.perf_counter() - began


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Set the number of kernel threads for the block (None = unchanged)."""
    before = numba.get_num_threads()
    if count is not None:
        use_threads(count)
    try:
        yield
    finally:
        numba.set_num_threads(before)
