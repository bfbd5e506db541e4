"""Wrong ports of the rasteriser."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.negative import Negative, Request, Wrong, output, setting, swapped
from endotsr.kernels.constants import Y00

RASTER = ("projection", "composite", "render", "objective")


def _raster(operations: tuple[str, ...] = RASTER, **changes: Any) -> dict[str, Wrong]:
    wrong = setting(**{f"raster__{key}": value for key, value in changes.items()})
    return {operation: wrong for operation in operations}


def _camera(**changes: Any) -> Wrong:
    return setting(**{f"camera__{key}": value for key, value in changes.items()})


def _xyzw(inputs: dict[str, NDArray]) -> dict[str, NDArray]:
    return {"quaternion": np.ascontiguousarray(inputs["quaternion"][[3, 0, 1, 2]])}


def _raw_rotation(q: NDArray) -> NDArray:
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _without_norm(request: Request) -> dict[str, NDArray]:
    """Gradient by the unit quaternion handed on as that by the raw one."""
    norm = np.sqrt((request.inputs["quaternion"] ** 2).sum(axis=0))
    return {"d_quaternion": request.right["d_quaternion"] * norm}


def _zero_quaternion(*names: str) -> Wrong:
    def wrong(request: Request) -> dict[str, NDArray] | None:
        zero = ~request.inputs["quaternion"].any(axis=0)
        if not zero.any():
            return None
        found = {}
        for name in names:
            value = request.right[name].copy()
            if value.shape[-1] == zero.size and name.startswith(("rotation", "d_")):
                value[..., zero] = np.nan
            else:
                value[...] = np.nan
            found[name] = value
        return found

    return wrong


def _pose_inverted(request: Request) -> dict[str, NDArray]:
    rotation = request.inputs["rotation_matrix"]
    inputs = dict(request.inputs) | {"rotation_matrix": np.ascontiguousarray(rotation.T)}
    return request.run(inputs, request.settings)


def _clamped_jacobian(request: Request) -> dict[str, NDArray] | None:
    if request.settings["raster"]["jacobian_clamp"] > 0:
        return None
    return setting(raster__jacobian_clamp=1.3)(request)  # type: ignore[return-value]


def _switch(name: str, preset_off: bool = True) -> Wrong:
    """A deviation of the released code in a port of `paper`."""

    def wrong(request: Request) -> Any:
        if request.settings["raster"]["deviations"][name] == preset_off:
            return None
        return setting(**{f"raster__deviations__{name}": preset_off})(request)

    return wrong


def _without_deviations(request: Request) -> Any:
    off = {name: False for name in request.settings["raster"]["deviations"]}
    if request.settings["raster"]["deviations"] == off:
        return None
    return setting(raster__deviations=off)(request)


def _reordered(depth_of) -> Wrong:
    """Composites in another order: other depths, and the depth image of the right ones left out."""

    def wrong(request: Request) -> dict[str, NDArray]:
        inputs = dict(request.inputs)
        index = depth_of(inputs["depth"])
        order = np.argsort(index, kind="stable")
        names = ("mean2d", "covariance2d", "opacity_logit", "colour", "depth")
        moved = inputs | {name: np.ascontiguousarray(inputs[name][..., order]) for name in names}
        moved["depth"] = np.arange(1.0, order.size + 1.0).astype(inputs["depth"].dtype)
        found = request.run(moved, request.settings)
        found.pop("depth_image")
        back = np.argsort(order)
        return {
            name: np.ascontiguousarray(a[..., back]) if name.startswith("d_") and name != "d_background" else a
            for name, a in found.items()
        }

    return wrong


def _ties_reversed(request: Request) -> dict[str, NDArray] | None:
    """The last index of equal depths in front."""
    names = [n for n in ("mean2d", "covariance2d", "opacity_logit", "colour", "depth", "position", "quaternion",
                         "log_scale", "harmonics", "residual") if n in request.inputs]  # fmt: skip
    inputs = dict(request.inputs) | {n: np.ascontiguousarray(request.inputs[n][..., ::-1]) for n in names}
    found = request.run(inputs, request.settings)
    whole = ("d_background", "d_rotation_matrix", "d_translation")
    return {n: np.ascontiguousarray(a[..., ::-1]) if n.startswith(("d_", "visible")) and n not in whole else a
            for n, a in found.items()}  # fmt: skip


def _depth_over_opacity(request: Request) -> dict[str, NDArray]:
    opacity = request.right["opacity_image"]
    return {"depth_image": request.right["depth_image"] / np.where(opacity > 0, opacity, 1.0)}


def _no_background(request: Request) -> dict[str, NDArray]:
    left = 1 - request.right["opacity_image"]
    return {"colour_image": request.right["colour_image"] - left * request.inputs["background"][:, None, None]}


def _own_colour_only(request: Request) -> dict[str, NDArray]:
    """Gradient of alpha without what stands behind: as if the rest were black and empty."""
    count = request.inputs["opacity_logit"].size
    gradient = np.zeros(count)
    for i in range(count):
        names = ("mean2d", "covariance2d", "opacity_logit", "colour", "depth")
        inputs = dict(request.inputs)
        nearer = np.flatnonzero((inputs["depth"] < inputs["depth"][i]) | (np.arange(count) == i))
        inputs |= {n: np.ascontiguousarray(inputs[n][..., nearer]) for n in names}
        inputs["background"] = np.zeros_like(inputs["background"])
        found = request.run(inputs, request.settings)["d_opacity_logit"]
        gradient[i] = found[np.flatnonzero(nearer == i)[0]]
    return {"d_opacity_logit": gradient}


def _half_off_diagonal(request: Request) -> dict[str, NDArray]:
    if "d_covariance2d" not in request.right:
        return {}
    d = request.right["d_covariance2d"].copy()
    d[1] *= 0.5
    return {"d_covariance2d": d}


def _two_minds(request: Request) -> dict[str, NDArray]:
    """What stands on the cutoff is in the image, but gets no gradient."""
    image, gradient = (_raster(("composite",), alpha_cutoff=lambda v, s=s: v * s)["composite"](request)
                       for s in (1 - 1e-5, 1 + 1e-5))  # fmt: skip
    if image is None or gradient is None:
        return {}
    return {**image, **{name: a for name, a in gradient.items() if name.startswith("d_")}}


def _stop_after(request: Request) -> dict[str, NDArray]:
    """The Gaussian that brings T below the limit is still blended: flat images only."""
    if request.inputs["covariance2d"].min(axis=1)[0] < 1e5:
        return {}
    alpha = np.minimum(1 / (1 + np.exp(-request.inputs["opacity_logit"])), request.settings["raster"]["alpha_max"])
    stop, t, total, depth = request.settings["raster"]["transmittance_stop"], 1.0, 0.0, 0.0
    colour = np.zeros(3)
    for i in np.argsort(request.inputs["depth"], kind="stable"):
        if alpha[i] < request.settings["raster"]["alpha_cutoff"]:
            continue
        colour += alpha[i] * t * request.inputs["colour"][:, i]
        total, depth, t = total + alpha[i] * t, depth + alpha[i] * t * request.inputs["depth"][i], t * (1 - alpha[i])
        if t < stop:
            break
    plane = np.ones_like(request.right["depth_image"])
    colour = colour + t * request.inputs["background"]
    return {"colour_image": colour[:, None, None] * plane, "depth_image": depth * plane, "opacity_image": total * plane}


def _division(request: Request) -> dict[str, NDArray] | None:
    """The colour behind found by dividing by 1 - alpha."""
    alpha = 1 / (1 + np.exp(-request.inputs["opacity_logit"]))
    if alpha.max() < 1:
        return None
    return {"d_opacity_logit": request.right["d_opacity_logit"] * np.where(alpha == 1, np.nan, 1.0)}


def _harmonics(**changes) -> dict[str, Wrong]:
    return {"harmonics": output(**changes)}


def _unclamped(request: Request) -> dict[str, NDArray]:
    """No clamp at 0: the same with 8 added to the first coefficient, and the 8 taken out again."""
    lifted = request.inputs["harmonics"].copy()
    lifted[0] += 8.0
    found = request.run(dict(request.inputs) | {"harmonics": lifted}, request.settings)
    return found | {"colour": found["colour"] - 8.0 * Y00}


def _no_half(request: Request) -> dict[str, NDArray]:
    lowered = request.inputs["harmonics"].copy()
    lowered[0] -= 0.5 / Y00
    return request.run(dict(request.inputs) | {"harmonics": lowered}, request.settings)


def _bands(request: Request) -> dict[str, NDArray] | None:
    h = request.inputs["harmonics"]
    if h.shape[0] == 1:
        return None
    wrong = np.ascontiguousarray(h.reshape(3, h.shape[0], -1).transpose(1, 0, 2))
    return request.run(dict(request.inputs) | {"harmonics": wrong}, request.settings)


def _mirrored(request: Request) -> dict[str, NDArray] | None:
    h = request.inputs["harmonics"].copy()
    if h.shape[0] < 4:
        return None
    h[1] *= -1
    return {"colour": request.run(dict(request.inputs) | {"harmonics": h}, request.settings)["colour"]}


def _inverted_direction(request: Request) -> dict[str, NDArray] | None:
    if request.settings["degree"] == 0:
        return None
    swap = {"position": np.tile(request.inputs["centre"][:, None], request.inputs["position"].shape[1])}
    mirrored = 2 * swap["position"] - request.inputs["position"]
    found = request.run(dict(request.inputs) | {"position": mirrored}, request.settings)
    return {"colour": found["colour"], "d_harmonics": found["d_harmonics"]}


NEGATIVES = [
    Negative("quaternion_xyzw", "Quaternion read as x, y, z, w", "xyzw; right: w, x, y, z",
             {"covariance": swapped(_xyzw), "render": swapped(_xyzw), "objective": swapped(_xyzw)}),
    Negative("quaternion_not_normalised", "Quaternion not normalised", "raw in the rotation; right: unit",
             {"covariance": lambda r: {"rotation": _raw_rotation(r.inputs["quaternion"].astype(float))}}),
    Negative("quaternion_gradient_without_norm", "Gradient of the normalisation left out",
             "by the unit quaternion; right: by the raw one", {"covariance": _without_norm}),
    Negative("zero_quaternion", "Zero quaternion divided by its norm", "not a number; right: identity, gradient 0",
             {"covariance": _zero_quaternion("rotation", "d_quaternion"),
              "render": _zero_quaternion("colour_image", "d_quaternion")}),
    Negative("rotation_transposed", "Rotation transposed", "R^T; right: R S S^T R^T",
             {"covariance": output(rotation=lambda a: np.ascontiguousarray(a.transpose(1, 0, 2)))}),
    Negative("scale_gradient_without_scale", "Gradient of the exponential left out", "by s; right: times exp(s)",
             {"covariance": lambda r: {"d_log_scale": r.inputs["d_scale"]}}),
    Negative("scale_is_variance", "Scale taken as a variance", "exp(s / 2); right: exp(s) is the semi-axis",
             {"covariance": lambda r: {"scale": np.exp(r.inputs["log_scale"] / 2)}}),
    Negative("pixel_corner_mean", "Screen mean half a pixel off", "u - 1/2; right: u = fx x/z + cx",
             {"projection": output(mean2d=lambda a: np.where(a != 0, a - 0.5, a))}),
    Negative("pixel_corner_sample", "Pixels sampled at their corner", "at i; right: at i + 1/2",
             {"composite": swapped(lambda i: {"mean2d": i["mean2d"] + 0.5})}),
    Negative("pixel_corner_camera", "Render half a pixel off", "at i; right: at i + 1/2",
             {"render": _camera(cx=lambda v: v + 0.5, cy=lambda v: v + 0.5),
              "objective": _camera(cx=lambda v: v + 0.5, cy=lambda v: v + 0.5)}),
    Negative("low_pass_missing", "No low-pass", "covariance as it is; right: + 0.3 px^2 on the diagonal",
             _raster(("projection", "render", "objective"), low_pass=1e-6)),
    Negative("jacobian_clamp_missing", "Jacobian not clamped off axis", "none; right: 1.3 tan(fov / 2)",
             _raster(("projection", "render"), jacobian_clamp=0.0)),
    Negative("jacobian_clamped", "Jacobian clamped in preset exact", "1.3 tan(fov / 2); right: none",
             {"projection": _clamped_jacobian}),
    Negative("clamp_term_twice", "Factor 2 in the gradient of the clamped Jacobian", "2 / z; right: 1 / z",
             {"projection": _switch("double_clamp_term"), "render": _switch("double_clamp_term")}),
    Negative("screen_gradient_in_ndc", "Screen gradient per NDC unit", "times half the image size; right: per px",
             {"render": lambda r: {"d_mean2d": r.right["d_mean2d"] * np.array(
                 [[r.settings["camera"]["width"] / 2], [r.settings["camera"]["height"] / 2]])}
              if "d_mean2d" in r.right else None}),
    Negative("near_plane_zero", "Near plane at 0", "z > 0; right: z > near",
             _raster(("projection", "render"), near=1e-3)),
    Negative("pose_inverted", "Pose taken as camera to world", "W^T; right: world to camera",
             {"projection": _pose_inverted, "render": _pose_inverted, "objective": _pose_inverted}),
    Negative("shape_rotation_ignored", "Axes of the Gaussian not rotated", "S; right: R S",
             {"projection": swapped(lambda i: {"rotation": np.tile(np.eye(3)[:, :, None],
                                                                   i["scale"].shape[1:]).astype(i["scale"].dtype)})}),
    Negative("harmonics_sign_y", "Sign of the first harmonic", "+y; right: -y", {"harmonics": _mirrored}),
    Negative("direction_inverted", "Direction from Gaussian to camera", "inverted; right: camera to Gaussian",
             {"harmonics": _inverted_direction}),
    Negative("direction_gradient_dropped", "No gradient through the view direction", "0; right: kept",
             {"harmonics": lambda r: {n: 0 * r.right[n] for n in ("d_position", "d_centre")}
              if r.settings["degree"] else None}),
    Negative("bands_channel_first", "Harmonics as [channel, band]", "(3, K); right: (K, 3)", {"harmonics": _bands}),
    Negative("colour_not_clamped", "Colour not clamped at 0", "negative colours; right: max(0, .)",
             {"harmonics": _unclamped}),
    Negative("colour_clamped_above", "Colour clamped at 1", "min(1, .); right: no upper clamp",
             _harmonics(colour=lambda a: np.minimum(a, 1.0))),
    Negative("offset_half_missing", "1/2 left out of the colour", "sum Y h; right: 1/2 + sum Y h",
             {"harmonics": _no_half}),
    Negative("residual_not_scaled", "Residual added to the colour", "colour + r; right: Y00 (h_0 + r)",
             {"harmonics": swapped(lambda i: {"residual": i["residual"] / i["residual"].dtype.type(Y00)})}),
    Negative("order_by_index", "Composited in index order", "index; right: view depth",
             {"composite": _reordered(lambda z: np.arange(z.size))}),
    Negative("order_reversed", "Composited back to front", "far first; right: near first",
             {"composite": _reordered(lambda z: -z)}),
    Negative("ties_reversed", "Equal depths in reverse order", "last index first; right: index order",
             {"composite": _ties_reversed, "render": _ties_reversed}),
    Negative("depth_over_opacity", "Depth divided by opacity", "normalised; right: the sum",
             {"composite": _depth_over_opacity, "render": _depth_over_opacity}),
    Negative("background_missing", "Background left out", "0; right: T times background",
             {"composite": _no_background, "render": _no_background}),
    Negative("alpha_gradient_without_rest", "Gradient of alpha without what stands behind",
             "own colour only; right: own minus the rest", {"composite": _own_colour_only}),
    Negative("covariance_off_diagonal_half", "Half the off-diagonal gradient", "d/db of one entry; right: of both",
             {"composite": _half_off_diagonal}),
    Negative("depth_gradient_dropped", "Depth image sends no gradient to z", "0; right: alpha T",
             {"composite": _switch("drop_depth_to_z"), "render": _switch("drop_depth_to_z"),
              "objective": _switch("drop_depth_to_z")}),
    Negative("clamped_alpha_gradient", "Gradient passes the clamp of alpha", "passed; right: 0 where clamped",
             {"composite": _switch("pass_clamped_alpha"), "render": _switch("pass_clamped_alpha")}),
    Negative("deviations_off", "Exact gradients in preset legacy", "exact; right: the released code's",
             {"composite": _without_deviations, "render": _without_deviations, "objective": _without_deviations}),
    Negative("cutoff_missing", "No alpha cutoff", "every alpha; right: from 1/255 on",
             _raster(("composite", "render", "objective"), alpha_cutoff=lambda v: 1e-9 if v > 0 else v)),
    Negative("cutoff_1_over_256", "Alpha cutoff of 1/256", "1/256; right: 1/255",
             _raster(("composite",), alpha_cutoff=lambda v: 1 / 256 if v > 0 else v)),
    Negative("cutoff_decided_twice", "Cutoff decided anew in the reverse pass", "in the image, but without gradient; "
             "right: one decision", {"composite": _two_minds}),
    Negative("cutoff_added", "Alpha cutoff in preset exact", "1/255; right: none",
             _raster(("composite", "render", "objective"), alpha_cutoff=lambda v: v if v > 0 else 1 / 255)),
    Negative("alpha_clamp_999", "Alpha clamped at 0.999", "0.999; right: 0.99",
             _raster(("composite", "render"), alpha_max=lambda v: 0.999 if v < 1 else v)),
    Negative("alpha_clamp_missing", "Alpha not clamped", "up to 1; right: 0.99",
             _raster(("composite", "render"), alpha_max=lambda v: 1.0)),
    Negative("stop_missing", "No stop at small transmittance", "all Gaussians; right: stop before T < 1e-4",
             _raster(("composite", "render"), transmittance_stop=0.0)),
    Negative("stop_at_1e-3", "Stop at a transmittance of 1e-3", "1e-3; right: 1e-4",
             _raster(("composite",), transmittance_stop=lambda v: 1e-3 if v > 0 else v)),
    Negative("stop_after", "Stop after T fell below 1e-4", "one Gaussian too many; right: stop before",
             {"composite": _stop_after}),
    Negative("divide_by_one_minus_alpha", "Reverse pass divides by 1 - alpha", "0 / 0 at alpha = 1; right: recursion",
             {"composite": _division}),
]  # fmt: skip
