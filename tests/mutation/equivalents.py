"""Mutants that compute the same as the right source, listed by hand with the reason.

A name stands here as the report prints it. A test refuses names that no mutant of today's source has.
"""

from typing import NamedTuple


class Group(NamedTuple):
    """Mutants that are equivalent for one reason."""

    reason: str
    names: tuple[str, ...]


EQUIVALENT: tuple[Group, ...] = (
    Group(
        "NumPy's geomspace sets both ends to the last bit already; the statements do not rely on it.",
        (
            "equations.fourier.frequencies: `omega[-1] = high if count > 1 else low` dropped",
            "equations.fourier.frequencies: `omega[0] = low` dropped",
        ),
    ),
    Group(
        "One more task, which finds nothing to do.",
        (
            "equations.atom_sums._blocks: `n + BLOCK - 1` -> `n + BLOCK` in `return (n + BLOCK - 1) // BLOCK`",
            "equations.atom_sums._blocks: `n + BLOCK - 1` -> `n + BLOCK + 1` in `return (n + BLOCK - 1) // BLOCK`",
        ),
    ),
    Group(
        "At equality both sides of the choice are the same number.",
        (
            "equations.appearance._exp_nonpositive: `z > real(SATURATED)` -> `z >= real(SATURATED)` in "
            "`z = real(SATURATED) if z > real(SATURATED) else z`",
        ),
    ),
)


def reasons() -> dict[str, str]:
    """The reason by the name of the mutant."""
    return {name: group.reason for group in EQUIVALENT for name in group.names}
