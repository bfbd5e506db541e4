"""The operations of golden cases.

Two belong only to the contract and have no equation: the layout of arrays, and the generator of the inputs. All others
are the stages of the method.
"""

import numpy as np

from endotsr.port.judge.words import fnv1a, unit_numbers, words
from endotsr.port.stages.registry import all_stages
from endotsr.port.stages.stage import Found, Inputs, Settings, Stage


def _reading(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    array, mask = inputs["harmonics"], inputs["mask"]
    return {
        "column": np.array(array[..., settings["gaussian"]]),
        "flat": array.reshape(-1),
        "scalar": np.array(inputs["scalar"]),
        "empty": np.array(inputs["empty"]),
        "tissue_pixels": np.array(int(mask.sum()), np.int64),
        "tissue_row": np.flatnonzero(mask[settings["row"]]).astype(np.int64),
        "sample_x": (np.arange(mask.shape[1]) + 0.5).astype(array.dtype),
        "sample_y": (np.arange(mask.shape[0]) + 0.5).astype(array.dtype),
    }, None


def _generator(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    found = words(fnv1a(settings["seed"]), settings["count"])
    return {"words": found, "unit_numbers": unit_numbers(found)}, None


STAGES = [
    Stage(
        name="reading",
        equation="",
        text="echo parts of the inputs",
        function="",
        forward=_reading,
    ),
    Stage(
        name="generator",
        equation="",
        text="words of the written-out generator",
        function="endotsr.port.judge.words.words",
        forward=_generator,
    ),
]


def all_operations() -> dict[str, Stage]:
    """Every operation by name: the two of the contract, then the stages of the method."""
    return {stage.name: stage for stage in STAGES} | all_stages()
