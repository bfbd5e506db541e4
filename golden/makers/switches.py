"""Settings of training in combinations that no other case has: one residual alone, no room to grow, heavy weights.

A condition on two components is tested by each of them alone, a room that is clamped at 0 by more Gaussians than the
budget, a rate or a weight by a value above 1, a ramp or a decay by one without a length, and the division of a budget
among the densifications that are left by a trajectory with three of them.
"""

from endotsr.config import Config, DensityConfig, LossConfig, ModelConfig, OptimiserConfig, RasterConfig, TrainingConfig
from endotsr.method.splatting.settings import PAPER
from endotsr.port.operations.requests import raster_dict
from makers.density import density_spec, spread_gradients
from makers.making import Seeds, Spec, changed
from makers.moving import BASES, LENS, TIME, model_settings, moving_inputs
from makers.objective import image_inputs
from makers.schedule import schedule_spec
from makers.settings import written
from makers.training import trajectory_inputs

OPERATIONS = ("schedule", "density", "scene", "objective", "training")
BOTH, FULL = "residuals_need_both", "room_below_0"


def _rates() -> list[Spec]:
    """A alone with rates above 1 and a ramp without length; S alone, active in the last iteration."""
    colour = Config(
        model=ModelConfig(spectral_motion=False, harmonics_degree=1),
        loss=LossConfig(lambda_lap=30.0, laplacian_from=3, laplacian_full=3, smoothness_from=2, smoothness_weight=2.0),
        optimiser=OptimiserConfig(
            position=3.0, deformation=5.0, harmonics_base=2.0, harmonics_rest=4.0, opacity=6.0, scale=7.0, rotation=8.0,
            deformation_position_factor=3.0, spectral_motion_factor=2.0, appearance_factor=4.0, final_factor=0.5,
            annealing_from=2, annealed_factor=0.25,
        ),
        density=DensityConfig(start=1, interval=2, until=7),
        training=TrainingConfig(iterations=8, residual_activation=4, harmonics_interval=3),
    )  # fmt: skip
    motion = Config(
        model=ModelConfig(appearance=False, harmonics_degree=3),
        loss=LossConfig(lambda_lap=3.0, laplacian_from=2, laplacian_full=4, smoothness_from=4),
        optimiser=OptimiserConfig(annealing_from=6, annealed_factor=0.5, deformation=3.0, spectral_motion_factor=2.0),
        density=DensityConfig(start=2, interval=1, until=5),
        training=TrainingConfig(iterations=6, residual_activation=5, harmonics_interval=1),
    )
    return [
        schedule_spec("appearance_alone", colour, tuple(range(1, 9)),
                      "A without S, rates above 1, a ramp without length", (BOTH,)),
        schedule_spec("motion_alone", motion, tuple(range(1, 7)),
                      "S without A, activated for one iteration; an annealing without length", (BOTH,)),
    ]  # fmt: skip


def _growth() -> list[Spec]:
    """Fewer places than Gaussians that stay, by both ways to grow."""
    title = "More Gaussians than places: nobody is added, nobody is removed"
    return [
        density_spec("full", f"{title} (threshold)", (FULL,), change=spread_gradients, maximum=5),
        density_spec("full_budget", f"{title} (budget)", (FULL,), change=spread_gradients, maximum=5, growth="budget"),
    ]


def _scene() -> Spec:
    seeds = Seeds("scene", "wide")
    inputs = moving_inputs(seeds, 0, True)
    for name, factor in (("fdm_weight", 40.0), ("appearance_coefficients", 4.0), ("motion_coefficients", 60.0)):
        inputs[name] = changed(inputs[name], ..., inputs[name].array * factor, f"times {factor:g}")
    for name in ("rotation_matrix", "translation"):
        del inputs[name]
    for name in ("harmonics", "opacity_logit"):  # last in the list of inputs
        inputs[name] = inputs.pop(name)
    settings = {"t": 1.0859375, "model": model_settings(beta=2.5, frequency_max=6.0)}
    title = "Offsets and residuals beyond 1 after the end of the clip; the sine of 6 cycles is dead"
    return Spec("scene", "wide", "scene", title, (), settings, inputs)


def _objective() -> Spec:
    """Each weight above 1, each component but one; a render that is the negative of the frame in places."""
    seeds = Seeds("objective", "heavy")
    inputs = moving_inputs(seeds, 1, False) | image_inputs(seeds)
    h = inputs["harmonics"]
    inputs["harmonics"] = changed(h, (0, 0), h.array[0, 0] + 6.0, "[0, 0] plus 6: red above 1")
    weights = {"ssim_weight": 0.875, "depth_weight": 30.0, "smoothness_weight": 4.0, "total_variation_factor": 9.0,
               "lambda_msp": 5000.0, "lambda_lap": 20.0, "upsampling": "co_sited"}  # fmt: skip
    settings = {"t": TIME, "degree": 1, "camera": LENS, "preset": "paper", "raster": raster_dict(PAPER),
                "model": model_settings(), "loss": weights}  # fmt: skip
    return Spec("objective", "heavy", "objective", "Weights and gradients above 1", (), settings, inputs)


def _budget() -> Spec:
    """Densifications at 2, 4 and 6 share the places; cameras of held-out frames are far away and do not count."""
    config = Config(
        model=ModelConfig(bases=BASES, frequencies=2, initial_width=0.25, harmonics_degree=0, appearance=False,
                          laplacian=False),
        raster=RasterConfig(near=0.2),
        loss=LossConfig(smoothness_weight=0.0, lambda_lap=0.0),
        optimiser=OptimiserConfig(epsilon=1e-4),
        density=DensityConfig(start=1, interval=2, until=7, growth="budget", maximum=25, extent="cameras",
                              dense_fraction=4.0,
                              gradient_threshold=100.0, prune_opacity=0.02),
        training=TrainingConfig(iterations=7, residual_activation=4, harmonics_interval=2),
    )  # fmt: skip
    inputs = trajectory_inputs(Seeds("training", "budget"), 7, 0)
    held_out = (slice(1, None, 8), 0)
    inputs["translations"] = changed(inputs["translations"], held_out, 6.0, "x of the held-out frames 1 and 9 is 6")
    title = "A budget of Gaussians is divided among the three densifications that are left; S without A"
    return Spec("training", "budget", "training", title, ("budget_at_once", "extent_of_all_frames"),
                {"camera": LENS, "config": written(config)}, inputs)  # fmt: skip


def cases() -> list[Spec]:
    """In the order of the method."""
    return [*_rates(), *_growth(), _scene(), _objective(), _budget()]
