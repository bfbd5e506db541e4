"""The gradient checker: whether a reverse pass is the derivative of its forward pass, for registered pairs and ports.

The rule is relative, without an absolute floor: |fd - an| <= rtol |an| + error bar of fd. A zero gradient fails beside
a difference larger than its error bar, at any magnitude. A probe counts only if it rejects the gradient scaled by
1 + control; otherwise it is unresolved.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.gradcheck.differences import Difference, plateau_difference, taylor_slope
from endotsr.port.gradcheck.probes import Probe, block_probes, joint_probes, make_blocks, uncovered
from endotsr.port.gradcheck.registry import Arrays, Pair
from endotsr.port.gradcheck.session import Session, norm


class Settings(NamedTuple):
    """The criteria of agreement. All numbers are relative.

    rtol            allowed |fd - an| / |an| beyond the error bar of the difference
    control         every probe must reject a gradient scaled by 1 + control
    unresolved_cap  largest fraction of probes that cannot reject it
    refused_cap     largest fraction of probes with different decisions at their ends
    """

    rtol: float = 1e-7
    control: float = 1e-4
    unresolved_cap: float = 0.2
    refused_cap: float = 0.5


DOUBLE = Settings()
SINGLE = Settings(rtol=3e-3, control=3e-2)  # for ports that compute in float32 only


class ProbeResult(NamedTuple):
    """One probe. verdict: passed, zero (both exactly), unresolved, refused or failed."""

    block: str
    kind: str
    analytic: float
    difference: Difference
    relative_error: float
    verdict: str


class BlockReport(NamedTuple):
    """All probes of one block. `worst` has the largest relative error of the resolved and failed probes."""

    block: str
    gradient_norm: float
    probes: int
    passed: int
    zero: int
    unresolved: int
    refused: int
    failed: int
    worst: ProbeResult | None
    verdict: str


class PairReport(NamedTuple):
    """The check of one pair. `failures` has one sentence per reason; empty = passed."""

    name: str
    equation: str
    function: str
    blocks: tuple[BlockReport, ...]
    failures: tuple[str, ...]
    taylor: float
    seconds: float

    @property
    def passed(self) -> bool:
        """Nothing failed."""
        return not self.failures


def check_pair(pair: Pair, rng: np.random.Generator) -> PairReport:
    """Check a registered pair at inputs drawn from `rng`."""
    inputs = pair.inputs(rng)
    return check_function(
        pair.forward,
        pair.reverse,
        inputs,
        blocks=pair.blocks(inputs) if pair.blocks else None,
        trace=pair.trace,
        traced=pair.traced,
        hard=pair.hard(inputs) if pair.hard else None,
        rng=rng,
        label=(pair.name, pair.equation, pair.function),
    )


def check_function(
    forward: Callable[[dict[str, NDArray]], Any],
    reverse: Callable[[dict[str, NDArray], Any], Mapping[str, NDArray]],
    inputs: Arrays,
    *,
    blocks: Mapping[str, tuple[str, object]] | None = None,
    trace: Callable[[dict[str, NDArray]], Mapping[str, NDArray]] | None = None,
    traced: Callable[[dict[str, NDArray]], tuple[Any, Mapping[str, NDArray]]] | None = None,
    hard: Mapping[str, NDArray] | None = None,
    rng: np.random.Generator | None = None,
    settings: Settings = DOUBLE,
    label: tuple[str, str, str] = ("function", "-", "-"),
) -> PairReport:
    """Check any function against its reverse pass.

    forward   inputs -> outputs by name, or one array or number
    reverse   (inputs, cotangents in the form of the outputs) -> gradients by input name, each of the input's shape
    inputs    float arrays by name; float64 unless the function computes in float32 (then settings=SINGLE)
    blocks    (input name, mask or index) by block name; None = one block per input
    trace     discrete decisions of the forward pass; a difference across a change of them is rejected
    traced    outputs and decisions of one forward pass, which saves a second pass for the trace
    hard      flat indices by input name that are always probed individually
    rng       draws cotangents and directions; None = seed 0
    returns   PairReport; never raises for a wrong gradient
    """
    start = time.perf_counter()
    session = Session(forward, reverse, inputs, trace, rng or np.random.default_rng(0), traced)
    failures = list(session.faults)
    reports: list[BlockReport] = []
    slope = np.nan
    if not failures:
        parts = make_blocks(session.inputs, blocks)
        failures += [f"input {name} is not covered by the blocks" for name in uncovered(session.inputs, parts)]
        joint = [_measure(session, probe, settings) for probe in joint_probes(session.inputs, session.rng)]
        reports.append(_block_report("(all)", norm(*session.gradient.values()), joint))
        for block in parts:
            gradient = session.gradient[block.input]
            places = None if hard is None else hard.get(block.input)
            probes = block_probes(block, session.inputs[block.input], gradient, places, session.rng)
            results = [_measure(session, probe, settings) for probe in probes]
            reports.append(_block_report(block.name, norm(gradient[block.mask]), results))
        failures += _verdicts(reports, settings)
        first = joint_probes(session.inputs, session.rng)[0].direction
        slope = taylor_slope(session.line(first), session.analytic(first)).slope
    return PairReport(*label, tuple(reports), tuple(failures), slope, time.perf_counter() - start)


def _measure(session: Session, probe: Probe, settings: Settings) -> ProbeResult:
    difference = plateau_difference(session.line(probe.direction), session.eps)
    analytic = session.analytic(probe.direction)
    gap = abs(difference.value - analytic)
    error = 0.0 if gap == 0 else gap / abs(analytic) if analytic else np.inf
    return ProbeResult(probe.block, probe.kind, analytic, difference, error, judge(analytic, difference, settings))


def judge(analytic: float, difference: Difference, settings: Settings = DOUBLE) -> str:
    """The verdict on one analytic derivative: passed, zero, unresolved, refused or failed."""
    if difference.refused:
        return "refused"
    if not _agrees(analytic, difference, settings):
        return "failed"
    if analytic == 0 and difference.value == 0:
        return "zero"
    if _agrees(analytic * (1 + settings.control), difference, settings):
        return "unresolved"  # the negative control: this probe would also accept a wrong gradient
    return "passed"


def _agrees(analytic: float, difference: Difference, settings: Settings) -> bool:
    gap = abs(difference.value - analytic)
    return bool(gap <= settings.rtol * abs(analytic) + difference.error)  # False for nan


def _block_report(name: str, gradient_norm: float, results: list[ProbeResult]) -> BlockReport:
    def count(verdict: str) -> int:
        return sum(r.verdict == verdict for r in results)

    passed, failed = count("passed"), count("failed")
    counted = [r for r in results if r.verdict == "failed"] or [r for r in results if r.verdict == "passed"]
    return BlockReport(
        block=name,
        gradient_norm=gradient_norm,
        probes=len(results),
        passed=passed,
        zero=count("zero"),
        unresolved=count("unresolved"),
        refused=count("refused"),
        failed=failed,
        worst=max(counted, key=lambda r: np.nan_to_num(r.relative_error, nan=np.inf), default=None),
        verdict="FAILED"
        if count("failed")
        else "VACUOUS"
        if gradient_norm == 0
        else "ok"
        if count("passed")
        else "BLIND",
    )


def _verdicts(reports: list[BlockReport], settings: Settings) -> list[str]:
    """The reasons to fail, one sentence each."""
    reasons = []
    for report in reports:
        if report.verdict == "FAILED" and report.worst is not None:
            worst = report.worst
            reasons.append(
                f"block {report.block}: {report.failed} of {report.probes} probes failed; worst {worst.kind}: analytic "
                f"{worst.analytic:.12g}, difference {worst.difference.value:.12g} +- {worst.difference.error:.1e} "
                f"at step {worst.difference.step:.1e}, relative error {worst.relative_error:.1e}"
            )
        elif report.verdict == "VACUOUS":
            reasons.append(f"block {report.block}: the gradient is zero: nothing is tested")
        elif report.verdict == "BLIND":
            reasons.append(
                f"block {report.block}: blind: none of {report.probes} probes rejects a gradient scaled by "
                f"1 + {settings.control:g} ({report.unresolved} unresolved, {report.refused} refused)"
            )
    total = sum(r.probes for r in reports)
    for word, count, cap in (
        ("unresolved", sum(r.unresolved for r in reports), settings.unresolved_cap),
        ("refused", sum(r.refused for r in reports), settings.refused_cap),
    ):
        if count > cap * total:
            reasons.append(f"{count} of {total} probes {word}, more than {cap:.0%}")
    return reasons
