"""Pair of the exposure of one frame, equation (B13)."""

import numpy as np
from numpy.typing import NDArray

from endotsr.equations.exposure import exposure_forward, exposure_reverse
from endotsr.gradcheck.registry import Arrays, Pair

CHANNELS, HEIGHT, WIDTH = 3, 5, 7


def _inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    return {
        "colour": rng.uniform(-0.2, 1.3, (CHANNELS, HEIGHT, WIDTH)),
        "log_gain": rng.normal(0, 0.4, CHANNELS),
        "bias": rng.normal(0, 0.2, CHANNELS),
    }


def _forward(inputs: Arrays) -> dict[str, NDArray]:
    return {"exposed": exposure_forward(inputs["colour"], inputs["log_gain"], inputs["bias"])[0]}


def _reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    _, saved = exposure_forward(inputs["colour"], inputs["log_gain"], inputs["bias"])
    return exposure_reverse(cotangents["exposed"], saved)._asdict()


PAIRS: list[Pair] = [
    Pair("exposure", "B13", "endotsr.equations.exposure.exposure_forward", _inputs, _forward, _reverse)
]
