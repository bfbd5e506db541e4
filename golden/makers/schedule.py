"""Family `schedule`: learning rates, weights and switches by iteration (6), (B10).

Inputs: a configuration and a list of iterations. The cases are the milestones of preset `paper`, with the iterations
before and after them, and a short run with the opposite choices.
"""

import numpy as np

from endotsr.config import Config, DensityConfig, LossConfig, ModelConfig, OptimiserConfig, TrainingConfig
from endotsr.port.operations.optimiser import RESIDUAL_RATES
from makers.making import Spec, given
from makers.operations import Declared, Judged
from makers.settings import written

RATES = [
    "position", "quaternion", "log_scale", "opacity_logit", "harmonics_base", "harmonics_rest", "fdm_weight_position",
    "fdm_weight_other", "fdm_centre", "fdm_width", *RESIDUAL_RATES,
]  # fmt: skip
DECLARED = {
    "schedule": Declared(
        {
            **{f"rate_{name}": Judged(1, "per step", oracle="schedules.learning_rates") for name in RATES},
            "laplacian_weight": Judged(1, oracle="schedules.learning_rates"),
            **{
                name: Judged(1, scale="exact", oracle="schedules.learning_rates")
                for name in ("degree", "residuals", "smoothness", "gathers", "densifies")
            },
        },
        "`config` as in `training`, at the iterations `iteration`. `rate_harmonics_base` is that of `harmonics[0]`,"
        " `rate_harmonics_rest` of the others; `rate_fdm_weight_position` of channels 0 to 2, `rate_fdm_weight_other`"
        " of 3 to 9; rates of A and C are 0 up to K_s, and 0 throughout for a model with neither A nor S."
        " `laplacian_weight` = lambda_lap(i), and 0 throughout for a model without L; `degree` = active degree; True"
        " where residuals are evaluated (`residuals`: never for a model with neither A nor S, whatever `lambda_msp`"
        " is), smoothness counts (`smoothness`: never where its weight is 0), (B11) gathers its statistic (`gathers`)"
        " and its rule runs (`densifies`)",
        equations="(6), (B10)",
    )
}
OPERATIONS = tuple(DECLARED)
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


def schedule_spec(case: str, config: Config, iterations: tuple[int, ...], title: str, flags: tuple[str, ...]) -> Spec:
    inputs = {"iteration": given(np.array(iterations), ", ".join(map(str, iterations)), "iteration")}
    return Spec("schedule", case, "schedule", title, flags, {"config": written(config)}, inputs)


def cases() -> list[Spec]:
    """The published schedule and a short one."""
    flags = ("residuals_activated_late", "rates_not_decaying", "laplacian_weight_not_ramped",
             "residual_rates_not_restarted", "degree_from_one", "degree_late",
             "rates_one_step_late", "laplacian_ramp_late",
             "statistics_from_start")  # fmt: skip
    return [
        schedule_spec("paper", Config(), MILESTONES,
                      "Milestones of preset paper, with the iterations before and after", flags),
        schedule_spec("shared_decay", _short_run(), tuple(range(1, 21)),
              "A short run: no restart of the residual rates, a slower position",
              ("residual_rates_restarted", "position_weights_same_rate",
               "densify_from_start", "densify_until_the_end")),
    ]  # fmt: skip
