"""Wrong ports: each makes one mistake that people make, everywhere it can be made, and is right otherwise.

A wrong port is a function of a request, the reference and the right answer. From these the golden cases learn how large
a mistake is and what its fingerprint is; the judge must refuse every one of them and say which it is.
"""

import importlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.stages.stage import Inputs, Outputs, Settings, tidy

MODULES = (
    "negative_equations",
    "negative_losses",
    "negative_splatting",
    "negative_fitting",
    "negative_scene",
    "negative_edges",
)

Run = Callable[[Inputs, Settings], Outputs]


class Request(NamedTuple):
    """What a wrong port is asked, and how it may be answered rightly."""

    inputs: Inputs
    settings: Settings
    run: Run  # the reference of the operation
    right: Outputs


Wrong = Callable[[Request], Mapping[str, Any] | None]


class Negative(NamedTuple):
    """One mistake."""

    name: str  # the flag
    title: str
    wrong: str  # what is done, and what would be right
    apply: Mapping[str, Wrong]  # by operation; None from the function = this case is not touched


def answer(negative: Negative, operation: str, request: Request) -> Outputs | None:
    """The wrong answer to a request, or None where the mistake changes nothing by construction."""
    wrong = negative.apply.get(operation)
    if wrong is None:
        return None
    with np.errstate(all="ignore"):
        found = wrong(request)
    if found is None:
        return None
    made = tidy(found)
    return {name: made.get(name, right).astype(right.dtype) for name, right in request.right.items()}


def all_negatives() -> dict[str, Negative]:
    """Every wrong port by name."""
    found: dict[str, Negative] = {}
    for module in MODULES:
        for negative in importlib.import_module(f"endotsr.golden.{module}").NEGATIVES:
            if negative.name in found:
                raise ValueError(f"wrong port {negative.name} is named twice")
            found[negative.name] = negative
    return found


# ---- three ways to be wrong ----


def setting(**changes: Any) -> Wrong:
    """Answers with other settings; a callable value gets the old one. Nested with a double underscore."""

    def wrong(request: Request) -> Outputs | None:
        settings = dict(request.settings)
        touched = False
        for key, value in changes.items():
            touched |= _replace(settings, key.split("__"), value)
        return request.run(request.inputs, settings) if touched else None

    return wrong


def _replace(settings: dict[str, Any], keys: list[str], value: Any) -> bool:
    first, *rest = keys
    if first not in settings:
        return False
    if rest:
        settings[first] = dict(settings[first])
        return _replace(settings[first], rest, value)
    old = settings[first]
    settings[first] = value(old) if callable(value) else value
    return settings[first] != old


def swapped(change: Callable[[dict[str, NDArray]], Mapping[str, NDArray]]) -> Wrong:
    """Answers to other inputs."""

    def wrong(request: Request) -> Outputs:
        inputs = dict(request.inputs)
        return request.run(inputs | dict(change(inputs)), request.settings)

    return wrong


def output(**changes: Callable[[NDArray], NDArray]) -> Wrong:
    """Changes outputs after the fact."""

    def wrong(request: Request) -> Outputs:
        return {name: change(request.right[name]) for name, change in changes.items() if name in request.right}

    return wrong


def only(*names: str) -> Callable[[Wrong], Wrong]:
    """Of a wrong answer keep these outputs."""

    def limit(wrong: Wrong) -> Wrong:
        def limited(request: Request) -> Mapping[str, Any] | None:
            found = wrong(request)
            return None if found is None else {name: found[name] for name in names if name in found}

        return limited

    return limit
