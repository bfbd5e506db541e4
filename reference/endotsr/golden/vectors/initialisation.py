"""Family `initialisation`: the first Gaussians, from depth maps of the training frames (B12).

Images, masks, prior depths and camera poses come in; every candidate is taken, so that no random number is drawn. The
cases are three training frames of six, a clip long enough that frames are skipped, and a single point.
"""

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.config import InitialisationConfig, ModelConfig
from endotsr.golden.vectors.making import Made, Seeds, Spec, changed, given
from endotsr.golden.vectors.views import pose
from endotsr.golden.vectors.wrong import Request, Wrong, WrongPort, output, setting, swapped
from endotsr.kernels.constants import Y00

OPERATIONS = ("initialisation",)
LENS = {"fx": 7.0, "fy": 9.0, "cx": 2.75, "cy": 2.25, "width": 6, "height": 5}


def _frames(seeds: Seeds, count: int, train: list[int]) -> dict[str, Made]:
    """Each frame differs from a common depth map by a step of its own, clearly more or less than the threshold of 5."""
    height, width = int(LENS["height"]), int(LENS["width"])
    shape = (count, height, width)
    grey = seeds.uniform("images", 0.0, 256.0, count, 3, height, width).array
    common = seeds.uniform("depth", 40.0, 50.0, height, width).array
    step = seeds.uniform("step", -7.0, 7.0, *shape).array
    step = np.where(np.abs(np.abs(step) - 5.0) < 0.01, 0.0, step)
    mask = seeds.uniform("mask", 0.0, 1.0, *shape).array < 0.8
    depth = given(np.where(np.arange(count)[:, None, None] > 0, common + np.round(step * 8) / 8, common),
                  f"uniform(40, 50) seed {seeds.seed('depth')} plus, after frame 0, eighths of uniform(-7, 7) seed "
                  f"{seeds.seed('step')}", "scene unit")  # fmt: skip
    hole = seeds.uniform("hole", 0.0, 1.0, *shape).array < 0.1
    turned = pose()["rotation_matrix"]
    return {
        "images": given(np.floor(grey).astype(np.int64), f"floor of uniform(0, 256) seed {seeds.seed('images')}",
                        "display / 255"),
        "masks": given(mask, f"uniform(0, 1) seed {seeds.seed('mask')} < 0.8"),
        "prior_depths": changed(depth, hole, 0.0, f"0 where uniform(0, 1) seed {seeds.seed('hole')} < 0.1"),
        "train_index": given(np.array(train), ", ".join(map(str, train)), "frame"),
        "rotation_matrices": given(np.stack([turned.array] * count), turned.recipe),
        "translations": given(np.stack([np.array([0.25, -0.125, 0.5]) * k for k in range(count)]),
                              "(1/4, -1/8, 1/2) k", "scene unit"),
    }  # fmt: skip


def cases() -> list[Spec]:
    """A short clip, a long clip, one point."""
    model = msgspec.to_builtins(ModelConfig(bases=3, harmonics_degree=1, initial_width=0.125))

    def spec(case: str, title: str, flags: tuple[str, ...], inputs: dict[str, Made]) -> Spec:
        drawn = InitialisationConfig(first_frame_points=1000, other_frame_points=10_000, motion_threshold=5.0)
        settings = {"camera": LENS, "initialisation": msgspec.to_builtins(drawn), "model": model}
        return Spec("initialisation", case, "initialisation", title, flags, settings, inputs)

    one = _frames(Seeds("initialisation", "one_point"), 1, [0])
    alone = np.zeros(one["masks"].array.shape, bool)
    alone[0, 2, 3] = True
    one["masks"] = given(alone, "True at (2, 3) only")
    one["prior_depths"] = changed(one["prior_depths"], (0, 2, 3), 44.0, "(2, 3) is 44")
    long = _frames(Seeds("initialisation", "long_clip"), 152, [*range(1, 8), 150, 151])
    kept = long["masks"].array & (np.arange(30).reshape(5, 6) % 7 == 0)
    long["masks"] = given(kept, f"{long['masks'].recipe} and (6 y + x) % 7 = 0")
    flags = ("backprojected_at_corner", "initialised_from_test_frames", "moved_pixels_ignored", "holes_initialised",
             "points_left_in_camera", "mean_distance_for_scale", "neighbours_count_itself",
             "initial_colour_without_y00")  # fmt: skip
    frames = _frames(Seeds("initialisation", "frames"), 6, [2, 3, 5])
    return [
        spec("frames", "Depth maps of three training frames of six, lifted with their own cameras", flags, frames),
        spec("long_clip", "Of 152 frames every second one is visited", ("long_clip_every_frame",), long),
        spec("one_point", "A single point: the floor of the scale", ("single_point_without_floor",), one),
    ]  # fmt: skip


# ---- mistakes ----


def _no_floor(request: Request) -> dict[str, NDArray] | None:
    return {"log_scale": np.full((3, 1), -np.inf)} if request.right["count"] == 1 else None


def _every_frame(request: Request) -> dict[str, NDArray] | None:
    """No skipping in a long clip; only the number of points is wrong."""
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


WRONG_PORTS = [
    WrongPort("backprojected_at_corner", "Pixels lifted at their corner", "i - cx; right: i + 1/2 - cx",
              {"initialisation": _corner}),
    WrongPort("initialised_from_test_frames", "Held-out frames initialise too", "all frames; right: training frames",
              {"initialisation": swapped(lambda i: {"train_index": np.arange(len(i["images"]))})}),
    WrongPort("moved_pixels_ignored", "Pixels that moved are not candidates", "new ones only; right: or moved ones",
              {"initialisation": setting(initialisation__motion_threshold=1e9)}),
    WrongPort("holes_initialised", "Pixels without depth initialised", "at the least depth; right: left out",
              {"initialisation": swapped(_holes)}),
    WrongPort("points_left_in_camera", "Points left in camera axes", "x; right: W^T (x - d)",
              {"initialisation": lambda r: {"position": swapped(_in_camera)(r)["position"]}}),  # type: ignore[index],
    WrongPort("mean_distance_for_scale", "Scale from the mean distance", "mean d; right: sqrt(mean d^2)",
              {"initialisation": _scales(lambda d: d[:, 1:4].mean(axis=1))}),
    WrongPort("neighbours_count_itself", "Point counted among its neighbours", "itself and two; right: three others",
              {"initialisation": _scales(lambda d: np.sqrt((d[:, :3] ** 2).mean(axis=1)))}),
    WrongPort("initial_colour_without_y00", "First harmonic set to the colour", "rgb - 1/2; right: over Y00",
              {"initialisation": output(harmonics=lambda a: a * Y00)}),
    WrongPort("long_clip_every_frame", "No frame skipped in a long clip", "all; right: every second beyond 150",
              {"initialisation": _every_frame}),
    WrongPort("single_point_without_floor", "Scale of a single point without floor", "log 0; right: 1e-7",
              {"initialisation": _no_floor}),
]  # fmt: skip
