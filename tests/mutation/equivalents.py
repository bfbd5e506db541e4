"""Mutants that compute the same as the right source, listed by hand with the reason in `equivalents.toml`."""

import tomllib
from pathlib import Path
from typing import NamedTuple


class Group(NamedTuple):
    """Mutants that are equivalent for one reason."""

    reason: str
    names: tuple[str, ...]


def _listed() -> tuple[Group, ...]:
    with (Path(__file__).with_suffix(".toml")).open("rb") as file:
        return tuple(Group(group["reason"], tuple(group["names"])) for group in tomllib.load(file)["group"])


EQUIVALENT = _listed()


def reasons() -> dict[str, str]:
    """The reason by the name of the mutant."""
    return {name: group.reason for group in EQUIVALENT for name in group.names}
