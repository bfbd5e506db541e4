"""Whether a wrong version computes something else at all: other requests, made from those of the golden cases.

A request is a golden case with changed settings and inputs, drawn with a seed. A wrong version that no request tells
from the right port is taken for equivalent. One that a request tells apart, and no golden case, is a gap of the cases.
"""

import copy
from collections.abc import Mapping
from random import Random
from typing import Any, NamedTuple

import numpy as np

from endotsr.port.judge.compare import largest
from endotsr.port.judge.format import Case
from endotsr.port.search.requests import leaves, value_at, with_value

APART = 1e-9  # of the scale of an output
PER_CASE = 10
SIGNED = {"rotation_vector", "t", "d_loss", "d_ssim", "d_penalty", "parameter"}
KEPT = {"times", "train_index", "frame_order", "iteration", "images", "masks", "visible"}
FIXED = {"preset", "levels", "threads", "precision", "width", "height", "iterations", "bases", "frequencies"}
SEEN = {"beta1", "beta2", "final_factor", "annealed_factor", "alpha_max", "ssim_weight", "interval",
        "harmonics_interval", "support", "growth", "initial_width", "prune_opacity", "low_pass"}  # fmt: skip
"""Settings that keep to the values of the cases: others are refused, or have no meaning."""
UNIT = {"observed"}  # colours of a frame


class Request(NamedTuple):
    """A changed case, and what the right port answers."""

    operation: str
    inputs: dict[str, Any]
    settings: Mapping[str, Any]
    right: dict[str, Any]
    functions: frozenset[str]


def drawn(case: Case, inputs: Mapping[str, Any], cases: list[Case], number: int) -> tuple[dict[str, Any], Any]:
    """Inputs and settings of the request of this number."""
    rng = Random(f"{case.name} {number}")
    arrays = np.random.default_rng(abs(hash_of(f"{case.name} {number}")))
    settings, made = copy.deepcopy(dict(case.settings)), dict(inputs)
    for path in leaves(case.settings):
        if path[-1] in FIXED or rng.random() > 0.3:
            continue
        value = value_at(case.settings, path)
        seen = [v for other in cases if (v := value_at(other.settings, path)) is not None]
        if isinstance(value, bool):
            settings = with_value(settings, path, not value)
        elif isinstance(value, int | float) and not isinstance(value, bool):
            others = [] if path[-1] in SEEN else [value * 2, value / 2, value * 30, 0, 1]
            number = rng.choice([*others, *seen])
            if isinstance(number, bool | str):
                continue
            settings = with_value(settings, path, int(number) if isinstance(value, int) else float(number))
        elif seen and not isinstance(value, list):
            settings = with_value(settings, path, rng.choice(seen))
    for name, array in inputs.items():
        if rng.random() < 0.35:
            continue
        if array.dtype.kind == "f" and array.size and name not in KEPT:
            made[name] = _real(array, name, rng, arrays)
        elif array.dtype.kind == "b" and array.size:
            made[name] = arrays.random(array.shape) < rng.choice([0.0, 0.3, 0.7, 1.0])
    return made, settings


def _real(array: Any, name: str, rng: Random, arrays: np.random.Generator) -> Any:
    finite = array[np.isfinite(array)]
    signed = bool(finite.size and finite.min() < 0) or name in SIGNED or name.startswith("d_")
    factor = rng.choice([1.0, 1.0, 3.0, 0.3, 30.0, 0.01])
    out = array * factor * (rng.choice([1, 1, -1]) if signed else 1)
    if rng.random() < 0.4:
        out = np.where(arrays.random(array.shape) < 0.25, 0.0, out)
    if rng.random() < 0.4:
        out = out * 10 ** arrays.uniform(-2, 2, array.shape)
    if signed and rng.random() < 0.4:
        out = out * np.where(arrays.random(array.shape) < 0.5, -1, 1)
    if array.ndim and rng.random() < 0.3:
        out = np.take(out, arrays.integers(0, array.shape[-1], array.shape[-1]), axis=-1)  # equal entries
    out = np.clip(out, 0, 1) if name in UNIT else out
    return out.astype(np.float32).astype(np.float64)  # as every real input of a case


def hash_of(text: str) -> int:
    """FNV-1a of a text."""
    value = 0xCBF29CE484222325
    for byte in text.encode():
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return value


def apart(got: Mapping[str, Any], right: Mapping[str, Any]) -> bool:
    """Whether two answers differ by more than rounding."""
    for name, value in right.items():
        one, other = np.asarray(got.get(name, np.nan)), np.asarray(value)
        if one.shape != other.shape or one.dtype.kind == "c":
            return True
        if other.dtype.kind != "f" and one.dtype.kind != "f":
            if not np.array_equal(one, other):
                return True
        elif other.size and not largest(one, other, "max") <= APART:
            return True
    return False
