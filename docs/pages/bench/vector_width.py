"""Half and whole AVX-512 registers: the iteration of the common workload with either, in alternating fresh processes.

    python docs/make.py bench.vector_width measure

on a processor for which LLVM prefers half registers; see `endotsr.method.kernels.target`.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from llvmlite.binding import get_host_cpu_features

from endotsr.errors import InputError
from endotsr.method.kernels import target, vectors
from endotsr.results.report.tables import markdown
from pages.store.commands import loaded
from pages.store.program import Program

THREADS = (1, 2)
SHOWN = ("FDM", "blend forward", "blend reverse")


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """{"bytes of a vector": [one list of cases per repeat]}."""
    if vectors.REGISTER < 64:
        raise InputError("bench.vector_width: this processor has no registers of 64 bytes")
    half = os.environ | {"NUMBA_CPU_FEATURES": get_host_cpu_features().flatten()}
    found: dict[str, Any] = {"32": [], "64": []}
    for _ in range(options.repeats):
        found["32"].append(_fresh(half))
        found["64"].append(_fresh(dict(os.environ)))
    return {"register_bytes": vectors.REGISTER, "compiled_for": target.compiled_for(), "cases": found}


def _fresh(environment: dict[str, str]) -> list[dict[str, Any]]:
    """Medians of the stages and of the iteration, ms, for each number of threads."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.json"
        words = [sys.executable, "-m", "endotsr", "bench", "--threads", *map(str, THREADS), "--json", str(file)]
        subprocess.run(words, env=environment, check=True, stdout=subprocess.DEVNULL)
        return [
            {"threads": case["case"]["threads"], "iteration": case["iteration"]["median_ms"]}
            | {name: case["stages"][name]["median_ms"] for name in SHOWN}
            for case in loaded(file)["cases"]
        ]


def table(found: dict[str, Any]) -> str:
    """Milliseconds with half and whole registers, and the median of the ratios of neighbouring processes."""
    rows = []
    for at, threads in enumerate(THREADS):
        for name in ("iteration", *SHOWN):
            half, whole = ([repeat[at][name] for repeat in found["cases"][width]] for width in ("32", "64"))
            ratio = statistics.median(b / a for a, b in zip(half, whole))
            rows.append([name, str(threads), _spread(half), _spread(whole), f"{ratio:.2f}"])
    head = ["stage", "threads", "half registers, ms", "whole registers, ms", "ratio"]
    machine, repeats = found["machine"], len(found["cases"]["64"])
    note = f"Medians of {repeats} processes each, in turn, with least and largest; {machine['processor']},"
    return f"{markdown(head, rows)}\n\n{note} {found['date'][:10]}."


def _spread(values: list[float]) -> str:
    return f"{statistics.median(values):.1f} ({min(values):.1f} - {max(values):.1f})"


PROGRAM = Program(
    __name__, "bench.md", {"table": table}, "vector_width.json", measured, {"--repeats": 3},
)  # fmt: skip
