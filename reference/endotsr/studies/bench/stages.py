"""Time of every stage of a training iteration for sizes, precisions and threads, with its lower bound."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from endotsr.results.export.npz import read_arrays
from endotsr.results.report.tables import memory, plain
from endotsr.studies.bench.case import BenchCase, apart, measure
from endotsr.studies.bench.limits import limits
from endotsr.studies.bench.peaks import higher, measure_peaks
from endotsr.studies.bench.records import BenchResult, CaseResult, CaseTimes, Spread
from endotsr.untrusted.names import counted

Say = Callable[[str], None]


def measure_stages(cases: Iterable[BenchCase], say: Say) -> BenchResult:
    """All cases with their limits, and the peaks per number of threads.

    Raises: InputError before any measurement, if the file of a case is not a trained scene.
    """
    cases = list(cases)
    for scene in {case.scene for case in cases if case.scene}:
        read_arrays(Path(scene))
    numbers = sorted({case.threads for case in cases})
    before = [apart(measure_peaks, threads) for threads in numbers]
    results: list[CaseTimes] = []
    for case in cases:
        results.append(apart(measure, case))
        say(line(results[-1]))
    after = [apart(measure_peaks, threads) for threads in numbers]  # the first measurement may have been disturbed
    peaks = {threads: higher(a, b) for threads, a, b in zip(numbers, before, after)}
    bounded: list[CaseResult] = [
        {**found, "limits": limits(found, peaks[found["case"]["threads"]]), "ns_per_pair": ns_per_pair(found)}
        for found in results
    ]
    return {"peaks": list(peaks.values()), "cases": bounded}


def ns_per_pair(result: CaseTimes) -> dict[str, float | None]:
    """Nanoseconds per blended pair of both blending stages and of all splatting stages; None without pairs."""
    pairs = result["view"]["blended"]
    medians = {name: result["stages"][name]["median_ms"] for name in ("blend forward", "blend reverse")}
    medians["splat"] = result["splat"]["median_ms"]
    return {name: 1e6 * median / pairs if pairs else None for name, median in medians.items()}


def name_of(case: dict[str, Any]) -> str:
    """A case as text."""
    what = case["scene"] or f"{case['gaussians']} Gaussians"
    return f"{what}, {case['width']}x{case['height']}, {case['precision']}, {counted(case['threads'], 'thread')}"


def line(result: CaseTimes) -> str:
    """One case as a line of text."""
    pairs = result["view"]["blended"]
    return (
        f"{name_of(result['case'])}: iteration {result['iteration']['median_ms']:.1f} ms, splat "
        f"{result['splat']['median_ms']:.1f} ms, {pairs / 1e6:.2f} M pairs, {memory(result['peak_memory_bytes'])}"
    )


def table(result: CaseResult) -> str:
    """One case as a table: each stage with its quartiles, fraction of the iteration, limit and kind of limit."""
    rows = [*result["stages"].items(), ("splat", result["splat"]), ("iteration", result["iteration"])]
    cells = [_row(name, spread, result) for name, spread in rows]
    lines = [plain(("stage", "median ms", "quartiles", "fraction", "limit ms", "of limit", "bound by"), cells, (0, 6))]
    dense = result["densification"]
    if dense:
        per = f"{dense['per_iteration_ms']:.2f} ms per iteration"
        lines.append(f"densification, once per interval: {dense['median_ms']:.2f} ms, or {per}")
    lines.append(f"first iteration, with loading or compilation: {result['first_iteration_s']:.1f} s")
    ns = result["ns_per_pair"]
    if ns["splat"] is not None:
        each = ", ".join(f"{name} {value:.2f}" for name, value in ns.items())
        lines.append(f"{result['view']['blended'] / 1e6:.2f} M blended pairs; ns per pair: {each}")
    return "\n".join(lines)


def _row(name: str, spread: Spread, result: CaseResult) -> list[str]:
    """One row of the table; limit cells are empty for a stage without a limit."""
    low, high = spread["quartiles_ms"]
    fraction = spread["median_ms"] / result["iteration"]["median_ms"]
    cells = [name, f"{spread['median_ms']:.2f}", f"{low:.2f} - {high:.2f}", f"{fraction:.0%}"]
    limit = result["limits"].get(name)
    if limit is None:
        return [*cells, "", "", ""]
    reached = f"{limit['fraction']:.0%}" if limit["fraction"] is not None else "-"
    return [*cells, f"{limit['limit_ms']:.2f}", reached, limit["bound"]]
