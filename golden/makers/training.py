"""Family `training`: calibration and twenty iterations, everything together.

Inputs: the first Gaussians, a short clip, the order of frames and the noise of splits. One case covers every event of a
training: two densifications, the activation of both residuals, the ramp of the Laplacian weight, two degrees.
"""

import msgspec
import numpy as np

from endotsr.config import (
    Config,
    DensityConfig,
    InitialisationConfig,
    LossConfig,
    ModelConfig,
    OptimiserConfig,
    RasterConfig,
    TrainingConfig,
)
from endotsr.definition.exposure import EXPOSURES
from endotsr.port.operations.optimiser import SQUARES, STATE, TERMS
from endotsr.training.scene.gaussians import Gaussians
from makers.clock import stamps, train_index
from makers.images import tissue
from makers.making import Made, Seeds, Spec, changed, given
from makers.moving import BASES, FRAMES, FREQUENCIES, LENS
from makers.operations import Declared, Judged
from makers.settings import written
from makers.views import pose, scene_inputs

DECLARED = {
    "training": Declared(
        {
            "lambda_lap": Judged(4),
            **{name: Judged(4, order="iteration") for name in TERMS},
            "loss": Judged(4, "loss", order="iteration"),
            "count": Judged(4, scale="exact", order="iteration"),
            **{name: Judged(4, "raw parameter^2", order="iteration") for name in SQUARES},
            **{name: Judged(4, order="iteration") for name in STATE},
            **{f"final_{name}": Judged(4, "raw parameter", "max") for name in Gaussians._fields},
            **{f"square_{name}": Judged(4, "raw parameter^2", order="iteration") for name in EXPOSURES},
            **{f"final_{name}": Judged(4, "raw parameter", "max") for name in EXPOSURES},
        },
        "see below",
        equations="(6), (7), (B10), (B11)",
        free={
            "training.visits_per_frame": "the length of a run; a case states its number of iterations",
            "training.bridge_fraction": "times between frames need optical flow, which no case has",
            "training.coarse_start": "an option that is not part of the paper",
            "training.seed": "random draws are inputs of the cases",
        },
    )
}
OPERATIONS = tuple(DECLARED)
COUNT, ITERATIONS, SHORT = 16, 20, 12


def _settings() -> Config:
    """Twenty iterations: both residuals activated, the Laplacian weight ramped, the degree raised, densification."""
    return Config(
        model=ModelConfig(bases=BASES, frequencies=FREQUENCIES, initial_width=0.25, harmonics_degree=2),
        raster=RasterConfig(near=0.2),
        loss=LossConfig(
            ssim_weight=0.25, smoothness_weight=0.0, smoothness_from=1000, lambda_lap="auto", laplacian_from=4,
            laplacian_full=12, calibration_views=4,
        ),
        optimiser=OptimiserConfig(position=0.004, deformation=0.002),
        density=DensityConfig(start=5, interval=6, until=14, gradient_threshold=0.02, extent=30.0, prune_opacity=0.02),
        initialisation=InitialisationConfig(first_frame_points=100, other_frame_points=0, motion_threshold=1.0),
        training=TrainingConfig(iterations=ITERATIONS, residual_activation=8, harmonics_interval=7),
    )  # fmt: skip


def _first_gaussians(seeds: Seeds, degree: int) -> dict[str, Made]:
    """One faint Gaussian, which is pruned, and five small Gaussians, which are cloned."""
    inputs = scene_inputs(seeds, COUNT, degree, pose(static=True))
    for name in ("rotation_matrix", "translation"):
        del inputs[name]
    inputs["opacity_logit"] = changed(inputs["opacity_logit"], 3, -5.0, "[3] is -5: pruned")
    small, scale = (slice(None), slice(5, 10)), inputs["log_scale"]
    inputs["log_scale"] = changed(scale, small, scale.array[small] - 1.75, "[:, 5:10] minus 1.75: cloned")
    shape = (10, BASES, COUNT)
    return inputs | {
        "fdm_weight": seeds.uniform("fdm_weight", -0.03, 0.03, *shape),
        "fdm_centre": seeds.uniform("fdm_centre", 0.1, 0.8, *shape),
        "fdm_width": seeds.uniform("fdm_width", 0.25, 0.5, *shape),
    }


def clip(seeds: Seeds) -> dict[str, Made]:
    """Frames with masks, depths, stamps and poses."""
    height, width = int(LENS["height"]), int(LENS["width"])
    grey = seeds.uniform("images", 0.0, 256.0, FRAMES, 3, height, width).array
    moved = np.stack([np.array([0.02 * k, -0.01 * k, 0.015625 * k]) for k in range(FRAMES)])
    mask = np.broadcast_to(tissue(height, width, 4, 5).array, (FRAMES, height, width)).copy()
    mask[::2, 0, :] = False
    return {
        "images": given(np.floor(grey).astype(np.int64), f"floor of uniform(0.0, 256.0) seed {seeds.seed('images')}",
                        "display / 255"),
        "masks": given(mask, "False in the last 4 rows of the last 5 columns, and in row 0 of even frames"),
        "prior_depths": seeds.uniform("prior_depths", 2.0, 7.0, FRAMES, height, width, unit="scene unit"),
        "times": stamps(FRAMES),
        "train_index": train_index(FRAMES),
        "rotation_matrices": given(np.stack([np.eye(3)] * FRAMES), "identity"),
        "translations": given(moved, "(0.02, -0.01, 1/64) k", "scene unit"),
    }  # fmt: skip


def trajectory_inputs(seeds: Seeds, iterations: int, degree: int = 2) -> dict[str, Made]:
    """The inputs of a trajectory."""
    order = seeds.uniform("frame_order", 0.0, 10.0, iterations).array
    return _first_gaussians(seeds, degree) | clip(seeds) | {
        "frame_order": given(np.floor(order).astype(np.int64), f"floor of uniform(0.0, 10.0) seed "
                             f"{seeds.seed('frame_order')}; positions within train_index", "frame"),
        "split_noise": seeds.uniform("split_noise", -1.5, 1.5, 2, 3, 32),
    }  # fmt: skip


def _out_of_view() -> Spec:
    """Every second frame is seen from one side or the other, with some Gaussians out of view.

    Without residuals: if the gradient of a Gaussian is rounding noise, Adam moves a coefficient by the full rate.
    """
    seeds, config = Seeds("training", "out_of_view"), _settings()
    inputs = trajectory_inputs(seeds, SHORT)
    k = np.arange(FRAMES)
    sideways = 4.0 * (k % 2) * (1 - 2 * (k // 2 % 2))
    recipe = "(4, 0, k / 64) for k % 4 = 1, (-4, 0, k / 64) for k % 4 = 3, else (0, 0, k / 64)"
    inputs["translations"] = given(np.stack([sideways, 0 * k, 0.015625 * k], axis=1), recipe, "scene unit")
    config = msgspec.structs.replace(
        config,
        density=msgspec.structs.replace(config.density, start=3, interval=4, until=10),
        training=msgspec.structs.replace(config.training, iterations=SHORT, residual_activation=SHORT),
    )
    flags = ("visible_if_in_front", "density_over_all_views", "statistics_not_reset")
    title = "Gaussians leave the view and come back: only views in which one is visible count for its densification"
    return Spec("training", "out_of_view", "training", title, flags,
                {"camera": LENS, "config": written(config)}, inputs)  # fmt: skip


def cases() -> list[Spec]:
    """The trajectory, and a shorter one in which Gaussians leave the view."""
    settings = {"camera": LENS, "config": written(_settings())}
    flags = ("skipped_step_when_densifying", "residuals_activated_late", "rates_not_decaying",
             "laplacian_weight_not_ramped", "penalty_dropped_in_training", "calibration_of_half_ratio",
             "densify_threshold_in_pixels", "children_inherit_moments", "statistics_not_reset", "degree_late",
             "laplacian_ramp_late", "residual_steps_from_start", "statistics_from_start", "moments_not_gathered",
             "frame_order_of_all_frames", "densified_before_the_step")  # fmt: skip
    title = "Calibration, then twenty iterations: densification at 6 and 12, residuals from 9 on, detail ramp, degree 2"
    inputs = trajectory_inputs(Seeds("training", "twenty_iterations"), ITERATIONS)
    return [Spec("training", "twenty_iterations", "training", title, flags, settings, inputs), _out_of_view()]
