"""Family `matern`: equation (4), the Matern weights rho and the penalty on the motion coefficients.

Frequencies, coefficients and a correlation length come in. The lengths are the published one, 0 (all weights alike) and
a long one (weights like omega^6); they fix the mean 1 of the weights, the factor 2 pi, the power, and the order of the
weights along the atoms.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.clock import omegas
from endotsr.golden.vectors.making import Seeds, Spec, scalar
from endotsr.golden.vectors.wrong import Request, Wrong, WrongPort, scaled

OPERATIONS = ("matern",)


def cases() -> list[Spec]:
    """Three correlation lengths."""
    everything = ("matern_sum_one", "matern_inverted", "matern_without_two_pi", "matern_wrong_power",
                  "penalty_over_two", "penalty_interleaved")  # fmt: skip
    out = []
    for case, length, count, title, flags in (
        ("published", 0.2, 8, "Weights of mean 1, penalty over 6 N F", everything),
        ("short", 0.0, 4, "l = 0 weighs all alike", ("penalty_over_two", "matern_sum_one")),
        ("long", 5.0, 4, "A long correlation weighs like omega^6",
         ("matern_sum_one", "matern_inverted", "matern_wrong_power", "penalty_over_two")),
    ):  # fmt: skip
        seeds = Seeds("matern", case)
        inputs = {
            "omega": omegas(count),
            "motion_coefficients": seeds.uniform("motion_coefficients", -0.5, 0.5, 3, 2 * count, 6, unit="scene unit"),
            "d_penalty": scalar(1.5),
        }
        out.append(Spec("matern", case, "matern", title, flags, {"correlation_length": length}, inputs))
    return out


# ---- mistakes ----


def _weighted(density: Callable[[float, NDArray], NDArray]) -> Wrong:
    """Answers with weights rho(l, angular frequency) of any normalisation."""

    def wrong(request: Request) -> dict[str, Any]:
        length, omega = request.settings["correlation_length"], request.inputs["omega"].astype(float)
        rho = density(length, omega)
        c, up = request.inputs["motion_coefficients"], float(request.inputs["d_penalty"])
        both = np.concatenate([rho, rho])[None, :, None]
        norm = c.size  # 3 * 2F * N
        return {
            "rho": rho,
            "penalty": (both * c**2).sum() / norm,
            "d_motion_coefficients": up * 2 * both * c / norm,
        }

    return wrong


def _raw(length: float, angular: NDArray, power: float = 3.0) -> NDArray:
    return (5 + (length * angular) ** 2) ** power


def _mean_one(rho: NDArray) -> NDArray:
    return rho / rho.mean()


def _interleaved_penalty(request: Request) -> dict[str, Any]:
    c, rho, up = request.inputs["motion_coefficients"], request.right["rho"], float(request.inputs["d_penalty"])
    both = np.repeat(rho, 2)[None, :, None]
    return {"penalty": (both * c**2).sum() / c.size, "d_motion_coefficients": up * 2 * both * c / c.size}


WRONG_PORTS = [
    WrongPort("matern_sum_one", "Matern weights scaled to sum 1", "sum; right: mean 1",
              {"matern": _weighted(lambda l, w: _mean_one(_raw(l, 2 * np.pi * w)) / w.size)}),
    WrongPort("matern_inverted", "Spectral density itself as weight", "low frequencies pay; right: high ones",
              {"matern": _weighted(lambda l, w: _mean_one(_raw(l, 2 * np.pi * w, -3.0)))}),
    WrongPort("matern_without_two_pi", "Matern weights of w in place of 2 pi w", "5/l^2 + w^2; right: (2 pi w)^2",
              {"matern": _weighted(lambda l, w: _mean_one(_raw(l, w)))}),
    WrongPort("matern_wrong_power", "Power of Matern-3/2 or 5/2 in place of 3", "^(5/2); right: ^3",
              {"matern": _weighted(lambda l, w: _mean_one(_raw(l, 2 * np.pi * w, 2.5)))}),
    WrongPort("penalty_over_two", "Penalty over 2 N F", "sum over axes; right: 1 / (6 N F)",
              {"matern": scaled(3.0, "penalty", "d_motion_coefficients")}),
    WrongPort("penalty_interleaved", "Weights of interleaved atoms in the penalty",
              "rho repeated pairwise; right: rho for the sines, then for the cosines",
              {"matern": _interleaved_penalty}),
]  # fmt: skip
