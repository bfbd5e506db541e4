"""Wrong ports of schedules, density control and initialisation."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.negative import Negative, Request, Wrong, output, setting, swapped
from endotsr.kernels.constants import Y00


def _schedule(**changes: Any) -> dict[str, Wrong]:
    return {"schedule": setting(**{f"config__{key}": value for key, value in changes.items()})}


def _restart(on: bool) -> dict[str, Wrong]:
    return _schedule(optimiser__restart_residual_schedule=on)


def _statistics(divide) -> Wrong:
    """Another mean of the screen gradients, with the decisions that were made from the right one."""

    def wrong(request: Request) -> dict[str, NDArray]:
        seen = request.inputs["visible"].sum(axis=0)
        return {"mean_gradient": request.right["mean_gradient"] * np.maximum(seen, 1) / divide(seen)}

    return wrong


def _swapped_masks(request: Request) -> dict[str, NDArray]:
    return {"cloned": request.right["split"], "split": request.right["cloned"]}


def _faint_kept(request: Request) -> dict[str, NDArray]:
    """Pruning forgets the Gaussians that are to be densified."""
    pruned = request.right["pruned"]
    steep = request.right["mean_gradient"] >= request.settings["density"]["gradient_threshold"]
    kept = pruned & steep
    return {"pruned": pruned & ~steep, "cloned": request.right["cloned"] | kept,
            "count": request.right["count"] + 2 * kept.sum()}  # fmt: skip


def _parents_kept(request: Request) -> dict[str, NDArray]:
    return {"count": request.right["count"] + request.right["split"].sum()}


def _children(request: Request) -> slice:
    """Columns of the children of splits."""
    return slice(request.right["count"] - 2 * int(request.right["split"].sum()), None)


def _large_children(request: Request) -> dict[str, NDArray]:
    scale = request.right["log_scale_after"].copy()
    scale[:, _children(request)] += np.log(1.6)
    return {"log_scale_after": scale}


def _interleaved(request: Request) -> dict[str, NDArray]:
    """First and second child of a parent side by side."""
    found = {}
    for name in ("parent", "position_after", "log_scale_after"):
        a = request.right[name].copy()
        two = a[..., _children(request)]
        a[..., _children(request)] = np.swapaxes(two.reshape(*two.shape[:-1], 2, -1), -1, -2).reshape(two.shape)
        found[name] = a
    return found


def _first_candidates(request: Request) -> dict[str, NDArray] | None:
    """The first candidates take the room, whatever their gradient."""
    alive = ~request.right["pruned"]
    candidates = alive & (request.right["mean_gradient"] >= request.settings["density"]["gradient_threshold"])
    room = request.settings["density"]["maximum"] - alive.sum()
    if candidates.sum() <= room:
        return None
    won = candidates & (np.cumsum(candidates) <= room)
    limit = request.right["extent"] * request.settings["density"]["dense_fraction"]
    large = np.exp(request.inputs["log_scale"].max(axis=0)) > limit
    return {"cloned": won & ~large, "split": won & large}


def _no_margin(request: Request) -> dict[str, NDArray] | None:
    return {"extent": request.right["extent"] / 1.1} if request.settings["density"]["extent"] == "cameras" else None


def _every_frame(request: Request) -> dict[str, NDArray] | None:
    """No skipping in a long clip; only the number of points is told."""
    train = request.inputs["train_index"]
    if len(request.inputs["images"]) <= 150:
        return None
    return {"count": request.right["count"] + _new_pixels(request, [k for k in train[1:] if (k - train[0]) % 2 == 0])}


def _new_pixels(request: Request, frames: list[int]) -> int:
    depth, first = request.inputs["prior_depths"], int(request.inputs["train_index"][0])
    usable = request.inputs["masks"] & (depth > 0)
    far = np.abs(depth - depth[first]) > request.settings["initialisation"]["motion_threshold"]
    return sum(int((usable[k] & (~usable[first] | far[k])).sum()) for k in frames)


def _holes(inputs: dict[str, NDArray]) -> dict[str, NDArray]:
    depth = inputs["prior_depths"]
    return {"prior_depths": np.where(depth > 0, depth, depth[depth > 0].min())}


def _in_camera(inputs: dict[str, NDArray]) -> dict[str, NDArray]:
    turned = inputs["rotation_matrices"]
    return {"rotation_matrices": np.broadcast_to(np.eye(3), turned.shape).astype(turned.dtype),
            "translations": 0 * inputs["translations"]}  # fmt: skip


def _corner(request: Request) -> dict[str, NDArray]:
    lens = request.settings["camera"]
    half = {"camera": lens | {"cx": lens["cx"] + 0.5, "cy": lens["cy"] + 0.5}}
    return {"position": request.run(request.inputs, dict(request.settings) | half)["position"]}


def _scales(reduce) -> Wrong:
    """Log-scales from the sorted distances (N, N) of every point to all, itself first."""

    def wrong(request: Request) -> dict[str, NDArray] | None:
        points = request.right["position"]
        if points.shape[1] < 5:
            return None
        distance = np.sort(np.sqrt(((points[:, :, None] - points[:, None]) ** 2).sum(axis=0)), axis=1)
        return {"log_scale": np.tile(np.log(reduce(distance)), (3, 1))}

    return wrong


def _no_floor(request: Request) -> dict[str, NDArray] | None:
    return {"log_scale": np.full((3, 1), -np.inf)} if request.right["count"] == 1 else None


NEGATIVES = [
    Negative("residual_rates_not_restarted", "Residual rates decay from the first iteration",
             "i / T; right: (i - K_s) / (T - K_s)", _restart(False)),
    Negative("residual_rates_restarted", "Residual rates restarted where the configuration says no",
             "(i - K_s) / (T - K_s); right: i / T", _restart(True)),
    Negative("degree_from_one", "Harmonic degree raised one interval early", "1 + floor(i / interval); right: floor",
             {"schedule": lambda r: {"degree": np.minimum(
                 r.right["degree"] + 1, r.settings["config"]["model"]["harmonics_degree"])}}),
    Negative("densify_from_start", "Density control at its first iteration too", "i >= start; right: i > start",
             _schedule(density__start=lambda v: v - 1)),
    Negative("position_weights_same_rate", "One rate for all weights of the deformation",
             "factor of the position channels ignored; right: applied",
             _schedule(optimiser__deformation_position_factor=1.0)),
    Negative("density_over_all_views", "Screen gradient averaged over all views", "over views; right: visible ones",
             {"density": lambda r: _statistics(lambda seen: len(r.inputs["visible"]))(r)}),
    Negative("density_sum_of_views", "Screen gradients added, not averaged", "sum; right: mean over visible views",
             {"density": _statistics(lambda seen: 1)}),
    Negative("clone_and_split_swapped", "Large ones cloned, small ones split", "swapped; right: small ones cloned",
             {"density": _swapped_masks}),
    Negative("faint_ones_densified", "Faint Gaussians densified, not pruned", "gradient first; right: pruned first",
             {"density": _faint_kept}),
    Negative("split_parent_kept", "Parent of a split kept", "three Gaussians; right: two children",
             {"density": _parents_kept}),
    Negative("children_not_smaller", "Children as large as their parent", "s; right: s - ln 1.6",
             {"density": _large_children}),
    Negative("children_interleaved", "Children of one parent side by side",
             "first, second, first, ...; right: all first children, then all second", {"density": _interleaved}),
    Negative("children_inherit_moments", "Children keep the moments of their parent", "copied; right: zero",
             {"density": output(moments_kept=lambda a: np.ones_like(a))}),
    Negative("first_candidates_win", "First candidates take the room", "by index; right: steepest first",
             {"density": _first_candidates}),
    Negative("extent_without_margin", "Extent of the cameras without its margin", "radius; right: 1.1 times",
             {"density": _no_margin}),
    Negative("backprojected_at_corner", "Pixels lifted at their corner", "i - cx; right: i + 1/2 - cx",
             {"initialisation": _corner}),
    Negative("initialised_from_test_frames", "Held-out frames initialise too", "all frames; right: training frames",
             {"initialisation": swapped(lambda i: {"train_index": np.arange(len(i["images"]))})}),
    Negative("moved_pixels_ignored", "Pixels that moved are not candidates", "new ones only; right: or moved ones",
             {"initialisation": setting(initialisation__motion_threshold=1e9)}),
    Negative("holes_initialised", "Pixels without depth initialised", "at the least depth; right: left out",
             {"initialisation": swapped(_holes)}),
    Negative("points_left_in_camera", "Points left in camera axes", "x; right: W^T (x - d)",
             {"initialisation": lambda r: {"position": swapped(_in_camera)(r)["position"]}}),  # type: ignore[index]
    Negative("mean_distance_for_scale", "Scale from the mean distance", "mean d; right: sqrt(mean d^2)",
             {"initialisation": _scales(lambda d: d[:, 1:4].mean(axis=1))}),
    Negative("neighbours_count_itself", "Point counted among its neighbours", "itself and two; right: three others",
             {"initialisation": _scales(lambda d: np.sqrt((d[:, :3] ** 2).mean(axis=1)))}),
    Negative("initial_colour_without_y00", "First harmonic set to the colour", "rgb - 1/2; right: over Y00",
             {"initialisation": output(harmonics=lambda a: a * Y00)}),
    Negative("long_clip_every_frame", "No frame skipped in a long clip", "all; right: every second beyond 150",
             {"initialisation": _every_frame}),
    Negative("single_point_without_floor", "Scale of a single point without floor", "log 0; right: 1e-7",
             {"initialisation": _no_floor}),
]  # fmt: skip
