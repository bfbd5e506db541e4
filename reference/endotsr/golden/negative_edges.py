"""Wrong ports of rules at the edge of their range: what the cases of `cases_edges` are for."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.negative import Negative, Request, Wrong, setting
from endotsr.splatting.covariance import covariance_forward
from endotsr.splatting.harmonics import harmonics_forward
from endotsr.splatting.projection import projection_forward
from endotsr.stages.requests import camera_of, raster_of

# ---- losses and stages ----


def _multiplied(one: str, other: str, loss: str) -> Wrong:
    """Difference times mask in place of a selection: 0 times a number that is not finite is none."""

    def wrong(request: Request) -> dict[str, Any] | None:
        total = ((request.inputs[one] - request.inputs[other]) * request.inputs["mask"]).sum()
        return None if np.isfinite(total) else {loss: total}

    return wrong


def _infinite_prior(request: Request) -> dict[str, Any] | None:
    if not np.isinf(request.inputs["prior_depth"]).any():
        return None
    return {"loss": np.nan, "d_rendered_depth": request.right["d_rendered_depth"] * np.nan}


def _priors(request: Request) -> int:
    prior = request.inputs["prior_depth"]
    return int((request.inputs["mask"] & np.isfinite(prior) & (prior > 0)).sum())


def _ten_ignored(request: Request) -> dict[str, Any] | None:
    return {name: 0 * a for name, a in request.right.items()} if _priors(request) == 10 else None


def _over_zero(request: Request) -> dict[str, Any] | None:
    if request.inputs["rendered_depth"].any():
        return None
    return {name: a * np.nan for name, a in request.right.items()}


def _repeated(request: Request) -> dict[str, Any]:
    """Statistics over the list of stamps in place of the set."""
    times = request.inputs["times"][request.inputs["train_index"]]
    phase = 2 * np.pi * np.outer(times, request.inputs["omega"])
    rows = np.concatenate([np.sin(phase), np.cos(phase)], axis=1)
    rms = np.where(request.right["dead"], 0.0, rows.std(axis=0))
    gain = np.where(rms > 0, 1 / np.where(rms > 0, rms, 1.0), 0.0)
    mean = rows.mean(axis=0)
    return {"mean": mean, "rms": rms, "phi_bar": (request.inputs["phi"] - mean) * gain,
            "d_phi": request.inputs["d_phi_bar"] * gain}  # fmt: skip


def _not_clipped(request: Request) -> dict[str, Any]:
    scale = np.exp(request.inputs["log_scale"])
    return {"scale": scale, "d_log_scale": request.inputs["d_scale"] * scale}


def _nowhere(request: Request) -> dict[str, Any] | None:
    """The direction 0 / 0."""
    at = (request.inputs["position"] == request.inputs["centre"][:, None]).all(axis=0)
    if not at.any() or request.settings["degree"] == 0:
        return None
    names = ("colour", "d_position")
    return {name: np.where(at, np.nan, request.right[name]) for name in names}


def _zero_over_zero(request: Request) -> dict[str, Any] | None:
    """An update m / sqrt(v) without epsilon."""
    nothing = request.right["second"] == 0
    return {"parameter_after": np.where(nothing, np.nan, request.right["parameter_after"])} if nothing.any() else None


# ---- density control ----


def _width_for_height(request: Request) -> dict[str, Any] | None:
    s, visible = request.settings, request.inputs["visible"]
    if s["width"] == s["height"]:
        return None
    norm = s["width"] / 2 * np.sqrt((request.inputs["d_mean2d"] ** 2).sum(axis=1))
    return {"mean_gradient": (norm * visible).sum(axis=0) / np.maximum(visible.sum(axis=0), 1)}


def _nudged(name: str, factor: float) -> Wrong:
    """A threshold moved by so little that only what stands on it changes sides."""
    return setting(**{f"density__{name}": lambda v: v * factor})


# ---- compositing ----


class _Screen(NamedTuple):
    """Visible Gaussians on the screen, in one precision."""

    mean2d: NDArray
    covariance2d: NDArray
    determinant: NDArray
    depth: NDArray
    opacity: NDArray
    colour: NDArray
    background: NDArray
    width: int
    height: int


def _distance(screen: _Screen, n: int, dx: NDArray, dy: NDArray) -> NDArray:
    (_, b, c), det = screen.covariance2d[:, n], screen.determinant[n]
    return dy * dy / c + c / det * (dx - b / c * dy) ** 2


def _inverse_matrix(screen: _Screen, n: int, dx: NDArray, dy: NDArray) -> NDArray:
    (a, b, c), det = screen.covariance2d[:, n], screen.determinant[n]
    return (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / det


def _images(screen: _Screen, raster, distance=_distance, reach=None) -> dict[str, NDArray]:
    """Front to back, all pixels of one Gaussian at a time."""
    kind = screen.mean2d.dtype.type
    x, y = np.arange(screen.width, dtype=kind) + kind(0.5), np.arange(screen.height, dtype=kind)[:, None] + kind(0.5)
    left, live = np.ones((screen.height, screen.width), kind), np.ones((screen.height, screen.width), bool)
    colour, depth, opacity = np.zeros((3, *left.shape), kind), 0 * left, 0 * left
    for n in np.argsort(screen.depth, kind="stable"):
        q = distance(screen, n, x - screen.mean2d[0, n], y - screen.mean2d[1, n])
        alpha = np.minimum(screen.opacity[n] * np.exp(-q / 2), kind(raster.alpha_max))
        drawn = live & (alpha >= raster.alpha_cutoff) & (True if reach is None else reach(screen, n))
        live &= ~(drawn & (left * (1 - alpha) < raster.transmittance_stop))
        weight = np.where(drawn & live, alpha * left, kind(0))
        colour, depth = colour + weight * screen.colour[:, n, None, None], depth + weight * screen.depth[n]
        opacity, left = opacity + weight, left - weight
    colour = colour + left * screen.background[:, None, None]
    return {"colour_image": colour, "depth_image": depth, "opacity_image": opacity}


def _opacity(logit: NDArray) -> NDArray:
    return 1 / (1 + np.exp(-logit))


def _needle(textbook_determinant: bool) -> Wrong:
    """Composites in float32 and loses digits; its inputs are rounded, so that all machines lose the same."""

    def wrong(request: Request) -> dict[str, NDArray] | None:
        raster, i = raster_of(request.settings), request.inputs
        if raster.support != "ellipse" or not i["position"].size:
            return None
        camera, degree = camera_of(i, request.settings), request.settings["degree"]
        shape = covariance_forward(i["quaternion"], i["log_scale"])[0]
        projected = projection_forward(i["position"], shape, camera, raster)[0]
        centre = -(i["rotation_matrix"].T @ i["translation"])
        colour = harmonics_forward(i["harmonics"], i["residual"], i["position"], centre, degree)[0]
        rounded = (projected.mean2d, projected.covariance2d, projected.determinant, projected.depth,
                   _opacity(i["opacity_logit"]), colour)  # fmt: skip
        arrays = [array[..., projected.visible].astype(np.float32) for array in rounded]
        if textbook_determinant:
            a, b, c = arrays[1]
            arrays[2] = a * c - b * b
        mean, cover, det, depth, opacity, colour = arrays
        background = i["background"].astype(np.float32)
        screen = _Screen(mean, cover, det, depth, opacity, colour, background, camera.width, camera.height)
        return _images(screen, raster, _distance if textbook_determinant else _inverse_matrix)

    return wrong


def _tiles(half: float = 0.5, floor: float = 0.1) -> Wrong:
    """Another end of the tiles in support `three_sigma_tiles`; the images only."""

    def reach(screen: _Screen, n: int) -> NDArray:
        (a, _, c), det = screen.covariance2d[:, n], screen.determinant[n]
        mean = (a + c) / 2
        radius = np.ceil(3 * np.sqrt(mean + np.sqrt(max(floor, mean * mean - det))))
        inside = []
        for centre, pixels in zip(screen.mean2d[:, n] - half, (screen.width, screen.height)):
            tile = np.arange(pixels) // 16
            inside.append((tile >= int((centre - radius) / 16)) & (tile < int((centre + radius + 15) / 16)))
        return inside[1][:, None] & inside[0]

    def wrong(request: Request) -> dict[str, NDArray] | None:
        raster, i = raster_of(request.settings), request.inputs
        if raster.support != "three_sigma_tiles":
            return None
        a, b, c = i["covariance2d"]
        size = request.settings["width"], request.settings["height"]
        opacity = _opacity(i["opacity_logit"])
        screen = _Screen(
            i["mean2d"], i["covariance2d"], a * c - b * b, i["depth"], opacity, i["colour"], i["background"], *size
        )
        return _images(screen, raster, reach=reach)

    return wrong


def _skips(request: Request) -> dict[str, NDArray] | None:
    """Leaves out the Gaussian that would stop the pixel and goes on; flat images only."""
    raster, i = request.settings["raster"], request.inputs
    if i["covariance2d"].min(axis=1)[0] < 1e5:
        return None
    alpha, left, logit = np.minimum(_opacity(i["opacity_logit"]), raster["alpha_max"]), 1.0, i["opacity_logit"].copy()
    for n in np.argsort(i["depth"], kind="stable"):
        if alpha[n] < raster["alpha_cutoff"] or left * (1 - alpha[n]) < raster["transmittance_stop"]:
            logit[n] = -40.0
        else:
            left *= 1 - alpha[n]
    return request.run(dict(i) | {"opacity_logit": logit}, request.settings)


def _blocked(request: Request) -> Any:
    """The exact derivative of the clamp where the released code passes the gradient."""
    if not request.settings["raster"]["deviations"]["pass_clamped_alpha"]:
        return None
    return setting(raster__deviations__pass_clamped_alpha=False)(request)


def _in_front(request: Request) -> dict[str, NDArray] | None:
    if "visible" not in request.right:
        return None
    i = request.inputs
    z = (i["rotation_matrix"] @ i["position"] + i["translation"][:, None])[2]
    return {"visible": z > request.settings["raster"]["near"]}


NEGATIVES = [
    Negative("mask_multiplied", "Mask multiplied, not selected", "0 times NaN; right: excluded values are not read",
             {"masked_l1": _multiplied("rendered", "observed", "loss"),
              "masked_ssim": _multiplied("rendered", "observed", "ssim"),
              "laplacian": _multiplied("rendered", "observed", "loss"),
              "normalised_depth": _multiplied("rendered_depth", "prior_depth", "loss")}),
    Negative("infinite_prior_counts", "Infinite prior taken as a depth", "D > 0; right: D > 0 and finite",
             {"normalised_depth": _infinite_prior}),
    Negative("ten_priors_ignored", "Depth loss of ten pixels left out", "n <= 10; right: n < 10",
             {"normalised_depth": _ten_ignored}),
    Negative("depth_over_zero", "Division by a largest depth of 0", "not a number; right: 0",
             {"normalised_depth": _over_zero}),
    Negative("repeated_stamps_counted", "Repeated stamps counted more than once", "list; right: set of stamps",
             {"atoms": _repeated}),
    Negative("log_scale_not_clipped", "Log-scale not clipped", "exp(s); right: s within +-40, gradient 0 beyond",
             {"covariance": _not_clipped}),
    Negative("direction_of_nothing", "Direction to a Gaussian at the optical centre", "0 / 0; right: first band only",
             {"harmonics": _nowhere}),
    Negative("adam_zero_over_zero", "Step of a zero gradient", "0 / 0; right: 0 over epsilon",
             {"adam": _zero_over_zero}),
    Negative("density_width_for_height", "Screen gradient scaled by W / 2 on both axes", "W; right: W of x, H of y",
             {"density": _width_for_height}),
    Negative("prune_at_the_threshold", "Pruned on the threshold", "<=; right: <", 
             {"density": _nudged("prune_opacity", 1 + 1e-9)}),
    Negative("split_at_the_limit", "Split on the size limit", ">=; right: >",
             {"density": _nudged("dense_fraction", 1 - 1e-9)}),
    Negative("stop_skips", "The Gaussian that stops a pixel skipped", "goes on behind it; right: the pixel ends",
             {"composite": _skips}),
    Negative("clamp_blocks_legacy", "Clamp of alpha blocks the gradient in preset legacy", "0; right: passed",
             {"composite": _blocked, "render": _blocked, "objective": _blocked}),
    Negative("tiles_from_the_mean", "Tiles counted from the mean", "u; right: u - 1/2",
             {"composite": _tiles(half=0.0)}),
    Negative("tiles_root_without_floor", "Radius of the tiles without its floor",
             "max(0, .); right: max(0.1, .)", {"composite": _tiles(floor=0.0)}),
    Negative("determinant_cancels", "Determinant as a c - b^2", "in float32; right: sum of non-negative terms",
             {"render": _needle(textbook_determinant=True)}),
    Negative("distance_cancels", "Distance by the inverse matrix", "in float32; right: a sum of two squares",
             {"render": _needle(textbook_determinant=False)}),
    Negative("visible_if_in_front", "All in front of the camera counted as visible", "z > near; right: with its box",
             {"render": _in_front}),
]  # fmt: skip
