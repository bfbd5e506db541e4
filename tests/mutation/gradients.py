"""The public gradient checker, arranged so that it can check thousands of wrong kernels.

A mutant that the forward pass never runs does not change the finite differences. They are therefore taken once,
with the right kernels, and the gradient of the mutant is judged against them (`Replay`). A mutant of the forward pass
needs new differences, which are taken along fewer lines (`Live`).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.gradcheck import Pair, pair_stream
from endotsr.port.gradcheck.checker import judge
from endotsr.port.gradcheck.differences import Difference, plateau_difference
from endotsr.port.gradcheck.probes import Probe, block_probes, joint_probes, make_blocks
from endotsr.port.gradcheck.session import LINEAR, Session, norm

SEED = 0
CHANGED = 1e-6  # a gradient that changes by more than this, relative, must be detected


class Recorded(NamedTuple):
    """One pair at fixed inputs: its gradient and finite differences along many lines."""

    inputs: dict[str, NDArray]
    cotangents: dict[str, NDArray]
    gradient: dict[str, NDArray]
    eps: float
    probes: list[tuple[Probe, Difference]]


def _session(pair: Pair) -> Session:
    rng = pair_stream(pair.name, SEED)
    return Session(pair.forward, pair.reverse, pair.inputs(rng), pair.trace, rng)


def record(pair: Pair) -> Recorded:
    """All probes that `check_pair` would take."""
    session = _session(pair)
    assert not session.faults, session.faults
    blocks = make_blocks(session.inputs, pair.blocks(session.inputs) if pair.blocks else None)
    hard = pair.hard(session.inputs) if pair.hard else {}
    probes = joint_probes(session.inputs, session.rng)
    for block in blocks:
        name = block.input
        probes += block_probes(block, session.inputs[name], session.gradient[name], hard.get(name), session.rng)
    taken = [(probe, plateau_difference(session.line(probe.direction), session.eps)) for probe in probes]
    return Recorded(session.inputs, session.cotangents, session.gradient, session.eps, taken)


def _gradient(pair: Pair, recorded: Recorded, cotangents: Mapping[str, NDArray]) -> dict[str, NDArray]:
    inputs = {name: value.copy() for name, value in recorded.inputs.items()}
    found = pair.reverse(inputs, {name: value.copy() for name, value in cotangents.items()})
    return {name: np.array(value) for name, value in found.items()}


def replay(pair: Pair, recorded: Recorded) -> tuple[str, float]:
    """(what is wrong with the reverse pass, "" if nothing; largest relative change of the gradient of an input)."""
    gradient = _gradient(pair, recorded, recorded.cotangents)
    change = 0.0
    for name, right in recorded.gradient.items():
        if name not in gradient or gradient[name].shape != right.shape:
            return f"gradient of {name} has another shape", np.inf
        if not np.isfinite(gradient[name]).all():
            return f"gradient of {name} is not finite", np.inf
        change = max(change, norm(gradient[name] - right) / norm(right))
    for probe, difference in recorded.probes:
        analytic = float(sum(np.sum(np.float64(gradient[name]) * v) for name, v in probe.direction.items()))
        if judge(analytic, difference) == "failed":
            return f"{probe.block} {probe.kind}", change
    return _not_linear(pair, recorded, gradient), change


def _not_linear(pair: Pair, recorded: Recorded, gradient: dict[str, NDArray]) -> str:
    """As `Session` does: half of each cotangent alone, added up."""
    total = {name: np.zeros(value.shape) for name, value in gradient.items()}
    for one in recorded.cotangents:
        alone = {k: v * (0.5 if k == one else 0.0) for k, v in recorded.cotangents.items()}
        for name, value in _gradient(pair, recorded, alone).items():
            total[name] = total[name] + value
    for name, value in gradient.items():
        if not norm(total[name] - 0.5 * value) <= LINEAR * recorded.eps * 0.5 * norm(value):
            return f"gradient of {name} is not linear in the cotangents"
    return ""


def live(pair: Pair, *, blocks: bool) -> str:
    """The verdict of the checker along two joint lines and, optionally, the first two lines of every block."""
    session = _session(pair)
    if session.faults:
        return session.faults[0]
    probes = joint_probes(session.inputs, session.rng)
    parts = make_blocks(session.inputs, pair.blocks(session.inputs) if pair.blocks else None) if blocks else []
    for block in parts:
        name = block.input
        probes += block_probes(block, session.inputs[name], session.gradient[name], None, session.rng)[:2]
    for probe in probes:
        difference = plateau_difference(session.line(probe.direction), session.eps)
        if judge(session.analytic(probe.direction), difference) == "failed":
            return f"{probe.block} {probe.kind}"
    return ""
