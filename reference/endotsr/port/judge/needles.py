"""A result with advice of its own: every output that is not right belongs to needles.

The textbook conic loses digits of slanted needles to cancellation. The report does not examine whether a port computes
it in this way.

In: the outputs that are not right. Out: how far off the needles are, and formulas that keep their digits.
"""

from collections.abc import Iterable
from typing import NamedTuple

NEEDLE = "needle"  # in the name of a case with long thin Gaussians
REWRITE = (
    "Look at the conic: (c dx^2 - 2 b dx dy + a dy^2) / (a c - b^2) subtracts nearly equal numbers for a slanted "
    "needle. Take the determinant as a sum of squares, page (B3): det = e^2 + e sum(M^2) + the sum over k < n of "
    "(S_k S_n (T_0k T_1n - T_0n T_1k))^2, with M = T diag(S), T = J W R and the low-pass e; and the distance as one, "
    "page (B5): dy^2 / c + (c / det) (dx - (b / c) dy)^2"
)


class Off(NamedTuple):
    """An output that is not right."""

    case: str
    output: str
    ratio: float | None
    """its distance from the expected array, in tolerances; None if it has none"""


def only_needles(off: Iterable[Off]) -> list[str]:
    """Two lines if every output that is not right belongs to needles and has a distance, else nothing."""
    off = list(off)
    if not off or any(NEEDLE not in one.case for one in off) or any(one.ratio is None for one in off):
        return []
    cases = ", ".join(sorted({one.case for one in off}))
    ratios = [one.ratio for one in off if one.ratio is not None]
    size = f"{min(ratios):.2g} to {max(ratios):.2g} times" if len(ratios) > 1 else f"{ratios[0]:.2g} times"
    names = ", ".join(sorted({one.output for one in off}))
    return [f"only needles fail: {cases}, {size} the tolerance ({names})", f"  {REWRITE}"]
