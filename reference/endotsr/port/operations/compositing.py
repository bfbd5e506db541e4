"""Image operations: compositing of screen Gaussians (B5), and the whole render (B2) to (B5)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.splatting import compositing
from endotsr.method.splatting.binning import depth_order, screen_boxes, tile_lists
from endotsr.method.splatting.fast import blocks as compositing_blocks
from endotsr.method.splatting.projection import Projected
from endotsr.method.splatting.records import (
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
from endotsr.method.splatting.render import CONIC_EPSILON, RenderSaved, Scene, render_forward, render_reverse
from endotsr.method.splatting.settings import EXACT, RasterSettings
from endotsr.port.operations.made_up import AXES, COUNT, HEIGHT, LENS, WIDE, WIDTH, is_near, pose, raw_gaussians
from endotsr.port.operations.operation import Found, Inputs, Operation, Settings, Variant, split_blocks
from endotsr.port.operations.requests import camera_of, compositor_of, raster_dict, raster_of, scene_of

Random = np.random.Generator
IMAGES: tuple[str, ...] = ("colour_image", "depth_image", "opacity_image")


# ---- compositing (B5) ----


class CompositorSaved(NamedTuple):
    """Inputs of the reverse pass of a compositor and of the gather that follows it."""

    compositor: Any  # saved tuple of either compositor
    transmittance: NDArray  # (H, W)
    projected: Projected
    order: NDArray
    opacity_logit: NDArray
    raster: RasterSettings


def _composite(inputs: Inputs, settings: Settings) -> tuple[Found, CompositorSaved]:
    raster, (width, height) = raster_of(settings), (settings["width"], settings["height"])
    a, b, c = inputs["covariance2d"]
    seen = np.ones(a.size, bool)
    projected = Projected(inputs["mean2d"], inputs["covariance2d"], a * c - b * b, inputs["depth"], seen)
    log_alpha = log_opacity(inputs["opacity_logit"])
    box, visible = screen_boxes(projected, log_alpha, raster, width, height)
    order = depth_order(inputs["depth"], visible)
    records = pack_records(order, projected, log_alpha, inputs["colour"])
    blocks = compositor_of(settings) == "blocks"
    module = compositing_blocks if blocks else compositing
    lists = tile_lists(box, order, module.TILE_WIDTH, module.TILE_HEIGHT, width, height)
    forward = compositing_blocks.composite_blocks_forward if blocks else compositing.composite_forward
    out, saved = forward(records, lists, raster, inputs["background"], width, height)
    images = dict(zip(IMAGES, (out.colour, out.depth, out.opacity)))
    return images, CompositorSaved(saved, out.transmittance, projected, order, inputs["opacity_logit"], raster)


def _composite_reverse(cotangents: Inputs, saved: CompositorSaved) -> Found:
    colour, depth, opacity = (cotangents[name] for name in IMAGES)
    if isinstance(saved.compositor, compositing_blocks.BlocksSaved):
        pairs = compositing_blocks.composite_blocks_reverse(colour, depth, opacity, saved.compositor)
    else:
        pairs = compositing.composite_reverse(colour, depth, opacity, saved.compositor)
    deviations, (records, lists) = saved.raster.deviations, (saved.compositor.records, saved.compositor.lists)
    grads = gather_gradients(
        saved.order, records, lists, pairs, saved.projected.determinant, saved.opacity_logit,
        conic_epsilon=CONIC_EPSILON if deviations.conic_epsilon else 0.0,
        keep_depth=not deviations.drop_depth_to_z,
    )  # fmt: skip
    names = ("d_mean2d", "d_covariance2d", "d_opacity_logit", "d_colour", "d_depth")
    d_background = compositing.background_gradient(colour, saved.transmittance)
    return dict(zip(names, grads)) | {"d_background": d_background}


def _composite_trace(inputs: Inputs, settings: Settings, saved: CompositorSaved) -> dict[str, NDArray]:
    size = settings["width"], settings["height"]
    return {"order": saved.order, **decisions(saved.compositor.records, saved.raster, *size)}


def decisions(records: NDArray, raster: RasterSettings, width: int, height: int) -> dict[str, NDArray]:
    """Contributing pairs and clamped pairs, (n, H, W), nearest first; plain NumPy."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    transmittance, live = np.ones((height, width)), np.ones((height, width), bool)
    contributes, clamped = [], []
    for record in records:
        dy = y - record[V]
        eta = x - record[U] - record[SLOPE] * dy
        value = record[OPACITY] * np.exp(-0.5 * (record[INVERSE_C] * dy * dy + record[PRECISION] * eta * eta))
        alpha = np.minimum(value, raster.alpha_max)
        wanted = live & ~(alpha < raster.alpha_cutoff)
        behind = np.where(wanted, transmittance * (1 - alpha), transmittance)
        live &= ~(wanted & (behind < raster.transmittance_stop))
        taken = wanted & live
        transmittance = np.where(taken, behind, transmittance)
        contributes.append(taken)
        clamped.append(value > raster.alpha_max)
    return {"contributes": np.array(contributes, int), "clamped": np.array(clamped, int)}


def _composite_inputs(rng: Random) -> dict[str, NDArray]:
    """Screen Gaussians that cover the image; one is nearly opaque (beyond the alpha clamp at its centre)."""
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


# ---- the whole render ----


def _render(inputs: Inputs, settings: Settings) -> tuple[Found, RenderSaved]:
    out, saved = render_forward(
        scene_of(inputs), camera_of(inputs, settings), raster_of(settings),
        degree=settings["degree"], background=inputs["background"], compositor=compositor_of(settings),
    )  # fmt: skip
    return dict(zip(IMAGES, (out.colour, out.depth, out.opacity))), saved


def _render_reverse(cotangents: Inputs, saved: RenderSaved) -> Found:
    colour, depth, opacity = (cotangents[name] for name in IMAGES)
    grads = render_reverse(colour, depth, opacity, saved, background_gradient=True, pose_gradient=True)
    assert grads.d_camera is not None and grads.d_background is not None
    found = {f"d_{name}": getattr(grads, f"d_{name}") for name in (*Scene._fields, "mean2d", "background")}
    dtype, (d_rotation, d_translation) = saved.scene.position.dtype, grads.d_camera
    return found | {"d_rotation_matrix": d_rotation.astype(dtype), "d_translation": d_translation.astype(dtype)}


def _render_trace(inputs: Inputs, settings: Settings, saved: RenderSaved) -> dict[str, NDArray]:
    return render_decisions(saved)


def render_decisions(saved: RenderSaved) -> dict[str, NDArray]:
    """Order, colours clamped at zero, contributors and clamped alphas of a render."""
    found = decisions(saved.composite.records, saved.settings, saved.camera.width, saved.camera.height)
    return {"order": saved.order, "dark": saved.harmonics.clamped.astype(int), **found}


def _render_inputs(rng: Random) -> dict[str, NDArray]:
    background = rng.uniform(0.1, 0.9, 3)
    return raw_gaussians(rng) | {"background": background} | pose()


HARMONICS = {f"harmonics degree {d}": slice(d * d, (d + 1) ** 2) for d in range(4)}


def _variants(operation: str) -> tuple[Variant, ...]:
    """The definition with both presets, and the fast compositor if applicable."""
    made = []
    for name, raster in (("exact", EXACT), ("paper", WIDE), ("blocks", WIDE)):
        common = {"raster": raster_dict(raster), "_compositor": "blocks" if name == "blocks" else "definition"}
        covers = _blocks_answer if name == "blocks" else is_near(name)
        if operation == "composite":
            function = "endotsr.method.splatting.fast.blocks.composite_blocks_forward" if name == "blocks" else ""
            settings = common | {"width": WIDTH, "height": HEIGHT}
            made.append(Variant(f"composite_{name}", _composite_inputs, settings, covers=covers, function=function))
        else:
            blocks = split_blocks({"position": AXES, "harmonics": HARMONICS})
            settings = common | {"camera": LENS, "degree": 3}
            made.append(Variant(f"render_{name}", _render_inputs, settings, blocks=blocks, covers=covers))
    return tuple(made)


def _blocks_answer(settings: Settings) -> bool:
    return compositing_blocks.supports(raster_of(settings))


OPERATIONS = [
    Operation(
        name="composite",
        equation="B5",
        text="blend screen Gaussians",
        function="endotsr.method.splatting.compositing.composite_forward",
        forward=_composite,
        reverse=_composite_reverse,
        trace=_composite_trace,
        variants=_variants("composite"),
    ),
    Operation(
        name="render",
        equation="B5",
        text="one view of deformed Gaussians",
        function="endotsr.method.splatting.render.render_forward",
        forward=_render,
        reverse=_render_reverse,
        extra=lambda inputs, settings, saved: {"visible": saved.visible},
        trace=_render_trace,
        variants=_variants("render"),
    ),
]
