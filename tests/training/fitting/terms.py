"""The terms of the objective: each is the operation whose functions are in the module `my_term` or `masked_my_term`.

A term is a field of `LossWeights`. What its operation reads has the names of the golden cases.
"""

import msgspec
import numpy as np
import pytest

from endotsr.config import PAPER
from endotsr.method.equations.laplacian import LEVELS
from endotsr.port.operations.registry import method_operations
from endotsr.training.fitting import objective
from endotsr.training.fitting.objective import LossWeights

TERMS = LossWeights._fields
SETTINGS = {**msgspec.to_builtins(PAPER.loss), "levels": LEVELS}


def is_of(function: str, term: str) -> bool:
    """Whether a dotted module is that of a term."""
    return function.rpartition(".")[2] in (term, f"masked_{term}")


def forward_functions(term: str) -> list[str]:
    """The forward functions of a term that the objective calls, by their name there."""
    found = [name for name, one in vars(objective).items() if name.endswith("_forward") and is_of(one.__module__, term)]
    assert found, f"objective.py calls no function {term}_forward of a module {term} or masked_{term}"
    return found


def alone(term: str, rendered, frame, cotangent: float = 1.0):
    """Value of a term, and its gradients by colour and by depth times the cotangent; 0 for a gradient that it lacks."""
    (operation,) = [one for one in method_operations().values() if is_of(one.function.rpartition(".")[0], term)]
    inputs = {
        "rendered": rendered.colour,
        "rendered_depth": rendered.depth,
        "observed": np.where(frame.mask, frame.image, 0),
        "mask": frame.mask,
        "prior_depth": frame.depth,
        "edges": objective.canny_edges(rendered.depth),
    }
    try:
        outputs, saved = operation.forward(inputs, SETTINGS)
    except KeyError as error:
        pytest.fail(f"the operation of {term} reads {error}: add it to the inputs in tests/training/fitting/terms.py")
    ((name, value),) = outputs.items()
    back = operation.reverse({name: np.array(cotangent)}, saved)
    assert back.keys() <= {"d_rendered", "d_rendered_depth"}
    return value, back.get("d_rendered", 0), back.get("d_rendered_depth", 0)
