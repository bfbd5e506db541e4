"""Exposure within the whole method: the objective of a frame with gain and bias, and a training that fits them (B13).

The operation alone has the family `exposure`. Here the exposed colours enter the terms, and the gradient of the render
and of the exposure comes back through them. Red is above 1 before the exposure and other colours are below 0 after it,
so a clamp at either place changes the loss; the smoothness term has a gradient outside of tissue. In the trajectory,
the frames before and after a held-out frame have exposures of their own, and an exposed frame moves on while others are
drawn.
"""

from endotsr.config import (
    Config,
    DensityConfig,
    LossConfig,
    ModelConfig,
    OptimiserConfig,
    RasterConfig,
    TrainingConfig,
)
from endotsr.method.splatting.settings import PAPER
from endotsr.port.operations.requests import raster_dict
from makers.making import Seeds, Spec, changed
from makers.moving import BASES, LENS, TIME, model_settings, moving_inputs
from makers.objective import WEIGHTS, image_inputs
from makers.settings import written
from makers.training import trajectory_inputs

OPERATIONS = ("objective", "training")
ITERATIONS = 12
IN_ONE_PASS = (
    "gradient_without_gain", "bias_gradient_dropped", "exposure_gradient_over_tissue", "render_clamped_before_exposure",
    "exposure_clamped", "gain_not_exponential", "bias_before_gain", "log_gain_gradient_by_gain",
)  # fmt: skip


def _objective() -> Spec:
    seeds = Seeds("objective", "exposed")
    inputs = moving_inputs(seeds, 2, False) | image_inputs(seeds)
    h = inputs["harmonics"]
    inputs["harmonics"] = changed(h, (0, 0), h.array[0, 0] + 3.0, "[0, 0] plus 3: red above 1")
    inputs["exposure_log_gain"] = seeds.uniform("exposure_log_gain", -0.5, 0.5, 3)
    inputs["exposure_bias"] = seeds.uniform("exposure_bias", -0.375, -0.125, 3, unit="display")
    settings = {"t": TIME, "degree": 2, "camera": LENS, "preset": "paper", "raster": raster_dict(PAPER),
                "model": model_settings(exposure=True), "loss": WEIGHTS}  # fmt: skip
    title = "The exposed render is compared with the frame; gradients of render, gain and bias"
    return Spec("objective", "exposed", "objective", title, IN_ONE_PASS, settings, inputs)


def _training() -> Spec:
    """A large rate, so that the exposure of one frame differs from that of another after few visits."""
    config = Config(
        model=ModelConfig(bases=BASES, frequencies=2, initial_width=0.25, harmonics_degree=1, exposure=True),
        raster=RasterConfig(near=0.2),
        loss=LossConfig(ssim_weight=0.25, smoothness_weight=0.05, smoothness_from=1, lambda_lap=0.5, laplacian_from=2,
                        laplacian_full=6),
        optimiser=OptimiserConfig(position=0.004, deformation=0.002, exposure=0.0625, final_factor=0.5, epsilon=1e-4),
        density=DensityConfig(start=3, interval=4, until=10, gradient_threshold=0.02, extent=30.0, prune_opacity=0.02),
        training=TrainingConfig(iterations=ITERATIONS, residual_activation=ITERATIONS, harmonics_interval=5),
    )  # fmt: skip
    inputs = trajectory_inputs(Seeds("training", "exposed"), ITERATIONS, 1)
    title = "Each training frame has an exposure, which is fitted from the first iteration on"
    flags = ("exposure_by_number_of_frame", "exposure_of_drawn_frame_alone", "exposure_rate_not_decaying")
    return Spec("training", "exposed", "training", title, flags, {"camera": LENS, "config": written(config)}, inputs)


def cases() -> list[Spec]:
    """One view, then a trajectory."""
    return [_objective(), _training()]
