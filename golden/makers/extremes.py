"""Cases at the ends of the ranges, where ports that passed all others were wrong.

A deeply saturated residual, a rotation of angle 0, Gaussians too faint for a sum of 1, bases on either side of their
cut, an epsilon that is not small, views of the calibration between two frames, and a Gaussian that is visible in its
box but hidden by others.
"""

from typing import Any

import numpy as np

from endotsr.config import Config, DensityConfig, LossConfig, ModelConfig, OptimiserConfig, TrainingConfig
from endotsr.method.splatting.settings import EXACT
from makers.making import Seeds, Spec, changed, given, scalar
from makers.moving import BASES, LENS
from makers.pose import pose_inputs
from makers.screens import raster_settings, screen_inputs
from makers.settings import written, written_section
from makers.training import trajectory_inputs
from makers.views import logit_of

OPERATIONS = ("appearance", "pose", "composite", "deformation", "density", "training")


def _deep_saturation() -> Spec:
    """Whole columns with |x| from 20 to 30; the upstream gradients are as large as the slopes are small.

    From 20 on tanh is 1 in both precisions, so 1 - tanh^2 is 0 in every port.
    """
    seeds = Seeds("appearance", "deep_saturation")
    size = np.linspace(20.0, 30.0, 7)
    sign = np.where((np.arange(21) % 2).reshape(3, 7) > 0, -1.0, 1.0)
    first = sign * size
    second = seeds.uniform("colour_coefficients", -0.5, 0.5, 3, 7)
    d = seeds.uniform("d_residual", 0.5, 1.0, 3, 7)
    power = np.round(2 * size / np.log(2.0))
    coefficients = given(np.stack([first, second.array], axis=1),
                         "[:, 0] is 20 + 5 n / 3, negated where 7 c + n is odd; [:, 1] is "
                         + second.recipe)  # fmt: skip
    inputs = {
        "appearance_coefficients": coefficients,
        "phi_bar": given([1.0, 0.25], "1, 1/4"),
        "d_residual": changed(d, ..., d.array * 2.0**power, "times 2^round(2 |x| / ln 2) with |x| = 20 + 5 n / 3"),
    }
    return Spec("appearance", "deep_saturation", "appearance", "Columns with |x| from 20 to 30 keep their derivative",
                ("tanh_slope_cancels",), {"beta": 0.3}, inputs)  # fmt: skip


def _angles() -> list[Spec]:
    rows = (("zero", 0.0, "No rotation, where training starts: the factors are 0 / 0",
             ("rotation_factors_of_nothing",)), ("tiny", 1e-8, "A rotation of 1e-8", ()))  # fmt: skip
    return [Spec("pose", case, "pose", title, flags, {}, pose_inputs(case, size)) for case, size, title, flags in rows]


def _faint() -> Spec:
    inputs = screen_inputs(Seeds("composite", "faint"), 5, 4.0, 90.0)
    inputs["opacity_logit"] = logit_of([1e-17, 2e-17, 3e-17, 2e-17, 5e-17])
    return Spec("composite", "faint", "composite", "Opacity is a sum: 1 - T has no digit of alpha = 1e-17",
                ("opacity_from_transmittance",), raster_settings(EXACT), inputs)  # fmt: skip


def _cut(basis: str) -> Spec:
    """Exponents of 41 and 42 on either side of 60 ln 2 = 41.59, under weights of about 2^60."""
    seeds, power = Seeds("deformation", f"cut_{basis}"), np.array([41.0, 42.0, 41.25, 43.0])
    square = 0.25**2 + 1e-4
    away = np.sqrt(np.sqrt(power) * square) if basis == "quartic" else np.sqrt(2 * power * square)
    weight = seeds.uniform("fdm_weight", 0.5, 1.0, 10, 2, 4)
    text = "sqrt(sqrt(e) S)" if basis == "quartic" else "sqrt(2 e S)"
    inputs = {
        "fdm_weight": changed(weight, ..., weight.array * 2.0**60, "times 2^60"),
        "fdm_centre": given(np.broadcast_to(0.5 - away, (10, 2, 4)).copy(),
                            f"1/2 - {text}, e = (41, 42, 41.25, 43)[n], S = 1/16 + 1e-4"),
        "fdm_width": given(np.full((10, 2, 4), 0.25), "1/4"),
        "t": scalar(0.5),
        "d_offsets": seeds.uniform("d_offsets", 0.5, 1.0, 10, 4),
    }  # fmt: skip
    return Spec("deformation", f"cut_{basis}", "deformation", f"A {basis} basis below 2^-60 is exactly 0",
                ("basis_not_cut",), {"basis": basis}, inputs)  # fmt: skip


def _hidden_statistics() -> Spec:
    """Four Gaussians, visible in both views, without a gradient in one; opacity 0.01 is between thresholds."""
    count, seeds = 4, Seeds("density", "hidden")
    d = np.zeros((2, 2, count))
    d[0] = [[0.046875, 2.0**-5, 2.0**-4, 2.0**-3], [0.0, 2.0**-5, 2.0**-4, 0.0]]
    d[1, :, 3] = 2.0**-3
    inputs = {
        "position": seeds.uniform("position", -2.0, 2.0, 3, count, unit="scene unit"),
        "quaternion": seeds.uniform("quaternion", -1.0, 1.0, 4, count),
        "log_scale": seeds.uniform("log_scale", -0.5, 0.5, 3, count),
        "opacity_logit": logit_of([0.5, 0.01, 0.4, 0.3]),
        "d_mean2d": given(d, "view 0: (3/64, 0), (1/32, 1/32), (1/16, 1/16), (1/8, 0); view 1: 0, 0, 0, (1/8, 1/8)",
                          "loss per px"),
        "visible": given(np.ones((2, count), bool), "all True"),
        "split_noise": seeds.uniform("split_noise", -1.5, 1.5, 2, 3, count),
        "rotation_matrices": given(np.stack([np.eye(3)] * 2), "identity"),
        "translations": given(np.zeros((2, 3)), "0"),
    }  # fmt: skip
    config = written_section(DensityConfig(gradient_threshold=0.25, extent=30.0))
    return Spec("density", "hidden", "density", "A view without a gradient counts where the Gaussian is visible",
                ("visits_with_gradient_only",), {"width": 16, "height": 8, "density": config}, inputs)  # fmt: skip


def _hidden_in_training() -> Spec:
    """Gaussian 4 is small and behind three opaque Gaussians, which finish every pixel of its box."""
    config = Config(
        model=ModelConfig(bases=BASES, harmonics_degree=0, appearance=False, spectral_motion=False, laplacian=False),
        loss=LossConfig(smoothness_weight=0.0, lambda_lap=0.0),
        optimiser=OptimiserConfig(epsilon=1e-4),
        density=DensityConfig(start=1, interval=2, until=4, gradient_threshold=0.02, extent=30.0),
        training=TrainingConfig(iterations=4),
    )
    inputs = trajectory_inputs(Seeds("training", "hidden"), 4, 0)
    five = slice(0, 5)

    def put(name: str, values: Any, recipe: str, at: object = (slice(None), five)) -> None:
        inputs[name] = changed(inputs[name], at, values, recipe)

    put(
        "position",
        [[0.0] * 5, [0.0] * 5, [1.25, 1.375, 1.5, 1.625, 2.0]],
        "0..4 are (0, 0, z), z = 1.25, 1.375, 1.5, 1.625, 2",
    )
    put("log_scale", [[0.0, 0.0, 0.0, 0.0, -4.0]] * 3, "0..4 are 0, 0, 0, 0, -4")
    put("opacity_logit", [4.0, 4.0, 4.0, 4.0, 0.0], "0..4 are 4, 4, 4, 4, 0", five)
    title = "A Gaussian that is visible in its box and hidden by opaque ones counts as visible"
    return Spec("training", "hidden", "training", title, ("visits_with_gradient_only",),
                {"camera": LENS, "config": written(config)}, inputs)  # fmt: skip


def cases() -> list[Spec]:
    """One case for each end of a range."""
    return [_deep_saturation(), *_angles(), _faint(), _cut("quartic"), _cut("gaussian"), _hidden_statistics(),
            _hidden_in_training()]  # fmt: skip
