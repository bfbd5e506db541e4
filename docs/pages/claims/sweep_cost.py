"""Measure how the time of a sweep depends on workers and threads: docs/results/sweep_cost.json.

    python docs/make.py claims.sweep_cost [SEQUENCE [ITERATIONS]]   default: simulated, 600 iterations

Four equal runs are made for every division of the cores of this machine, each in a new folder. Run it on a machine that
has nothing else to do; `python docs/make.py claims` then writes the table of docs/guides/sweep.md.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import contextlib
import io
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from endotsr.cli.sweep import run_spec
from endotsr.method.kernels.machine import usable_cores
from endotsr.studies.sweeps.place import Place
from endotsr.studies.sweeps.spec import Spec, spec_of
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine, now, versions
from endotsr.training.runs.sources import SIMULATED

FILE = Path(__file__).parents[2] / "results" / "sweep_cost.json"
RUNS, ITERATIONS = 4, 600


def spec(source: str, iterations: int) -> Spec:
    """Equal runs that differ in their seeds."""
    preset = "demo" if source == SIMULATED else "paper"
    data = {"sequences": [source], "seeds": list(range(RUNS)), "preset": preset, "iterations": iterations}
    return spec_of(data | {"configurations": {"whole": {}}, "keep_checkpoints": False}, "sweep_cost", Path.cwd())


def divisions(cores: int) -> list[tuple[int, int]]:
    """(workers, threads): one run on one core, one run on all, and as many runs at a time as there are cores."""
    found = [(1, 1), (1, cores), (min(cores, RUNS), max(1, cores // RUNS))]
    return list(dict.fromkeys(found))


def measured(source: str, iterations: int, workers: int, threads: int) -> dict[str, Any]:
    """Seconds of the whole sweep, and those of its runs."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        began = time.monotonic()
        rows = run_spec(spec(source, iterations), Path(folder) / "out", Place(workers, threads, None), retry=False)
        seconds = time.monotonic() - began
    return {"workers": workers, "threads": threads, "seconds": seconds, "runs": [row["seconds"] for row in rows]}


def main(words: list[str]) -> None:
    """The command."""
    if len(words) > 2:
        sys.exit(__doc__)
    source, iterations = words[0] if words else SIMULATED, int(words[1]) if words[1:] else ITERATIONS
    measured(source, 12, usable_cores(), 1)  # compiles the kernels
    rows = []
    for workers, threads in divisions(usable_cores()):
        rows.append(measured(source, iterations, workers, threads))
        print(rows[-1], flush=True)
    about = {"sequence": Path(source).name, "iterations": iterations, "date": now(), "machine": machine()}
    write_json(FILE, about | {"versions": versions(), "rows": rows})
