"""Ports whose functions can be exchanged for wrong versions while they answer the golden cases in memory."""

import importlib
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "unseen/by_hand"), str(Path(__file__).parents[2])]
import hand_port  # noqa: E402
from mutants.kinds import Source  # noqa: E402

from endotsr.port.operations.definition import definition_operations  # noqa: E402
from endotsr.port.reference import stored  # noqa: E402

NOT_ASKED = ("__init__", "__main__", "metrics", "settings", "simulate")  # no operation of the cases runs them


class Port(NamedTuple):
    """A port as source, and its answer to (operation, inputs, settings)."""

    sources: list[Source]
    operations: frozenset[str]
    answer: Callable[[str, Mapping[str, Any], Mapping[str, Any]], dict[str, Any]]

    @property
    def names(self) -> dict[Any, str]:
        """module.function by code."""
        return {f.__code__: f"{s.name}.{n}" for s in self.sources for n, f in s.functions.items()}


def definition() -> Port:
    """The definition in NumPy."""
    folder = Path(importlib.import_module("endotsr.definition").__file__ or "").parent
    operations, sources = definition_operations(), []
    for path in (path for path in sorted(folder.glob("*.py")) if path.stem not in NOT_ASKED):
        module = importlib.import_module(f"endotsr.definition.{path.stem}")
        functions = {n: f for n, f in vars(module).items() if getattr(f, "__module__", "") == module.__name__}
        vars(module).setdefault("np", np)  # the changes use it
        sources.append(Source(path.stem, path.read_text("utf-8"), _plain(functions)))

    def answer(operation: str, inputs: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
        found = operations[operation].compute(inputs, dict(settings))
        return {name: stored(np.asarray(value)) for name, value in found.items()}

    return Port(sources, frozenset(operations), answer)


def by_hand() -> Port:
    """The port that was written from the specification alone (tests/port/unseen/by_hand)."""
    port, texts = hand_port.operations(), hand_port.sources()
    rooms = {f.__globals__["__name__"]: f.__globals__ for f in port.values()}
    sources = []
    for name in rooms.keys() & texts.keys():
        own = {n: f for n, f in _plain(rooms[name]).items() if f.__globals__ is rooms[name]}
        sources.append(Source(name, texts[name], own))
    known = frozenset(hand_port.OPERATIONS) & frozenset(port)
    return Port(sorted(sources), known, lambda *asked: hand_port.answer(port, *asked))


def _plain(functions: Mapping[str, Any]) -> dict[str, Any]:
    """Those with code of their own."""
    return {name: one for name, one in functions.items() if hasattr(one, "__code__")}
