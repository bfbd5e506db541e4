"""Pairs of the flexible deformation model: one a time basis, so that neither basis can go unchecked."""

from functools import partial

import numpy as np

from endotsr.equations.deformation import CHANNELS, Basis, deformation_forward, deformation_reverse
from endotsr.gradcheck.registry import Arrays, Pair


def _inputs(rng: np.random.Generator, spread: float) -> dict[str, np.ndarray]:
    """Weights off zero (else centre and width have no gradient); t within `spread` widths of every centre."""
    shape = (CHANNELS, 3, 5)
    width = rng.uniform(0.05, 0.3, shape) * rng.choice([-1.0, 1.0], shape)
    t = rng.uniform(0.3, 0.7)
    side = rng.choice([-1.0, 1.0], shape)
    return {
        "fdm_weight": rng.uniform(0.2, 1.0, shape) * rng.choice([-1.0, 1.0], shape),
        "fdm_centre": t + side * np.abs(width) * rng.uniform(0.4, spread, shape),
        "fdm_width": width,
        "t": np.array(t),
    }


def _forward(inputs: Arrays, basis: Basis) -> dict[str, np.ndarray]:
    offsets, _ = deformation_forward(
        inputs["fdm_weight"], inputs["fdm_centre"], inputs["fdm_width"], float(inputs["t"]), basis
    )
    return {"offsets": offsets}


def _reverse(inputs: Arrays, cotangents: Arrays, basis: Basis) -> dict[str, np.ndarray]:
    _, saved = deformation_forward(
        inputs["fdm_weight"], inputs["fdm_centre"], inputs["fdm_width"], float(inputs["t"]), basis
    )
    grads = deformation_reverse(cotangents["offsets"], saved)
    return {
        "fdm_weight": grads.weight,
        "fdm_centre": grads.centre,
        "fdm_width": grads.width,
        "t": np.array(grads.t),
    }


def _pair(basis: Basis, spread: float) -> Pair:
    return Pair(
        name=f"deformation_{basis}",
        equation="B1",
        function="endotsr.equations.deformation.deformation_forward",
        inputs=partial(_inputs, spread=spread),
        forward=partial(_forward, basis=basis),
        reverse=partial(_reverse, basis=basis),
    )


PAIRS: list[Pair] = [_pair("quartic", 1.2), _pair("gaussian", 1.8)]
