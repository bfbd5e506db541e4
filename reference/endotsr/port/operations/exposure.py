"""Operation of the exposure of one frame (B13)."""

import numpy as np
from numpy.typing import NDArray

from endotsr.method.equations.exposure import exposure_forward, exposure_reverse
from endotsr.port.operations.operation import PlainPair, Variant


def _inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Colours on both sides of 0 and 1: nothing is clamped."""
    return {
        "colour": rng.uniform(-0.2, 1.3, (3, 5, 7)),
        "log_gain": rng.normal(0, 0.4, 3),
        "bias": rng.normal(0, 0.2, 3),
    }


OPERATIONS = [
    PlainPair(exposure_forward, exposure_reverse, "colour log_gain bias", "exposed").operation(
        "exposure", "B13", "gain and bias of a frame", variants=(Variant("exposure", _inputs),)
    )
]
