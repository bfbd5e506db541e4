"""Wrong ports: each makes one plausible mistake wherever it applies, and is right otherwise.

A wrong port is a function of a request, the reference and the right answer. Its answers give the size and the
fingerprint of the mistake in each golden case. The judge must refuse every wrong port and name its mistake.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.stages.stage import Inputs, Outputs, Settings, tidy

Run = Callable[[Inputs, Settings], Outputs]


class Request(NamedTuple):
    """The request of a case for a wrong port, with the reference and the right answer."""

    inputs: Inputs
    settings: Settings
    run: Run  # the reference of the operation
    right: Outputs


Wrong = Callable[[Request], Mapping[str, Any] | None]


class WrongPort(NamedTuple):
    """A port that makes one mistake."""

    flag: str  # the name of the mistake
    title: str
    wrong: str  # the wrong rule and the right one
    apply: Mapping[str, Wrong]  # by operation; None from the function = this case is not touched


def answer(wrong_port: WrongPort, operation: str, request: Request) -> Outputs | None:
    """The wrong answer to a request, or None where the mistake changes nothing by construction."""
    wrong = wrong_port.apply.get(operation)
    if wrong is None:
        return None
    with np.errstate(all="ignore"):
        found = wrong(request)
    if found is None:
        return None
    made = tidy(found)
    return {name: made.get(name, right).astype(right.dtype) for name, right in request.right.items()}


# ---- mistakes that occur in many families ----


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


def within(group: str, operations: tuple[str, ...], **changes: Any) -> dict[str, Wrong]:
    """The same change in a group of settings (raster, camera, loss, config) for several operations."""
    wrong = setting(**{f"{group}__{key}": value for key, value in changes.items()})
    return {operation: wrong for operation in operations}


def swapped(change: Callable[[dict[str, NDArray]], Mapping[str, NDArray]]) -> Wrong:
    """Answers to other inputs."""

    def wrong(request: Request) -> Outputs:
        inputs = dict(request.inputs)
        return request.run(inputs | dict(change(inputs)), request.settings)

    return wrong


def output(**changes: Callable[[NDArray], NDArray]) -> Wrong:
    """Changes the outputs of a right answer."""

    def wrong(request: Request) -> Outputs:
        return {name: change(request.right[name]) for name, change in changes.items() if name in request.right}

    return wrong


def scaled(factor: float, *names: str) -> Wrong:
    """These outputs times a factor."""
    return output(**dict.fromkeys(names, lambda array: array * factor))


def only(wrong: Wrong, *names: str) -> Wrong:
    """These outputs of a wrong answer; the others stay right."""

    def limited(request: Request) -> Mapping[str, Any] | None:
        found = wrong(request)
        return None if found is None else {name: found[name] for name in names if name in found}

    return limited
