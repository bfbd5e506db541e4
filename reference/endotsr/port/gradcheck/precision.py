"""Comparison of the float32 and the float64 reverse pass, at the same rounded inputs and cotangents."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.gradcheck.probes import make_blocks
from endotsr.port.gradcheck.registry import Arrays, Pair

COSINE = 1e-6  # largest 1 - cosine between the two gradients of a block
RELATIVE = 1e-4  # largest relative L2 distance
DRAWS = 8  # largest number of draws until both precisions make the same decisions


class BlockPrecision(NamedTuple):
    """One block: 1 - cosine and relative L2 distance of the float32 gradient."""

    block: str
    cosine_gap: float
    distance: float

    @property
    def passed(self) -> bool:
        """Within both bounds (False for nan)."""
        return self.cosine_gap <= COSINE and self.distance <= RELATIVE


class PrecisionReport(NamedTuple):
    """The float32 check of one pair. `skipped` is the reason if the pair does not support it."""

    name: str
    blocks: tuple[BlockPrecision, ...]
    failures: tuple[str, ...]
    skipped: str = ""

    @property
    def passed(self) -> bool:
        """Nothing failed."""
        return not self.failures


def check_precision(pair: Pair, rng: np.random.Generator) -> PrecisionReport:
    """Compare the reverse pass in float32 and float64, block by block.

    Inputs with different decisions (pair.trace) in the two precisions are drawn again, up to 8 draws in all.
    """
    if pair.single:
        return PrecisionReport(pair.name, (), (), skipped=pair.single)
    for _ in range(DRAWS):
        inputs32 = {name: value.astype(np.float32) for name, value in pair.inputs(rng).items()}
        inputs64 = {name: value.astype(np.float64) for name, value in inputs32.items()}
        if _same_decisions(pair, inputs32, inputs64):
            break
    else:
        reason = f"float32 and float64 made different decisions at {DRAWS} of {DRAWS} inputs"
        return PrecisionReport(pair.name, (), (reason,))
    outputs = pair.forward(inputs64)
    draw = {name: rng.standard_normal(np.shape(value)).astype(np.float32) for name, value in outputs.items()}
    one = pair.reverse(inputs32, draw)
    two = pair.reverse(inputs64, {name: value.astype(np.float64) for name, value in draw.items()})
    failures = _wrong_types(pair.forward(inputs32), one, inputs32)
    blocks = []
    for block in make_blocks(inputs64, pair.blocks(inputs64) if pair.blocks else None):
        result = _compare(block.name, np.asarray(one[block.input])[block.mask], two[block.input][block.mask])
        blocks.append(result)
        if not result.passed:
            failures.append(
                f"block {block.name}: float32 gradient has 1 - cosine {result.cosine_gap:.1e} (at most {COSINE:g}) "
                f"and relative L2 distance {result.distance:.1e} (at most {RELATIVE:g})"
            )
    return PrecisionReport(pair.name, tuple(blocks), tuple(failures))


def _same_decisions(pair: Pair, one: Arrays, two: Arrays) -> bool:
    if pair.trace is None:
        return True
    first, second = pair.trace(one), pair.trace(two)
    return all(np.array_equal(first[key], second[key]) for key in first)


def _wrong_types(outputs: Arrays, gradients: Arrays, inputs: Arrays) -> list[str]:
    """Arrays that are not float32. Scalar losses are float64 by convention."""
    named = [(f"output {name}", outputs[name]) for name in outputs]
    named += [(f"gradient of {name}", gradients[name]) for name in inputs if np.ndim(inputs[name]) > 0]
    return [
        f"{what} is {np.asarray(value).dtype} for float32 inputs"
        for what, value in named
        if np.ndim(value) > 0 and np.asarray(value).dtype != np.float32
    ]


def _compare(name: str, single: NDArray, double: NDArray) -> BlockPrecision:
    a, b = single.astype(np.float64).ravel(), double.ravel()
    size = float(np.linalg.norm(b))
    lengths = size * float(np.linalg.norm(a))
    if lengths == 0:
        return BlockPrecision(name, np.nan, np.nan)
    return BlockPrecision(name, max(0.0, 1 - float(a @ b) / lengths), float(np.linalg.norm(a - b)) / size)
