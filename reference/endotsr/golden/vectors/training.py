"""Family `training`: calibration and twenty iterations, everything together.

First Gaussians, a short clip, the order of frames and the noise of splits come in. One case covers every event of a
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
from endotsr.golden.vectors.clock import stamps, train_index
from endotsr.golden.vectors.images import tissue
from endotsr.golden.vectors.making import Made, Seeds, Spec, changed, given
from endotsr.golden.vectors.moving import BASES, FRAMES, FREQUENCIES, LENS
from endotsr.golden.vectors.views import pose, scene_inputs
from endotsr.golden.vectors.wrong import WrongPort, within

OPERATIONS = ("training",)
COUNT, ITERATIONS = 16, 20


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


def _first_gaussians(seeds: Seeds) -> dict[str, Made]:
    """One faint Gaussian, which is pruned, and five small ones, which are cloned."""
    inputs = scene_inputs(seeds, COUNT, 2, pose(static=True))
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


def _clip(seeds: Seeds) -> dict[str, Made]:
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


def cases() -> list[Spec]:
    """The trajectory."""
    seeds = Seeds("training", "twenty_iterations")
    order = seeds.uniform("frame_order", 0.0, 10.0, ITERATIONS).array
    inputs = _first_gaussians(seeds) | _clip(seeds) | {
        "frame_order": given(np.floor(order).astype(np.int64), f"floor of uniform(0.0, 10.0) seed "
                             f"{seeds.seed('frame_order')}; positions within train_index", "frame"),
        "split_noise": seeds.uniform("split_noise", -1.5, 1.5, 2, 3, 32),
    }  # fmt: skip
    settings = {"camera": LENS, "config": msgspec.to_builtins(_settings())}
    flags = ("skipped_step_when_densifying", "residuals_activated_late", "rates_not_decaying",
             "laplacian_weight_not_ramped", "penalty_dropped_in_training", "calibration_of_half_ratio",
             "densify_threshold_in_pixels")  # fmt: skip
    title = "Calibration, then twenty iterations: densification at 6 and 12, residuals from 9 on, detail ramp, degree 2"
    return [Spec("training", "twenty_iterations", "training", title, flags, settings, inputs)]


# ---- mistakes; those that `schedule` reveals are in that family ----

WRONG_PORTS = [
    WrongPort("skipped_step_when_densifying", "No optimiser step when densifying", "skipped; right: taken",
              within("config", ("training", "schedule"), optimiser__legacy_skip=True)),
    WrongPort("penalty_dropped_in_training", "Matern penalty left out of training", "0; right: lambda_msp",
              within("config", ("training", "schedule"), loss__lambda_msp=0.0)),
    WrongPort("calibration_of_half_ratio", "Calibration with another ratio", "r / 2; right: r",
              within("config", ("training", "schedule"), loss__gradient_ratio=lambda r: r / 2)),
]  # fmt: skip
