"""Decisions of other programs, each as a change of the definition that may touch several expressions.

In: texts of the definition and what another program has in their place (`screen.py`, `images.py`). Out: the changed
functions, compiled, for `decisions.py`, which tries them against the outputs of the port.
"""

import ast
import inspect
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any, NamedTuple

from endotsr.port.search.places import ROOM, Spot, Statement, syntax


class Convention(NamedTuple):
    """What another program does, and the texts of the definition that it changes."""

    said: str
    changes: tuple[tuple[str, str, str], ...]
    """function or constant as `module.name`, its text, and the other text; the text stands there once when the changes
    before it are made"""


class ChangedDefinition(NamedTuple):
    """A convention as code, the line it changes first, and the functions and constants it changes."""

    said: str
    spot: Spot
    install: Callable[[], Any]
    names: frozenset[str]


def prepared(convention: Convention) -> ChangedDefinition:
    """The changed functions, compiled. Raises: ValueError if a text does not stand in its place exactly once."""
    texts: dict[str, str] = {}
    for name, old, new in convention.changes:
        text = texts.get(name) or _source(name)
        if text.count(old) != 1:
            raise ValueError(f"{convention.said}: {text.count(old)} places in {name}, where 1 is expected: {old!r}")
        texts[name] = text.replace(old, new)
    installs = [_statement(name, ast.parse(text).body[0]).compiled() for name, text in texts.items()]

    first, old, _ = convention.changes[0]
    statement = _node(first)
    place = _statement(first, statement)
    line = statement.lineno + _source(first).partition(old)[0].count("\n")
    marked = ast.copy_location(ast.Pass(), statement)
    marked.lineno = line
    return ChangedDefinition(convention.said, Spot(place, marked, ()), together(installs), frozenset(texts))


def together(installs: Sequence[Callable[[], Any]]) -> Callable[[], Any]:
    """One function that installs several changes, and returns a function that undoes all of them."""

    def install() -> Callable[[], Any]:
        with ExitStack() as undone:
            for one in installs:
                undone.callback(one())
            return undone.pop_all().close

    return install


def _statement(name: str, node: Any) -> Statement:
    module = sys.modules[f"{ROOM}.{name.partition('.')[0]}"]
    phases = frozenset({"reverse"} if name.endswith("_reverse") else {"forward", "reverse"})
    return Statement(module, node, phases)


def _node(name: str) -> Any:
    """The function or the constant in the syntax tree of its module."""
    module, _, own = name.partition(".")
    for node in syntax(sys.modules[f"{ROOM}.{module}"]).body:
        named = [n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name)] if (
            isinstance(node, ast.Assign)
        ) else [getattr(node, "name", "")]  # fmt: skip
        if own in named:
            return node
    raise ValueError(f"no {own} in the definition's {module}")


def _source(name: str) -> str:
    node, module = _node(name), sys.modules[f"{ROOM}.{name.partition('.')[0]}"]
    lines: Sequence[str] = inspect.getsource(module).splitlines()
    return "\n".join(lines[node.lineno - 1 : node.end_lineno])
