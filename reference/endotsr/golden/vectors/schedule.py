"""Family `schedule`: learning rates, weights and switches by iteration (6), (B10).

A configuration and a list of iterations come in. The cases are the milestones of preset `paper`, with the iterations
before and after them, and a short run with the opposite choices.
"""

import msgspec
import numpy as np

from endotsr.config import Config, DensityConfig, LossConfig, ModelConfig, OptimiserConfig, TrainingConfig
from endotsr.golden.vectors.making import Spec, given
from endotsr.golden.vectors.wrong import WrongPort, within

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
    return Spec("schedule", case, "schedule", title, flags, {"config": msgspec.to_builtins(config)}, inputs)


def cases() -> list[Spec]:
    """The published schedule and a short one."""
    flags = ("residuals_activated_late", "rates_not_decaying", "laplacian_weight_not_ramped",
             "residual_rates_not_restarted", "degree_from_one", "densify_from_start")  # fmt: skip
    return [
        _spec("paper", Config(), MILESTONES, "Milestones of preset paper, with the iterations before and after", flags),
        _spec("shared_decay", _short_run(), tuple(range(1, 21)),
              "A short run: no restart of the residual rates, a slower position",
              ("residual_rates_restarted", "position_weights_same_rate")),
    ]  # fmt: skip


# ---- mistakes; those of the training loop show in `training` too ----

WRONG_PORTS = [
    WrongPort("residual_rates_not_restarted", "Residual rates decay from the first iteration",
              "i / T; right: (i - K_s) / (T - K_s)",
              within("config", ("schedule",), optimiser__restart_residual_schedule=False)),
    WrongPort("residual_rates_restarted", "Residual rates restarted where the configuration says no",
              "(i - K_s) / (T - K_s); right: i / T",
              within("config", ("schedule",), optimiser__restart_residual_schedule=True)),
    WrongPort("degree_from_one", "Harmonic degree raised one interval early", "1 + floor(i / interval); right: floor",
              {"schedule": lambda r: {"degree": np.minimum(
                  r.right["degree"] + 1, r.settings["config"]["model"]["harmonics_degree"])}}),
    WrongPort("densify_from_start", "Density control at its first iteration too", "i >= start; right: i > start",
              within("config", ("schedule",), density__start=lambda v: v - 1)),
    WrongPort("position_weights_same_rate", "One rate for all weights of the deformation",
              "factor of the position channels ignored; right: applied",
              within("config", ("schedule",), optimiser__deformation_position_factor=1.0)),
    WrongPort("residuals_activated_late", "Residuals start one iteration late", "K_s + 2; right: K_s + 1",
              within("config", ("training", "schedule"), training__residual_activation=lambda k: k + 1)),
    WrongPort("rates_not_decaying", "Learning rates do not decay", "constant; right: exponential to 1/100",
              within("config", ("training", "schedule"), optimiser__final_factor=1.0)),
    WrongPort("laplacian_weight_not_ramped", "Detail weight full from the start", "1; right: 0, then linear",
              within("config", ("training", "schedule"), loss__laplacian_from=0, loss__laplacian_full=0)),
]  # fmt: skip
