"""Family `initialisation`: the first Gaussians, from depth maps of the training frames (B12).

Inputs: images, masks, prior depths and camera poses. Every candidate is selected, so no random number is drawn. The
cases are three training frames of six, a clip long enough for skipped frames, and a single point.
"""

import numpy as np

from endotsr.config import InitialisationConfig, ModelConfig
from makers.making import Made, Seeds, Spec, changed, given
from makers.operations import Declared, Judged
from makers.settings import OF_THE_INITIALISATION, written_section
from makers.views import pose

DECLARED = {
    "initialisation": Declared(
        {
            "count": Judged(1, scale="exact", oracle="initialisation.initialise"),
            "position": Judged(1, "scene unit", "last", "initialisation.initialise"),
            "log_scale": Judged(1, oracle="initialisation.initialise"),
            "harmonics": Judged(1, "display / Y00", oracle="initialisation.initialise"),
            **{name: Judged(1) for name in ("quaternion", "opacity_logit", "fdm_weight", "fdm_centre", "fdm_width")},
        },
        "every candidate is taken. Order: frames as in `train_index`, pixels of a frame row by row. `prior_depths` are"
        " clipped already",
        free={
            "initialisation.first_frame_points": "how many candidates are drawn; the cases take every candidate",
            "initialisation.other_frame_points": "how many candidates are drawn; the cases take every candidate",
            "initialisation.motion": "tracked motion needs optical flow, which no case has",
        },
    )
}
OPERATIONS = tuple(DECLARED)
LENS = {"fx": 7.0, "fy": 9.0, "cx": 2.75, "cy": 2.25, "width": 6, "height": 5}


def frames(seeds: Seeds, count: int, train: list[int]) -> dict[str, Made]:
    """Each frame differs from a common depth map by its own step, clearly above or below the threshold of 5."""
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
    model = written_section(ModelConfig(bases=3, harmonics_degree=1, initial_width=0.125))

    def spec(case: str, title: str, flags: tuple[str, ...], inputs: dict[str, Made]) -> Spec:
        drawn = InitialisationConfig(first_frame_points=1000, other_frame_points=10_000, motion_threshold=5.0)
        settings = {"camera": LENS, "initialisation": written_section(drawn, OF_THE_INITIALISATION), "model": model}
        return Spec("initialisation", case, "initialisation", title, flags, settings, inputs)

    one = frames(Seeds("initialisation", "one_point"), 1, [0])
    alone = np.zeros(one["masks"].array.shape, bool)
    alone[0, 2, 3] = True
    one["masks"] = given(alone, "True at (2, 3) only")
    one["prior_depths"] = changed(one["prior_depths"], (0, 2, 3), 44.0, "(2, 3) is 44")
    long = frames(Seeds("initialisation", "long_clip"), 152, [*range(1, 8), 150, 151])
    kept = long["masks"].array & (np.arange(30).reshape(5, 6) % 7 == 0)
    long["masks"] = given(kept, f"{long['masks'].recipe} and (6 y + x) % 7 = 0")
    longest = frames(Seeds("initialisation", "clip_of_150"), 150, [1, 2, 3, 5, 149])
    kept = longest["masks"].array & (np.arange(30).reshape(5, 6) % 7 == 0)
    longest["masks"] = given(kept, f"{longest['masks'].recipe} and (6 y + x) % 7 = 0")
    flags = ("backprojected_at_corner", "initialised_from_test_frames", "moved_pixels_ignored", "holes_initialised",
             "points_left_in_camera", "mean_distance_for_scale", "neighbours_count_itself",
             "initial_colour_without_y00", "initial_opacity_as_logit")  # fmt: skip
    short = frames(Seeds("initialisation", "frames"), 6, [2, 3, 5])
    return [
        spec("frames", "Depth maps of three training frames of six, lifted with their own cameras", flags, short),
        spec("long_clip", "Of 152 frames every second one is visited", ("long_clip_every_frame",), long),
        spec("clip_of_150", "Of 150 frames every one is visited", (), longest),
        spec("one_point", "A single point: the floor of the scale", ("single_point_without_floor",), one),
    ]  # fmt: skip
