"""Pairs of the rasteriser: each stage alone, then the whole render under every preset and both paths."""

import numpy as np
from numpy.typing import NDArray

from endotsr.gradcheck.registry import Arrays, Pair
from endotsr.splatting.binning import depth_order, screen_boxes, tile_lists
from endotsr.splatting.camera import Camera
from endotsr.splatting.compositing import TILE_HEIGHT, TILE_WIDTH, composite_forward, composite_reverse
from endotsr.splatting.covariance import Shape, covariance_forward, covariance_reverse
from endotsr.splatting.fast.blocks import TILE_HEIGHT as FAST_TILE_HEIGHT
from endotsr.splatting.fast.blocks import TILE_WIDTH as FAST_TILE_WIDTH
from endotsr.splatting.fast.blocks import BlocksSaved, composite_blocks_forward, composite_blocks_reverse
from endotsr.splatting.harmonics import harmonics_forward, harmonics_reverse
from endotsr.splatting.projection import Projected, projection_forward, projection_reverse
from endotsr.splatting.records import (
    INVERSE_C,
    OPACITY,
    PRECISION,
    SLOPE,
    U,
    V,
    gather_gradients,
    log_opacity,
    pack_records,
)
from endotsr.splatting.render import Compositor, RenderSaved, Scene, render_forward, render_reverse
from endotsr.splatting.settings import EXACT, PAPER, RasterSettings

WIDTH, HEIGHT = 21, 17
COUNT = 8
# Every visible Gaussian of `_scene` stays above this alpha at every pixel, or below it at every pixel: no ring
# of the cutoff crosses the image, so differences see the smooth part. The ring itself is pinned in tests/splatting.
WIDE = PAPER._replace(alpha_cutoff=1e-4)


def _camera(inputs: Arrays | None = None) -> Camera:
    """Rotated, shifted, principal point off centre; pose from the inputs when they carry one."""
    angle = np.array([0.2, -0.15, 0.1])
    c, s = np.cos(angle), np.sin(angle)
    x = np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    y = np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    z = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
    rotation, translation = z @ y @ x, np.array([0.1, -0.2, 0.3])
    if inputs is not None and "rotation_matrix" in inputs:
        rotation, translation = inputs["rotation_matrix"], inputs["translation"]
    return Camera(rotation, translation, 19.0, 23.0, 9.5, 9.0, WIDTH, HEIGHT)


def _positions(rng: np.random.Generator, count: int = COUNT) -> NDArray:
    """In front of the camera at well separated depths, in an order that is not the depth order."""
    camera = _camera()
    z = 3.0 + 0.35 * rng.permutation(count) + rng.uniform(-0.05, 0.05, count)
    seen = np.stack([rng.uniform(-0.3, 0.3, count) * z, rng.uniform(-0.3, 0.3, count) * z, z])
    return camera.rotation.T @ (seen - camera.translation[:, None])


def _scene(rng: np.random.Generator) -> dict[str, NDArray]:
    """Wide overlapping Gaussians; index 0 stands behind the camera, index 1 is fainter than any cutoff."""
    position = _positions(rng)
    position[:, 0] -= _camera().rotation.T @ np.array([0.0, 0.0, 20.0])
    logit = rng.uniform(-1.5, 1.5, COUNT)
    logit[1] = -12.0
    return {
        "position": position,
        "quaternion": rng.normal(0, 1, (4, COUNT)) + np.array([[1.5], [0], [0], [0]]),
        "log_scale": rng.uniform(0.25, 0.7, (3, COUNT)),
        "opacity_logit": logit,
        "harmonics": rng.uniform(-0.25, 0.25, (16, 3, COUNT)) + 0.4 * (np.arange(16) == 0)[:, None, None],
        "residual": rng.uniform(-0.2, 0.2, (3, COUNT)),
    }


# --- covariance (B2) ---


def _covariance_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    return {"quaternion": rng.normal(0, 1, (4, COUNT)) * 3.0, "log_scale": rng.normal(0, 0.7, (3, COUNT))}


def _covariance_forward(inputs: Arrays) -> dict[str, NDArray]:
    return covariance_forward(inputs["quaternion"], inputs["log_scale"])[0]._asdict()


def _covariance_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    _, saved = covariance_forward(inputs["quaternion"], inputs["log_scale"])
    return covariance_reverse(Shape(**cotangents), saved)._asdict()


# --- projection (B3) ---


def _projection_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Includes centres beyond the off-axis limit on all four sides and one behind the camera."""
    position = _positions(rng, 12)
    shape, _ = covariance_forward(rng.normal(0, 1, (4, 12)), rng.normal(-0.5, 0.4, (3, 12)))
    camera = _camera()
    for k, (x, y) in enumerate([(2.5, 0.1), (-2.5, 0.1), (0.1, 2.5), (0.1, -2.5), (2.5, 2.5)]):
        position[:, k] = camera.rotation.T @ (np.array([3.0 * x, 3.0 * y, 3.0]) - camera.translation)
    position[:, 5] = camera.rotation.T @ (np.array([0.1, 0.1, -3.0]) - camera.translation)
    return {
        "position": position,
        "rotation": shape.rotation,
        "scale": shape.scale,
        "rotation_matrix": camera.rotation,
        "translation": camera.translation,
    }


def _projection_pair(name: str, settings: RasterSettings) -> Pair:
    def run(inputs: Arrays):
        shape = Shape(inputs["rotation"], inputs["scale"])
        return projection_forward(inputs["position"], shape, _camera(inputs), settings)

    def forward(inputs: Arrays) -> dict[str, NDArray]:
        out, _ = run(inputs)
        return {"mean2d": out.mean2d, "covariance2d": out.covariance2d, "depth": out.depth}

    def reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
        _, saved = run(inputs)
        grads = projection_reverse(
            cotangents["mean2d"], cotangents["covariance2d"], cotangents["depth"], saved, pose_gradient=True
        )
        assert grads.camera is not None
        return {
            "position": grads.position,
            "rotation": grads.rotation,
            "scale": grads.scale,
            "rotation_matrix": grads.camera.rotation,
            "translation": grads.camera.translation,
        }

    def blocks(inputs: Arrays) -> dict[str, tuple[str, object]]:
        axes: dict[str, tuple[str, object]] = {
            f"position {axis}": ("position", (k, slice(None))) for k, axis in enumerate("xyz")
        }
        return axes | {key: (key, ...) for key in inputs if key != "position"}

    function = "endotsr.splatting.projection.projection_forward"
    return Pair(name, "B3", function, _projection_inputs, forward, reverse, _as_masks(blocks))


def _as_masks(blocks):
    """Boolean masks from index expressions."""

    def made(inputs: Arrays) -> dict[str, tuple[str, object]]:
        out: dict[str, tuple[str, object]] = {}
        for name, (key, index) in blocks(inputs).items():
            mask = np.zeros(inputs[key].shape, bool)
            mask[index] = True
            out[name] = (key, mask)
        return out

    return made


# --- harmonics (B4) ---


def _harmonics_pair(degree: int) -> Pair:
    bands = (degree + 1) ** 2

    def inputs(rng: np.random.Generator) -> dict[str, NDArray]:
        """Colours on both sides of the clamp at zero, none near it."""
        made = {
            "harmonics": rng.uniform(-0.2, 0.2, (bands, 3, COUNT)) / bands,
            "residual": rng.uniform(-0.1, 0.1, (3, COUNT)),
            "position": rng.normal(0, 1, (3, COUNT)) + np.array([[0.0], [0.0], [4.0]]),
            "centre": rng.normal(0, 0.3, 3),
        }
        made["harmonics"][0, :, ::3] = -4.0  # clamped
        return made

    def run(inputs: Arrays):
        return harmonics_forward(inputs["harmonics"], inputs["residual"], inputs["position"], inputs["centre"], degree)

    def reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
        grads = harmonics_reverse(cotangents["colour"], run(inputs)[1])._asdict()
        return {key: grads[key] for key in inputs}

    def only_used(rng: np.random.Generator) -> dict[str, NDArray]:
        made = inputs(rng)
        return made if degree > 0 else {key: made[key] for key in ("harmonics", "residual")}

    def run_degree_0(inputs: Arrays):
        still = np.zeros((3, COUNT), inputs["harmonics"].dtype)
        return harmonics_forward(inputs["harmonics"], inputs["residual"], still, still[:, 0], 0)

    run = run if degree > 0 else run_degree_0

    def blocks(inputs: Arrays) -> dict[str, tuple[str, object]]:
        out: dict[str, tuple[str, object]] = {
            f"degree {d}": ("harmonics", slice(d * d, (d + 1) ** 2)) for d in range(degree + 1)
        }
        return out | {key: (key, ...) for key in inputs if key != "harmonics"}

    return Pair(
        f"harmonics_degree_{degree}",
        "B4",
        "endotsr.splatting.harmonics.harmonics_forward",
        only_used,
        lambda inputs: {"colour": run(inputs)[0]},
        reverse,
        _as_masks(blocks),
        lambda inputs: {"clamped": run(inputs)[1].clamped.astype(int)},
    )


# --- compositing (B5) ---


def _composite_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Screen Gaussians wide enough to cover the image; one nearly opaque (beyond the alpha clamp at its centre)."""
    n = COUNT
    a, c = rng.uniform(60, 150, n), rng.uniform(60, 150, n)
    logit = rng.uniform(-2.0, 1.0, n)
    logit[2] = 6.5
    return {
        "mean2d": np.stack([rng.uniform(0, WIDTH, n), rng.uniform(0, HEIGHT, n)]),
        "covariance2d": np.stack([a, rng.uniform(-0.6, 0.6, n) * np.sqrt(a * c), c]),
        "opacity_logit": logit,
        "colour": rng.uniform(0.1, 1.0, (3, n)),
        "depth": 3.0 + 0.4 * rng.permutation(n) + rng.uniform(-0.05, 0.05, n),
        "background": rng.uniform(0.1, 0.9, 3),
    }


def _composite_pair(name: str, settings: RasterSettings, fast: bool) -> Pair:
    tile = (FAST_TILE_WIDTH, FAST_TILE_HEIGHT) if fast else (TILE_WIDTH, TILE_HEIGHT)

    def run(inputs: Arrays):
        a, b, c = inputs["covariance2d"]
        n = a.size
        projected = Projected(
            inputs["mean2d"], inputs["covariance2d"], a * c - b * b, inputs["depth"], np.ones(n, bool)
        )
        log_alpha = log_opacity(inputs["opacity_logit"])
        box, visible = screen_boxes(projected, log_alpha, settings, WIDTH, HEIGHT)
        order = depth_order(inputs["depth"], visible)
        records = pack_records(order, projected, log_alpha, inputs["colour"])
        lists = tile_lists(box, order, *tile, WIDTH, HEIGHT)
        composite = composite_blocks_forward if fast else composite_forward
        out, saved = composite(records, lists, settings, inputs["background"], WIDTH, HEIGHT)
        return out, saved, projected, order

    def forward(inputs: Arrays) -> dict[str, NDArray]:
        out = run(inputs)[0]
        return {"colour_image": out.colour, "depth_image": out.depth, "opacity_image": out.opacity}

    def reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
        out, saved, projected, order = run(inputs)
        images = (cotangents["colour_image"], cotangents["depth_image"], cotangents["opacity_image"])
        pairs = (composite_blocks_reverse if isinstance(saved, BlocksSaved) else composite_reverse)(*images, saved)  # pyright: ignore[reportArgumentType]
        grads = gather_gradients(
            order, saved.records, saved.lists, pairs, projected.determinant, inputs["opacity_logit"],
            conic_epsilon=0.0, keep_depth=True,
        )  # fmt: skip
        names = ("mean2d", "covariance2d", "opacity_logit", "colour", "depth")
        background = np.einsum("chw,hw->c", images[0], out.transmittance)
        return dict(zip(names, grads)) | {"background": background}

    def trace(inputs: Arrays) -> dict[str, NDArray]:
        saved, order = run(inputs)[1], run(inputs)[3]
        return {"order": order, **_decisions(saved.records, settings)}

    module = "compositing_blocks.composite_blocks_forward" if fast else "compositing.composite_forward"
    return Pair(name, "B5", f"endotsr.splatting.{module}", _composite_inputs, forward, reverse, None, trace)


def _decisions(records: NDArray, settings: RasterSettings) -> dict[str, NDArray]:
    """Which pairs contribute and which are clamped, (n, H, W), nearest first; plain NumPy."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    transmittance, live = np.ones((HEIGHT, WIDTH)), np.ones((HEIGHT, WIDTH), bool)
    contributes, clamped = [], []
    for record in records:
        dy = y - record[V]
        e = x - record[U] - record[SLOPE] * dy
        value = record[OPACITY] * np.exp(-0.5 * (record[INVERSE_C] * dy * dy + record[PRECISION] * e * e))
        alpha = np.minimum(value, settings.alpha_max)
        wanted = live & (alpha >= settings.alpha_cutoff)
        behind = np.where(wanted, transmittance * (1 - alpha), transmittance)
        live &= ~(wanted & (behind < settings.transmittance_stop))
        taken = wanted & live
        transmittance = np.where(taken, behind, transmittance)
        contributes.append(taken)
        clamped.append(value > settings.alpha_max)
    return {"contributes": np.array(contributes, int), "clamped": np.array(clamped, int)}


# --- the whole render ---


def _render_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    camera = _camera()
    background = rng.uniform(0.1, 0.9, 3)
    pose = {"rotation_matrix": camera.rotation, "translation": camera.translation}
    return _scene(rng) | {"background": background} | pose


def _render_pair(name: str, settings: RasterSettings, compositor: Compositor) -> Pair:
    def run(inputs: Arrays):
        scene = Scene(*(inputs[field] for field in Scene._fields))
        return render_forward(scene, _camera(inputs), settings, background=inputs["background"], compositor=compositor)

    def forward(inputs: Arrays) -> dict[str, NDArray]:
        out = run(inputs)[0]
        return {"colour_image": out.colour, "depth_image": out.depth, "opacity_image": out.opacity}

    def reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
        saved = run(inputs)[1]
        images = (cotangents["colour_image"], cotangents["depth_image"], cotangents["opacity_image"])
        grads = render_reverse(*images, saved, background_gradient=True, pose_gradient=True)
        assert grads.camera is not None and grads.background is not None
        out = {field: getattr(grads, field) for field in (*Scene._fields, "background")}
        return out | {"rotation_matrix": grads.camera.rotation, "translation": grads.camera.translation}

    def trace(inputs: Arrays) -> dict[str, NDArray]:
        return _render_trace(run(inputs)[1])

    function = "endotsr.splatting.render.render_forward"
    return Pair(name, "B5", function, _render_inputs, forward, reverse, _as_masks(_render_blocks), trace)


def _render_trace(saved: RenderSaved) -> dict[str, NDArray]:
    decisions = _decisions(saved.composite.records, saved.settings)
    return {"order": saved.order, "dark": saved.harmonics.clamped.astype(int), **decisions}


def _render_blocks(inputs: Arrays) -> dict[str, tuple[str, object]]:
    out: dict[str, tuple[str, object]] = {
        f"position {axis}": ("position", (k, slice(None))) for k, axis in enumerate("xyz")
    }
    out |= {f"harmonics degree {d}": ("harmonics", slice(d * d, (d + 1) ** 2)) for d in range(4)}
    return out | {key: (key, ...) for key in inputs if key not in ("position", "harmonics")}


PAIRS: list[Pair] = [
    Pair(
        "covariance",
        "B2",
        "endotsr.splatting.covariance.covariance_forward",
        _covariance_inputs,
        _covariance_forward,
        _covariance_reverse,
    ),
    _projection_pair("projection_exact", EXACT),
    _projection_pair("projection_paper", PAPER),
    *(_harmonics_pair(degree) for degree in range(4)),
    _composite_pair("composite_exact", EXACT, fast=False),
    _composite_pair("composite_paper", WIDE, fast=False),
    _composite_pair("composite_blocks", WIDE, fast=True),
    _render_pair("render_exact", EXACT, "definition"),
    _render_pair("render_paper", WIDE, "definition"),
    _render_pair("render_blocks", WIDE, "blocks"),
]
