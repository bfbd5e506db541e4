"""The stage of the flexible deformation model (B1); one variant a time basis, so that both are checked."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from endotsr.equations.deformation import (
    CHANNELS,
    Basis,
    DeformationSaved,
    deformation_forward,
    deformation_reverse,
)
from endotsr.stages.stage import Asked, Found, Inputs, Settings, Stage, Variant


def _deformation(inputs: Inputs, settings: Settings) -> tuple[Found, DeformationSaved]:
    weight, centre, width = inputs["fdm_weight"], inputs["fdm_centre"], inputs["fdm_width"]
    offsets, saved = deformation_forward(weight, centre, width, float(inputs["t"]), settings["basis"])
    return {"offsets": offsets}, saved


def _deformation_reverse(cotangents: Inputs, saved: DeformationSaved) -> Found:
    return deformation_reverse(cotangents["offsets"], saved)._asdict()


def _inputs(rng: np.random.Generator, spread: float) -> dict[str, NDArray]:
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


def _variant(basis: Basis, spread: float) -> Variant:
    return Variant(
        f"deformation_{basis}",
        partial(_inputs, spread=spread),
        settings={"basis": basis},
        covers=lambda settings: settings["basis"] == basis,
    )


STAGES = [
    Stage(
        name="deformation",
        equation="B1",
        text="offsets of the flexible deformation model",
        function="endotsr.equations.deformation.deformation_forward",
        inputs={"fdm_weight": "raw parameter", "fdm_centre": "1", "fdm_width": "1", "t": "1"},
        forward=_deformation,
        asked={
            "offsets": Asked(1, "raw parameter", "last", "deformation.deformation_forward"),
            "d_fdm_weight": Asked(2, "loss per raw parameter", "last", "deformation.deformation_reverse"),
            "d_fdm_centre": Asked(2, "loss", "last", "deformation.deformation_reverse"),
            "d_fdm_width": Asked(2, "loss", "last", "deformation.deformation_reverse"),
            "d_t": Asked(2, "loss", oracle="deformation.deformation_reverse"),
        },
        reverse=_deformation_reverse,
        variants=(_variant("quartic", 1.2), _variant("gaussian", 1.8)),
    ),
]
