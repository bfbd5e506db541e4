"""Family `schedule`: learning rates, weights and switches by iteration (6), (B10).

A configuration and a list of iterations come in. The cases are the milestones of preset `paper`, with the iterations
before and after them, and a short run with the opposite choices.
"""

import numpy as np

from endotsr.config import Config, DensityConfig, LossConfig, ModelConfig, OptimiserConfig, TrainingConfig
from makers.making import Spec, given
from makers.settings import written
from makers.wrong import edit, port

OPERATIONS = ("schedule",)
MILESTONES = (1, 499, 500, 501, 600, 999, 1000, 1001, 1499, 1500, 1750, 2499, 2500, 2999, 3000, 3001, 3500, 3900, 3999,
              4000, 5999, 6000)  # fmt: skip


def _short_run() -> Config:
    return Config(
        model=ModelConfig(harmonics_degree=2),
        loss=LossConfig(lambda_lap=0.5, laplacian_from=0, laplacian_full=9, smoothness_from=5),
        optimiser=OptimiserConfig(deformation_position_factor=0.5, restart_residual_schedule=False, final_factor=0.1),
        density=DensityConfig(start=6, interval=3, until=15),
        training=TrainingConfig(iterations=20, residual_activation=8, harmonics_interval=7),
    )


def _spec(case: str, config: Config, iterations: tuple[int, ...], title: str, flags: tuple[str, ...]) -> Spec:
    inputs = {"iteration": given(np.array(iterations), ", ".join(map(str, iterations)), "iteration")}
    return Spec("schedule", case, "schedule", title, flags, {"config": written(config)}, inputs)


def cases() -> list[Spec]:
    """The published schedule and a short one."""
    flags = ("residuals_activated_late", "rates_not_decaying", "laplacian_weight_not_ramped",
             "residual_rates_not_restarted", "degree_from_one", "degree_late",
             "rates_one_step_late", "laplacian_ramp_late",
             "statistics_from_start")  # fmt: skip
    return [
        _spec("paper", Config(), MILESTONES, "Milestones of preset paper, with the iterations before and after", flags),
        _spec("shared_decay", _short_run(), tuple(range(1, 21)),
              "A short run: no restart of the residual rates, a slower position",
              ("residual_rates_restarted", "position_weights_same_rate",
               "densify_from_start", "densify_until_the_end")),
    ]  # fmt: skip


# ---- mistakes ----

SOURCE = "fitting.schedules"
BOTH = "schedule training"

WRONG_PORTS = [
    port(
        "residual_rates_not_restarted",
        "Residual rates decay from the first iteration",
        "i / T; right: (i - K_s) / (T - K_s)",
        BOTH,
        edit(
            SOURCE,
            "residual_activation if config.optimiser.restart_residual_schedule else 0",
            "residual_activation * 0",
        ),
    ),
    port(
        "residual_rates_restarted",
        "Residual rates restarted where the configuration says no",
        "(i - K_s) / (T - K_s); right: i / T",
        BOTH,
        edit(SOURCE, "residual_activation if config.optimiser.restart_residual_schedule else 0", "residual_activation"),
    ),
    port(
        "degree_from_one",
        "Harmonic degree raised one interval early",
        "1 + floor(i / interval); right: floor",
        BOTH,
        edit(
            SOURCE,
            "iteration // config.training.harmonics_interval",
            "1 + iteration // config.training.harmonics_interval",
        ),
    ),
    port(
        "degree_late",
        "Harmonic degree raised one iteration late",
        "floor((i - 1) / interval); right: floor(i / interval)",
        BOTH,
        edit(
            SOURCE,
            "iteration // config.training.harmonics_interval",
            "(iteration - 1) // config.training.harmonics_interval",
        ),
    ),
    port(
        "densify_from_start",
        "Density control at its first iteration too",
        "i >= start; right: i > start",
        BOTH,
        edit(SOURCE, "density.start < iteration < density.until", "density.start <= iteration < density.until"),
    ),
    port(
        "densify_until_the_end",
        "Density control at its last iteration too",
        "i <= until; right: i < until",
        BOTH,
        edit(SOURCE, "density.start < iteration < density.until", "density.start < iteration <= density.until"),
    ),
    port(
        "position_weights_same_rate",
        "One rate for all weights of the deformation",
        "factor of the position channels ignored; right: applied",
        BOTH,
        edit(SOURCE, "deformation * o.deformation_position_factor", "deformation"),
    ),
    port(
        "residuals_activated_late",
        "Residuals start one iteration late",
        "K_s + 2; right: K_s + 1",
        BOTH,
        edit(
            SOURCE,
            "has_any and iteration > config.training.residual_activation",
            "has_any and iteration > config.training.residual_activation + 1",
        ),
    ),
    port(
        "rates_not_decaying",
        "Learning rates do not decay",
        "constant; right: exponential to 1/100",
        BOTH,
        edit(SOURCE, "return initial * (final / initial) ** fraction", "return initial"),
    ),
    port(
        "rates_one_step_late",
        "Learning rates of the iteration before",
        "(i - 1) / T; right: i / T",
        BOTH,
        edit(SOURCE, "min(max(step / steps, 0.0), 1.0)", "min(max((step - 1) / steps, 0.0), 1.0)"),
    ),
    port(
        "laplacian_weight_not_ramped",
        "Detail weight full from the start",
        "1; right: 0, then linear",
        BOTH,
        edit(
            SOURCE,
            "    if not config.model.laplacian or iteration",
            "    if config.model.laplacian:\n        return 1.0\n    if not config.model.laplacian or iteration",
        ),
    ),
    port(
        "laplacian_ramp_late",
        "Ramp of the detail weight one iteration late",
        "i - 1; right: i",
        BOTH,
        edit(SOURCE, "(iteration - config.loss.laplacian_from) /", "(iteration - 1 - config.loss.laplacian_from) /"),
        edit(SOURCE, "iteration >= config.loss.laplacian_full", "iteration > config.loss.laplacian_full"),
    ),
    port(
        "statistics_from_start",
        "Screen gradients gathered from the start of density control only",
        "start < i < until; right: i < until",
        BOTH,
        edit(
            SOURCE,
            "return iteration < config.density.until",
            "return config.density.start < iteration < config.density.until",
        ),
    ),
]
