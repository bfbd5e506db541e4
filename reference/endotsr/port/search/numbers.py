"""The number at a place of the definition that explains outputs best."""

import ast
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.relate import KNOWN, number_text

START = 1e-4  # first step from the number that changes nothing, relative to it, absolute from 0
STEPS = 6
NOTHING = 1e-4  # a smaller number is first tried as 0: outputs may be rounded to float32
LEFT = 0.02  # largest accepted fraction of the first distance
LOGICAL = (ast.BitAnd, ast.BitOr, ast.BitXor, ast.Not)  # operators of lower precedence than a sum


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
    """Plain numbers near a number, the nearest first, each with True; then the number itself with False.

    Plain are constants of the method, twelfths, and numbers of one or two digits. A number that is plain stands first,
    and not again; one below 1e-9 is 0.
    """
    if abs(number) < 1e-9:
        return [(0.0, True)]
    known = [sign * value for value in KNOWN.values() for sign in (1, -1)] + [round(number * 12) / 12]
    known += [float(f"{number:.{digits}g}") for digits in (1, 2)]
    near = [value for value in dict.fromkeys(known) if abs(value - number) <= 1e-3 * abs(number)]
    near = [0.0] if abs(number) < NOTHING else near
    plain = sorted(near, key=lambda value: abs(value - number))[:3]
    return [*((value, True) for value in plain), *([] if number in plain else [(number, False)])]


def said_number(node: ast.expr | ast.stmt, rest: float, value: float) -> str:
    """The expression with its number: times it if `rest` is 1, plus it if 0; of a constant, the other constant."""
    text = ast.unparse(node)
    if isinstance(node, ast.Constant) and rest:
        return number_text(float(ast.literal_eval(node)) * value)
    if isinstance(node, ast.Constant):
        return number_text(value)
    loose = isinstance(node, ast.IfExp | ast.Compare | ast.BoolOp) or isinstance(getattr(node, "op", None), LOGICAL)
    if loose or (rest and isinstance(node, ast.BinOp)):
        text = f"({text})"
    return f"{text} * {number_text(value)}" if rest else f"{text} {'+' if value > 0 else '-'} {number_text(abs(value))}"
