"""Stage of the exposure of one frame (B13)."""

import numpy as np
from numpy.typing import NDArray

from endotsr.equations.exposure import ExposureSaved, exposure_forward, exposure_reverse
from endotsr.stages.stage import Asked, Found, Inputs, Settings, Stage, Variant


def _exposure(inputs: Inputs, settings: Settings) -> tuple[Found, ExposureSaved]:
    exposed, saved = exposure_forward(inputs["colour"], inputs["log_gain"], inputs["bias"])
    return {"exposed": exposed}, saved


def _reverse(cotangents: Inputs, saved: ExposureSaved) -> Found:
    return exposure_reverse(cotangents["exposed"], saved)._asdict()


def _inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Colours on both sides of 0 and 1: nothing is clamped."""
    return {
        "colour": rng.uniform(-0.2, 1.3, (3, 5, 7)),
        "log_gain": rng.normal(0, 0.4, 3),
        "bias": rng.normal(0, 0.2, 3),
    }


STAGES = [
    Stage(
        name="exposure",
        equation="B13",
        text="gain and bias of a frame",
        function="endotsr.equations.exposure.exposure_forward",
        inputs={"colour": "display", "log_gain": "1", "bias": "display"},
        forward=_exposure,
        asked={
            "exposed": Asked(1, "display", oracle="exposure.exposure_forward"),
            "d_colour": Asked(2, "loss per display", oracle="exposure.exposure_reverse"),
            "d_log_gain": Asked(2, "loss", oracle="exposure.exposure_reverse"),
            "d_bias": Asked(2, "loss per display", oracle="exposure.exposure_reverse"),
        },
        reverse=_reverse,
        variants=(Variant("exposure", _inputs),),
    )
]
