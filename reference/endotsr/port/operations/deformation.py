"""The operation of the flexible deformation model (B1), with one variant per time basis."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from endotsr.method.equations.deformation import CHANNELS, Basis, deformation_forward, deformation_reverse
from endotsr.port.operations.operation import PlainPair, Variant


def _inputs(rng: np.random.Generator, spread: float) -> dict[str, NDArray]:
    """Nonzero weights (otherwise centre and width have no gradient); t within `spread` widths of every centre."""
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


def _variant(basis: Basis, spread: float) -> Variant:
    return Variant(
        f"deformation_{basis}",
        partial(_inputs, spread=spread),
        settings={"basis": basis},
        covers=lambda settings: settings["basis"] == basis,
    )


OPERATIONS = [
    PlainPair(deformation_forward, deformation_reverse, "fdm_weight fdm_centre fdm_width t basis", "offsets").operation(
        "deformation",
        "B1",
        "offsets of the flexible deformation model",
        variants=(_variant("quartic", 1.2), _variant("gaussian", 1.8)),
    ),
]
