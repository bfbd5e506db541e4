"""Measure how the time of a sweep depends on workers and threads: docs/results/sweep_cost.json.

    python docs/make.py claims.sweep_cost measure [--sequence SEQUENCE] [--iterations 600]   default: simulated

Four equal runs are made for every division of the cores of this machine, each in a new folder. Run it on a machine that
has nothing else to do; `python docs/make.py claims` then writes the table of docs/guides/sweep.md.
"""

import argparse
import contextlib
import io
import tempfile
import time
from pathlib import Path
from typing import Any

from endotsr.cli.sweep import run_spec
from endotsr.method.kernels.machine import usable_cores
from endotsr.studies.sweeps.place import Place
from endotsr.studies.sweeps.spec import Spec, spec_of
from endotsr.training.runs.sources import SIMULATED
from pages.store.program import Program

RUNS = 4


def spec(source: str, iterations: int) -> Spec:
    """Equal runs that differ in their seeds."""
    preset = "demo" if source == SIMULATED else "paper"
    data = {"sequences": [source], "seeds": list(range(RUNS)), "preset": preset, "iterations": iterations}
    return spec_of(data | {"configurations": {"whole": {}}, "keep_checkpoints": False}, "sweep_cost", Path.cwd())


def divisions(cores: int) -> list[tuple[int, int]]:
    """(workers, threads): one run on one core, one run on all, and as many runs at a time as there are cores."""
    found = [(1, 1), (1, cores), (min(cores, RUNS), max(1, cores // RUNS))]
    return list(dict.fromkeys(found))


def of_division(source: str, iterations: int, workers: int, threads: int) -> dict[str, Any]:
    """Seconds of the whole sweep, and those of its runs."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        began = time.monotonic()
        rows: Any = run_spec(spec(source, iterations), Path(folder) / "out", Place(workers, threads, None), retry=False)
        seconds = time.monotonic() - began
    return {"workers": workers, "threads": threads, "seconds": seconds, "runs": [row["seconds"] for row in rows]}


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every division of the cores."""
    source, iterations = options.sequence, options.iterations
    of_division(source, 12, usable_cores(), 1)  # compiles the kernels
    rows = [of_division(source, iterations, *division) for division in divisions(usable_cores())]
    return {"sequence": Path(source).name, "iterations": iterations, "rows": rows}


PROGRAM = Program(
    __name__, record="sweep_cost.json", measure=measured, options={"--sequence": SIMULATED, "--iterations": 600}
)
