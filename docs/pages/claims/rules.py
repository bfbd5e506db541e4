"""The rules of the verdicts of docs/claims.md.

For a difference with the published value p and the 95 % interval I of its mean: I contains p and not 0: reproduced;
both: not decided; 0 and not p: not reproduced; neither: only the direction, or the opposite. A published value stands
for all values that round to it, and a published range is met if I meets it. A claim of no change is reproduced if I is
within HUNDREDTH of 0. A level is reproduced if I contains a value that rounds to the published one.
"""

from pages.store.intervals import Interval

HUNDREDTH = 0.01  # dB
LEAST_PAIRS = 3  # with fewer, no verdict


def few(pairs: int) -> str:
    """The verdict on fewer than LEAST_PAIRS seeds."""
    return f"not decided: {pairs} of {LEAST_PAIRS} seeds"


def unless_few(verdict: str, pairs: int) -> str:
    """A verdict, if there are enough seeds for one."""
    return verdict if pairs >= LEAST_PAIRS else few(pairs)


def seeds_of(count: int) -> str:
    """A number of seeds in words."""
    return "one seed" if count == 1 else f"{count} seeds"


def increment_verdict(published: float, interval: Interval, pairs: int, last: float | None = None) -> str:
    """The verdict on a difference; see the module docstring.

    last   other end of a published range, which the interval must then intersect
    """
    if interval is None or pairs < LEAST_PAIRS:
        return few(pairs)
    (low, high), (first, last) = interval, sorted((published, published if last is None else last))
    holds, nothing = low <= last and first <= high, low <= 0.0 <= high
    if holds:
        return "not decided: the interval contains 0 too" if nothing else "reproduced"
    if nothing:
        return "not reproduced"
    return "direction reproduced, size not" if (low > 0) == (published > 0) else "not reproduced: the opposite"


def no_change_verdict(interval: Interval, pairs: int) -> str:
    """The verdict on a claim that PSNR changes by less than HUNDREDTH."""
    if interval is None or pairs < LEAST_PAIRS:
        return few(pairs)
    low, high = interval
    if -HUNDREDTH <= low and high <= HUNDREDTH:
        return "reproduced"
    return "not decided: the interval is wider" if low < HUNDREDTH and high > -HUNDREDTH else "not reproduced"


def level_verdict(published: float, interval: Interval, larger_is_better: bool, unit: float) -> str:
    """The verdict on a mean.

    unit   of the last published digit
    """
    if interval is None:
        return "not decided: one seed"
    low, high = interval
    if low <= published + unit / 2 and published - unit / 2 <= high:
        return "reproduced"
    return "better than published" if (low > published) == larger_is_better else "not reproduced: worse"


def largest_verdict(ahead: list[Interval], pairs: int, larger_is_better: bool) -> str:
    """The verdict on "this step is the largest", from the intervals of its lead over each of the others."""
    known = [interval for interval in ahead if interval is not None]
    if len(known) < len(ahead) or pairs < LEAST_PAIRS:
        return few(pairs)
    signed = known if larger_is_better else [(-high, -low) for low, high in known]
    if all(low > 0 for low, _ in signed):
        return "reproduced"
    return "not reproduced" if any(high < 0 for _, high in signed) else "not decided: an interval contains 0"


def without_published(interval: Interval, pairs: int) -> str:
    """The verdict on a difference of PSNR that the paper does not state."""
    if interval is None or pairs < LEAST_PAIRS:
        return few(pairs)
    low, high = interval
    return "gains" if low > 0 else "loses" if high < 0 else "not decided: the interval contains 0"
