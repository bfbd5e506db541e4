"""The gradient checker: is a reverse pass the derivative of its forward pass? For our pairs and for anybody's port.

The rule is relative and has no absolute floor: |fd - an| <= rtol |an| + error bar of fd. A zero gradient
against a non-zero difference fails at any magnitude. Whoever cannot tell right from wrong is not believed:
every probe must also refuse the gradient scaled by 1 + control, otherwise it counts as unresolved.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.checking.differences import Difference, plateau_difference, taylor_slope
from endotsr.checking.probes import Probe, block_probes, joint_probes, make_blocks, uncovered
from endotsr.checking.registry import Arrays, Pair

LINEAR = 1e5  # reverse passes are linear in the cotangents up to so many rounding units


class Settings(NamedTuple):
    """What counts as agreement. All numbers are relative.

    rtol            allowed |fd - an| / |an| beyond the error bar of the difference
    control         a gradient scaled by 1 + control must be refused by every probe
    unresolved_cap  largest share of probes that cannot refuse it
    refused_cap     largest share of probes whose ends take different decisions
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
    """All probes of one block. `worst` is the probe with the largest relative error that was resolved or failed."""

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
    """The check of one pair. `failures` holds one sentence per reason; none = passed."""

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


def check_pair(pair: Pair, rng: np.random.Generator, settings: Settings = DOUBLE) -> PairReport:
    """Check a registered pair at inputs drawn from `rng`."""
    inputs = pair.inputs(rng)
    return check_function(
        pair.forward,
        pair.reverse,
        inputs,
        blocks=pair.blocks(inputs) if pair.blocks else None,
        trace=pair.trace,
        hard=pair.hard(inputs) if pair.hard else None,
        rng=rng,
        settings=settings,
        label=(pair.name, pair.equation, pair.function),
    )


def check_function(
    forward: Callable[[dict[str, NDArray]], Any],
    reverse: Callable[[dict[str, NDArray], Any], Mapping[str, NDArray]],
    inputs: Arrays,
    *,
    blocks: Mapping[str, tuple[str, object]] | None = None,
    trace: Callable[[dict[str, NDArray]], Mapping[str, NDArray]] | None = None,
    hard: Mapping[str, NDArray] | None = None,
    rng: np.random.Generator | None = None,
    settings: Settings = DOUBLE,
    label: tuple[str, str, str] = ("function", "-", "-"),
) -> PairReport:
    """Check any function against its reverse pass.

    forward   inputs -> outputs by name, or one array or number
    reverse   (inputs, cotangents as `forward` answers) -> gradients by input name, each of the input's shape
    inputs    float arrays by name; float64 unless the function computes in float32 (then settings=SINGLE)
    blocks    (input name, mask or index) by block name; None = one block per input
    trace     discrete decisions of the forward pass; a difference across a change of them is refused
    hard      flat indices by input name that are always probed one by one
    rng       draws cotangents and directions; None = seed 0
    returns   PairReport; never raises for a wrong gradient
    """
    start = time.perf_counter()
    session = _Session(forward, reverse, inputs, trace, rng or np.random.default_rng(0))
    failures = list(session.faults)
    reports: list[BlockReport] = []
    slope = np.nan
    if not failures:
        parts = make_blocks(session.inputs, blocks)
        failures += [f"input {name} is not covered by the blocks" for name in uncovered(session.inputs, parts)]
        joint = [session.judge(probe, settings) for probe in joint_probes(session.inputs, session.rng)]
        reports.append(_block_report("(all)", _norm(*session.gradient.values()), joint))
        for block in parts:
            gradient = session.gradient[block.input]
            places = None if hard is None else hard.get(block.input)
            probes = block_probes(block, session.inputs[block.input], gradient, places, session.rng)
            results = [session.judge(probe, settings) for probe in probes]
            reports.append(_block_report(block.name, _norm(gradient[block.mask]), results))
        failures += _verdicts(reports, settings)
        slope = session.taylor()
    return PairReport(*label, tuple(reports), tuple(failures), slope, time.perf_counter() - start)


class _Session:
    """Inputs, outputs, dense cotangents and gradient of one check, and what was wrong with them already."""

    def __init__(self, forward, reverse, inputs: Arrays, trace, rng: np.random.Generator):
        self.inputs = {name: np.array(value) for name, value in inputs.items()}
        self.rng, self._trace, self.faults = rng, trace, []
        self._forward, self._reverse = forward, reverse
        self.decisions = trace(self.inputs) if trace else {}
        answer = forward(dict(self.inputs))
        self.bare = not isinstance(answer, Mapping)
        outputs = self._named(answer)
        self._check_outputs(outputs)
        self.cotangents = {name: self._cotangent(value) for name, value in outputs.items()}
        floats = [v.dtype for v in outputs.values() if v.ndim] or [v.dtype for v in self.inputs.values()]
        self.eps = max(float(np.finfo(t).eps) for t in floats if t.kind == "f")
        self.gradient = {}
        if not self.faults:
            self.gradient = self._gradient(self.cotangents)
            self._check_gradient()
        if not self.faults:
            self._check_linear()
        for name, value in inputs.items():
            if not np.array_equal(value, self.inputs[name], equal_nan=True):
                self.faults.append(f"input {name} was modified by the function")

    def _named(self, answer) -> dict[str, NDArray]:
        return {"output": np.asarray(answer)} if self.bare else {k: np.asarray(v) for k, v in answer.items()}

    def _cotangent(self, output: NDArray) -> NDArray:
        """Dense, never near zero, scaled so that every output has a say."""
        size = float(np.sqrt(np.mean(np.square(output, dtype=np.float64)))) if output.size else 1.0
        draw = self.rng.choice([-1.0, 1.0], output.shape) * self.rng.uniform(0.5, 1.5, output.shape)
        return np.asarray(draw / (size if size > 0 and np.isfinite(size) else 1.0), output.dtype)

    def _gradient(self, cotangents: dict[str, NDArray]) -> dict[str, NDArray]:
        given = {name: value.copy() for name, value in cotangents.items()}
        answer = self._reverse(dict(self.inputs), given["output"] if self.bare else given)
        return {name: np.array(value) for name, value in answer.items()}

    def _check_outputs(self, outputs: dict[str, NDArray]) -> None:
        for name, value in outputs.items():
            if value.dtype.kind != "f":
                self.faults.append(f"output {name} has dtype {value.dtype}, not a float")
            elif not np.isfinite(value).all():
                self.faults.append(f"output {name} is not finite")
            elif value.size > 1 and np.ptp(value) == 0:
                self.faults.append(f"output {name} is constant: nothing is tested")

    def _check_gradient(self) -> None:
        for name, value in self.inputs.items():
            gradient = self.gradient.get(name)
            if gradient is None:
                self.faults.append(f"no gradient for input {name}")
            elif gradient.shape != value.shape:
                self.faults.append(f"gradient of {name} has shape {gradient.shape}, the input {value.shape}")
            elif not np.isfinite(gradient).all():
                self.faults.append(f"gradient of {name} is not finite at {_first(~np.isfinite(gradient))}")
        self.gradient = {name: value for name, value in self.gradient.items() if name in self.inputs}

    def _check_linear(self) -> None:
        """Each output's cotangent alone, halved: the parts must add up to half the gradient."""
        total = {name: np.zeros(value.shape) for name, value in self.gradient.items()}
        for one in self.cotangents:
            alone = {k: v * v.dtype.type(0.5) if k == one else np.zeros_like(v) for k, v in self.cotangents.items()}
            for name, value in self._gradient(alone).items():
                if name in total:
                    total[name] = total[name] + value
        for name, value in self.gradient.items():
            gap, size = _norm(total[name] - 0.5 * value), 0.5 * _norm(value)
            if not gap <= LINEAR * self.eps * size:
                self.faults.append(f"gradient of {name} is not linear in the cotangents: {gap:.1e} of {size:.1e}")

    def line(self, direction: Mapping[str, NDArray]) -> Callable[[float], NDArray | None]:
        """h -> outputs times cotangents at inputs + h direction; None where the decisions differ."""

        def at(step: float) -> NDArray | None:
            moved = dict(self.inputs)
            for name, v in direction.items():
                moved[name] = (self.inputs[name] + step * v).astype(self.inputs[name].dtype)
            if self._trace is not None and not _equal(self._trace(moved), self.decisions):
                return None
            outputs = self._named(self._forward(moved))
            terms = [(np.float64(self.cotangents[k]) * np.float64(v)).ravel() for k, v in outputs.items()]
            return terms[0] if len(terms) == 1 else np.concatenate(terms)

        return at

    def analytic(self, direction: Mapping[str, NDArray]) -> float:
        """Sum over the inputs of <gradient, direction>."""
        return float(sum(np.sum(np.float64(self.gradient[name]) * v) for name, v in direction.items()))

    def judge(self, probe: Probe, settings: Settings) -> ProbeResult:
        """Measure one probe and give its verdict."""
        difference = plateau_difference(self.line(probe.direction), self.eps)
        analytic = self.analytic(probe.direction)
        verdict = judge(analytic, difference, settings)
        gap = abs(difference.value - analytic)
        error = 0.0 if gap == 0 else gap / abs(analytic) if analytic else np.inf
        return ProbeResult(probe.block, probe.kind, analytic, difference, error, verdict)

    def taylor(self) -> float:
        """Order of the Taylor remainder along the first joint direction (inf = linear)."""
        probe = joint_probes(self.inputs, self.rng)[0]
        return taylor_slope(self.line(probe.direction), self.analytic(probe.direction)).slope


def judge(analytic: float, difference: Difference, settings: Settings = DOUBLE) -> str:
    """The verdict on one analytic derivative: passed, zero, unresolved, refused or failed."""
    if difference.refused:
        return "refused"
    if not _agrees(analytic, difference, settings):
        return "failed"
    if analytic == 0 and difference.value == 0:
        return "zero"
    if _agrees(analytic * (1 + settings.control), difference, settings):
        return "unresolved"  # the negative control: this probe would accept a wrong gradient too
    return "passed"


def _agrees(analytic: float, difference: Difference, settings: Settings) -> bool:
    gap = abs(difference.value - analytic)
    return bool(gap <= settings.rtol * abs(analytic) + difference.error)  # False for nan


def _block_report(name: str, norm: float, results: list[ProbeResult]) -> BlockReport:
    def count(verdict: str) -> int:
        return sum(r.verdict == verdict for r in results)

    counted = [r for r in results if r.verdict == "failed"] or [r for r in results if r.verdict == "passed"]
    return BlockReport(
        block=name,
        gradient_norm=norm,
        probes=len(results),
        passed=count("passed"),
        zero=count("zero"),
        unresolved=count("unresolved"),
        refused=count("refused"),
        failed=count("failed"),
        worst=max(counted, key=lambda r: np.nan_to_num(r.relative_error, nan=np.inf), default=None),
        verdict="FAILED" if count("failed") else "VACUOUS" if norm == 0 else "ok" if count("passed") else "BLIND",
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
                f"block {report.block}: blind: none of {report.probes} probes refuses a gradient scaled by "
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


def _equal(one: Mapping[str, NDArray], two: Mapping[str, NDArray]) -> bool:
    return one.keys() == two.keys() and all(np.array_equal(one[k], two[k]) for k in one)


def _norm(*values: NDArray) -> float:
    return float(np.sqrt(sum(np.sum(np.square(v, dtype=np.float64)) for v in values)))


def _first(mask: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(int(i[0]) for i in np.nonzero(mask))
