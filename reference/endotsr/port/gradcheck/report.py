"""Reports of the gradient checker: a table and JSON."""

import json
import math
from collections.abc import Iterable
from typing import Any

from endotsr.port.gradcheck.checker import BlockReport, PairReport
from endotsr.port.gradcheck.precision import PrecisionReport
from endotsr.results.report.tables import plain

HEADER = ("operation", "equation", "block", "probes", "refused", "unresolved", "worst rel. error", "step", "verdict")
_LEFT = (0, 1, 2, 8)
_COLOURS = {"ok": "\x1b[32m", "skipped": "\x1b[33m"}
_RED, _RESET = "\x1b[31m", "\x1b[0m"


def table(reports: Iterable[PairReport], precisions: Iterable[PrecisionReport] = (), colour: bool = False) -> str:
    """Aligned plain text: a line per block, then the pair's float32 line; reasons for failures at the end."""
    single = {p.name: p for p in precisions}
    rows: list[tuple[str, ...]] = []
    reasons: list[str] = []
    for report in reports:
        rows += [_row(report, block, first=i == 0) for i, block in enumerate(report.blocks)]
        if not report.blocks:
            rows.append((report.name, report.equation, "-", "0", "0", "0", "-", "-", "FAILED"))
        reasons += [f"{report.name}: {reason}" for reason in report.failures]
        if report.name in single:
            rows.append(_single_row(single[report.name]))
            reasons += [f"{report.name}: {reason}" for reason in single[report.name].failures]
    lines = plain(HEADER, rows, _LEFT, rule=True).splitlines()
    if colour:
        lines[2:] = [_coloured(line, row[-1]) for line, row in zip(lines[2:], rows, strict=True)]
    return "\n".join(lines + ([""] + reasons if reasons else []))


def summary(reports: Iterable[PairReport], precisions: Iterable[PrecisionReport] = ()) -> str:
    """One line with the numbers of pairs, blocks, probes and failures, and the duration."""
    reports, precisions = list(reports), list(precisions)
    bad = {r.name for r in (*reports, *precisions) if not r.passed}
    probes = sum(block.probes for report in reports for block in report.blocks)
    blocks = sum(len(report.blocks) for report in reports)
    seconds = sum(report.seconds for report in reports)
    verdict = f"{len(bad)} failed: {', '.join(sorted(bad))}" if bad else "all passed"
    return f"{len(reports)} pairs, {blocks} blocks, {probes} probes in {seconds:.1f} s: {verdict}"


def to_json(reports: Iterable[PairReport], precisions: Iterable[PrecisionReport], seed: int) -> str:
    """All entries of the table and all underlying numbers. Non-finite numbers are written as strings."""
    single = {p.name: p for p in precisions}
    pairs = []
    for report in reports:
        entry = {"passed": report.passed} | _plain(report)
        if report.name in single:
            entry["float32"] = {"passed": single[report.name].passed} | _plain(single[report.name])
        pairs.append(entry)
    passed = all(p["passed"] and p.get("float32", p)["passed"] for p in pairs)
    return json.dumps({"passed": passed, "seed": seed, "pairs": pairs}, indent=1, allow_nan=False) + "\n"


def _row(report: PairReport, block: BlockReport, first: bool) -> tuple[str, ...]:
    worst = block.worst
    head = (report.name, report.equation) if first else ("", "")
    error, step = (_number(worst.relative_error), _number(worst.difference.step)) if worst else ("-", "-")
    return (
        *head,
        block.block,
        str(block.probes),
        str(block.refused),
        str(block.unresolved),
        error,
        step,
        block.verdict,
    )


def _single_row(precision: PrecisionReport) -> tuple[str, ...]:
    if precision.skipped:
        return ("", "", f"float32: {precision.skipped}", "", "", "", "-", "-", "skipped")
    worst = max((b.distance for b in precision.blocks), default=math.nan)
    verdict = "ok" if precision.passed else "FAILED"
    return ("", "", "float32 against float64", "", "", "", _number(worst), "-", verdict)


def _number(value: float) -> str:
    return f"{value:.1e}" if math.isfinite(value) else str(value)


def _coloured(line: str, verdict: str) -> str:
    return f"{line.removesuffix(verdict)}{_COLOURS.get(verdict, _RED)}{verdict}{_RESET}"


def _plain(value) -> Any:
    """Named tuples as dictionaries, non-finite numbers as strings."""
    if hasattr(value, "_asdict"):
        return {key: _plain(item) for key, item in value._asdict().items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
