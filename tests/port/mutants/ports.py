"""Ports whose functions can be exchanged for wrong versions while they answer the golden cases in memory."""

import importlib
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "unseen/by_hand"), str(Path(__file__).parents[2])]
import hand_port

from endotsr.port.reference import stored
from endotsr.port.stages.definition import definition_stages
from mutants.kinds import Source

NOT_ASKED = ("simulate", "metrics", "__main__", "settings")  # no operation of the cases runs them


class Port(NamedTuple):
    """A port as source, and its answer to (operation, inputs, settings)."""

    sources: list[Source]
    operations: frozenset[str]
    answer: Callable[[str, Mapping[str, Any], Mapping[str, Any]], dict[str, Any]]


def definition() -> Port:
    """The definition in NumPy."""
    folder = Path(importlib.import_module("endotsr.definition").__file__ or "").parent
    stages, sources = definition_stages(), []
    for path in sorted(folder.glob("*.py")):
        if path.stem not in (*NOT_ASKED, "__init__"):
            module = importlib.import_module(f"endotsr.definition.{path.stem}")
            own = {n: f for n, f in vars(module).items() if getattr(f, "__module__", "") == module.__name__}
            functions = {n: f for n, f in own.items() if hasattr(f, "__code__")}
            vars(module).setdefault("np", np)  # the changes use it
            sources.append(Source(path.stem, path.read_text(encoding="utf-8"), functions))

    def answer(operation: str, inputs: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
        found = stages[operation].compute(inputs, dict(settings))
        return {name: stored(np.asarray(value)) for name, value in found.items()}

    return Port(sources, frozenset(stages), answer)


def by_hand() -> Port:
    """The port that was written from the specification alone (tests/port/unseen/by_hand)."""
    port, texts = hand_port.operations(), hand_port.sources()
    rooms = {id(f.__globals__): f.__globals__ for f in port.values()}
    sources = [
        Source(name, text, {n: f for n, f in room.items() if hasattr(f, "__code__") and f.__globals__ is room})
        for name, text in texts.items()
        for room in rooms.values()
        if room["__name__"] == name
    ]
    return Port(sources, frozenset(hand_port.OPERATIONS) & frozenset(port), lambda *asked: hand_port.answer(port, *asked))
