"""The number at a place of the definition that explains outputs best."""

import ast
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.relate import KNOWN, number_text

START = 1e-4  # first relative step from the number that changes nothing
STEPS = 6
NOTHING = 1e-4  # a smaller factor may be 0, if outputs are rounded to float32
LEFT = 0.02  # largest accepted fraction of the first distance


def best_number(off: Callable[[float], NDArray | None], rest: float, before: NDArray | None) -> float | None:
    """The number at which secants of the differences end; None if it has no influence or does not fit.

    off      number -> differences; None = undefined
    rest     the number that changes nothing
    before   the differences there
    """
    k, last = rest + START * (abs(rest) or 1.0), rest
    now = off(k)
    if before is None or now is None:
        return None
    size = float(np.linalg.norm(before))
    for _ in range(STEPS):
        slope = (now - before) / (k - last)
        steep = float(slope @ slope)
        if steep < 1e-18:
            return None
        last, before, k = k, now, k - float(slope @ now) / steep
        found = off(k) if np.isfinite(k) else None
        if found is None:
            return None
        now = found
        if abs(k - last) <= 1e-13 * abs(k) or np.linalg.norm(now) < 1e-14 * size:
            break
    return k if np.linalg.norm(now) < LEFT * size else None


def plain_first(number: float) -> list[tuple[float, bool]]:
    """Nearby numbers, with a flag for constants of the method and numbers of few digits; the number itself is last."""
    if abs(number) < 1e-9:
        return [(0.0, True)]
    known = [sign * value for value in KNOWN.values() for sign in (1, -1)] + [round(number * 12) / 12]
    known += [float(f"{number:.{digits}g}") for digits in (1, 2)]
    near = [value for value in dict.fromkeys(known) if value != number and abs(value - number) <= 1e-3 * abs(number)]
    near = [0.0] if abs(number) < NOTHING else near
    return [*((value, True) for value in sorted(near, key=lambda value: abs(value - number))[:3]), (number, False)]


def said_number(node: ast.expr | ast.stmt, rest: float, value: float) -> str:
    """The expression with its number."""
    text = ast.unparse(node)
    if isinstance(node, ast.Constant) and rest:
        return number_text(float(ast.literal_eval(node)) * value)
    if isinstance(node, ast.Constant):
        return number_text(value)
    if rest == 0.0:
        return f"{text} {'+' if value > 0 else '-'} {number_text(abs(value))}"
    return f"({text}) * {number_text(value)}" if isinstance(node, ast.BinOp) else f"{text} * {number_text(value)}"
