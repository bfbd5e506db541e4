"""The directions along which a gradient is probed, block by block.

In a comparison of whole vectors, a correct large block hides a wrong small one. Every block therefore has its own
directions, in units of the block's size.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SHORT_AXIS = 24  # an axis up to this length (frequencies, bands, channels, bases) is probed slice by slice
LARGEST = 3  # single entries probed, those with the largest analytic gradient


class Block(NamedTuple):
    """A separately probed part of one input array."""

    name: str
    input: str
    mask: NDArray[np.bool_]  # of the input's shape


class Probe(NamedTuple):
    """A direction, non-zero in one block (or everywhere for joint probes). `kind` describes the direction."""

    block: str
    kind: str
    direction: dict[str, NDArray]


def make_blocks(inputs: Mapping[str, NDArray], named: Mapping[str, tuple[str, object]] | None) -> list[Block]:
    """Blocks from (input name, mask or index) by block name; None = one block per input array."""
    named = named if named is not None else {name: (name, ...) for name in inputs}
    blocks = []
    for name, (input_name, index) in named.items():
        mask = np.zeros(np.shape(inputs[input_name]), bool)
        mask[index] = True  # type: ignore[index]
        if not mask.any():
            raise ValueError(f"block {name} is empty")
        blocks.append(Block(name, input_name, mask))
    return blocks


def uncovered(inputs: Mapping[str, NDArray], blocks: list[Block]) -> list[str]:
    """Inputs with an entry outside all blocks."""
    return [
        name
        for name, value in inputs.items()
        if not np.logical_or.reduce(
            [np.zeros(np.shape(value), bool), *(b.mask for b in blocks if b.input == name)]
        ).all()
    ]


def size_of(value: NDArray, mask: NDArray[np.bool_]) -> float:
    """The unit of step lengths: RMS of the block; of the array if the block is zero; 1 if that is zero too."""
    for part in (value[mask], value):
        rms = float(np.sqrt(np.mean(np.square(part, dtype=np.float64))))
        if rms > 0:
            return rms
    return 1.0


def block_probes(
    block: Block, value: NDArray, gradient: NDArray, hard: NDArray | None, rng: np.random.Generator
) -> list[Probe]:
    """Probes: dense directions, signs, along the gradient, every short slice, the largest and the hard entries."""
    size, shape = size_of(value, block.mask), value.shape

    def probe(kind: str, direction: NDArray, mask: NDArray = block.mask) -> Probe:
        return Probe(block.name, kind, {block.input: np.where(mask, direction * size, 0.0)})

    found = [probe(f"dense {k}", rng.standard_normal(shape)) for k in range(2)]
    found.append(probe("signs", rng.choice([-1.0, 1.0], shape)))
    norm = float(np.sqrt(np.mean(np.square(gradient[block.mask], dtype=np.float64))))
    if norm > 0 and np.isfinite(norm):
        found.append(probe("aligned", np.clip(gradient / norm, -4.0, 4.0)))
    found += [probe(kind, _downhill(gradient, rng), mask) for kind, mask in _slices(block)]
    found += [
        probe(f"entry {_place(i, shape)}", np.ones(shape), _one(i, shape)) for i in _entries(block, gradient, hard)
    ]
    return found


def joint_probes(inputs: Mapping[str, NDArray], rng: np.random.Generator) -> list[Probe]:
    """Dense directions through all inputs, which detect errors that no single block shows."""
    return [
        Probe("(all)", f"dense {k}", {n: rng.standard_normal(v.shape) * _size(v) for n, v in inputs.items()})
        for k in range(2)
    ]


def _size(value: NDArray) -> float:
    return size_of(value, np.ones(value.shape, bool))


def _downhill(gradient: NDArray, rng: np.random.Generator) -> NDArray:
    """Random magnitudes with the gradient's signs: nothing cancels, and weakly weighted slices are resolved."""
    coin = rng.choice([-1.0, 1.0], gradient.shape)
    return np.where(gradient == 0, coin, np.sign(gradient)) * rng.uniform(0.5, 1.5, gradient.shape)


def _slices(block: Block) -> list[tuple[str, NDArray]]:
    found = []
    for axis, length in enumerate(block.mask.shape):
        if not 2 <= length <= SHORT_AXIS:
            continue
        for i in range(length):
            mask = np.zeros_like(block.mask)
            index = (slice(None),) * axis + (i,)
            mask[index] = block.mask[index]
            if mask.any() and mask.sum() < block.mask.sum():
                place = ", ".join(":" * (a != axis) or str(i) for a in range(block.mask.ndim))
                found.append((f"slice [{place}]", mask))
    return found


def _entries(block: Block, gradient: NDArray, hard: NDArray | None) -> list[int]:
    inside = np.flatnonzero(block.mask)
    order = np.argsort(-np.abs(gradient.ravel()[inside]), kind="stable")
    chosen = [int(i) for i in inside[order[:LARGEST]]]
    if hard is not None:
        chosen += [int(i) for i in np.ravel(hard) if block.mask.ravel()[i]]
    return list(dict.fromkeys(chosen))


def _one(flat: int, shape: tuple[int, ...]) -> NDArray:
    mask = np.zeros(shape, bool)
    mask[np.unravel_index(flat, shape)] = True
    return mask


def _place(flat: int, shape: tuple[int, ...]) -> str:
    return "[" + ", ".join(str(int(i)) for i in np.unravel_index(flat, shape)) + "]"
