"""The operations of golden cases.

Two belong only to the contract and have no equation: the layout of arrays, and the generator of the inputs. All others
are the operations of the method.
"""

import numpy as np

from endotsr.port.judge.words import fnv1a, unit_numbers, words
from endotsr.port.operations.operation import Found, Inputs, Operation, Settings
from endotsr.port.operations.registry import method_operations


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


OPERATIONS = [
    Operation(
        name="reading",
        equation="",
        text="echo parts of the inputs",
        function="",
        forward=_reading,
    ),
    Operation(
        name="generator",
        equation="",
        text="words of the written-out generator",
        function="endotsr.port.judge.words.words",
        forward=_generator,
    ),
]


def all_operations() -> dict[str, Operation]:
    """Every operation by name: the two of the contract, then the operations of the method."""
    return {operation.name: operation for operation in OPERATIONS} | method_operations()
