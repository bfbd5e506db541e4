"""Variants of the compositing kernels, only for this study: other exponentials, other tiles.

A variant is the body of the package's kernel, recompiled with a few of its names bound to other values; no code is
repeated. Variants of the fast path are compiled like the fast path, with contraction.
"""

import contextlib
import functools
import types
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from endotsr.method.kernels.jit import jit, jit_inline
from endotsr.method.splatting import compositing
from endotsr.method.splatting.fast import blocks as compositing_blocks


class Variant(NamedTuple):
    """Kernels that differ from the package's: a value of `Setting.kernels`."""

    exponential: int | None = None  # degree of the polynomial for 2^x; None = unchanged
    tile: int | None = None  # side of the tiles of the path `definition`; None = 16

    def __call__(self) -> contextlib.AbstractContextManager[None]:
        """Render with these kernels within the block."""
        return kernels_of(self)


COEFFICIENTS = (1.0,)  # placeholder for the coefficients of a variant, highest power first


def _exp2_polynomial(x):
    """2^x for float64 x <= 0, as `exp2_nonpositive` but with the polynomial COEFFICIENTS on (-1, 0]."""
    x = max(x, np.float64(-1022))
    k = np.int64(x)
    f = x - np.float64(k)
    p = np.float64(0)
    for c in COEFFICIENTS:
        p = p * f + c
    return p * np.int64((k + np.int64(1023)) << np.int64(52)).view(np.float64)


def exponential_coefficients(degree: int) -> tuple[float, ...]:
    """Interpolation of 2^f at the Chebyshev nodes of [-1, 0], highest power first."""
    found = Chebyshev.interpolate(np.exp2, degree, domain=[-1, 0]).convert(kind=Polynomial)
    return tuple(float(c) for c in found.coef[::-1])


def rebound(function: Callable[..., Any], variant: str, **names: Any) -> Callable[..., Any]:
    """The same body with `names` bound to other values; `variant` identifies its compiled form in the cache."""
    made = types.FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)
    made.__qualname__ = f"{function.__qualname__}.{variant}"
    made.__module__ = function.__module__
    return made


@functools.cache
def _blocks_with_exponential(degree: int) -> dict[str, Any]:
    """The kernels of the fast path with a polynomial of this degree, by their names in the fast path."""
    name, fast = f"degree{degree}", compositing_blocks
    exp2 = jit_inline(rebound(_exp2_polynomial, name, COEFFICIENTS=exponential_coefficients(degree)))
    found = {}
    for ending in ("", "_reverse"):
        block = jit_inline(rebound(getattr(fast, f"_blend_block{ending}"), name, exp2_nonpositive=exp2))
        body = rebound(getattr(fast, f"_blend{ending}"), name, **{f"_blend_block{ending}_kernel": block})
        found[f"_blend{ending}_kernel"] = jit(body, contract=True)
    return found


@functools.cache
def _definition_with_tiles(side: int) -> dict[str, Any]:
    """Tile size and kernels of the path `definition` with square tiles of this side."""
    found: dict[str, Any] = {"TILE_WIDTH": side, "TILE_HEIGHT": side}
    sizes = dict(found)
    for ending in ("", "_reverse"):
        body = rebound(getattr(compositing, f"_composite{ending}"), f"tile{side}", **sizes)
        found[f"_composite{ending}_kernel"] = jit(body)
    return found


@contextlib.contextmanager
def kernels_of(variant: Variant) -> Iterator[None]:
    """Render with the kernels of the variant within the block."""
    changes: list[tuple[types.ModuleType, dict[str, Any]]] = []
    if variant.exponential is not None:
        changes.append((compositing_blocks, _blocks_with_exponential(variant.exponential)))
    if variant.tile not in (None, compositing.TILE_WIDTH):
        changes.append((compositing, _definition_with_tiles(variant.tile)))
    kept = [(module, {name: getattr(module, name) for name in names}) for module, names in changes]
    try:
        _bind(changes)
        yield
    finally:
        _bind(kept)


def _bind(changes: list[tuple[types.ModuleType, dict[str, Any]]]) -> None:
    for module, names in changes:
        for name, value in names.items():
            setattr(module, name, value)
