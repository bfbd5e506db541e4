"""Mutants that compute the same as the right source, listed by hand with the reason.

A name stands here as the report prints it. A test refuses names that no mutant of today's source has.
"""

from typing import NamedTuple


class Group(NamedTuple):
    """Mutants that are equivalent for one reason."""

    reason: str
    names: tuple[str, ...]


EQUIVALENT: tuple[Group, ...] = ()


def reasons() -> dict[str, str]:
    """The reason by the name of the mutant."""
    return {name: group.reason for group in EQUIVALENT for name in group.names}
