"""`endotsr bench all`: every measurement in one call, as JSON and pictures in one folder."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from endotsr.bench import charts, peers, scaling, stages, start
from endotsr.bench.case import Case, Precision
from endotsr.bench.stages import Say
from endotsr.errors import InputError
from endotsr.export.npz import read_arrays
from endotsr.runs.files import write_json
from endotsr.runs.machine import machine, now, versions

STAGES_FILE, SCALING_FILE, PEERS_FILE, START_FILE = (
    "bench_stages.json", "scaling.json", "bench_peers.json", "bench_start.json",
)  # fmt: skip
SIZES, THREADS, REPEATS = (20_000, 60_000, 150_000), (1, 2), 11
PRECISIONS: tuple[Precision, ...] = ("float32", "float64")
LARGEST = 1_000_000
AXES = ("gaussians", "pairs", "pixels", "bases", "frequencies", "frames")


def dated(result: dict[str, Any]) -> dict[str, Any]:
    """The result with the date, the machine and the versions it belongs to."""
    return {"date": now(), "machine": machine(), "versions": versions()} | result


def run_all(out: Path, scenes: tuple[Path, ...], say: Say) -> None:
    """Measure and write everything into `out`. Without torch and gsplat the existing figures of the peers are kept.

    Raises: InputError before anything is measured, if a file of `scenes` is not a trained scene.
    """
    for path in scenes:
        read_arrays(path)
    out.mkdir(parents=True, exist_ok=True)
    _keep(out / START_FILE, lambda: start.measure_start(3), start.table, say)
    cases = [
        Case(n, precision=precision, threads=threads, repeats=REPEATS)
        for n in SIZES
        for precision in PRECISIONS
        for threads in THREADS
    ]
    cases += [Case(scene=str(path), repeats=REPEATS) for path in scenes]
    measured = _keep(out / STAGES_FILE, lambda: stages.measure_stages(cases, say), None, say)
    charts.stage_bars(measured["cases"], out / "bench_stages.png")
    try:
        _keep(out / PEERS_FILE, lambda: peers.measure_peers((60_000,), PRECISIONS, 2, 2), peers.table, say)
    except InputError as error:
        say(f"peers not measured: {error}")
    grown = _keep(out / SCALING_FILE, lambda: scaling.measure_scaling(LARGEST, AXES, say), scaling.table, say)
    charts.scaling_curves(grown["axes"], out / "scaling.png")


def _keep(
    path: Path, measure: Callable[[], dict[str, Any]], table: Callable[[dict[str, Any]], str] | None, say: Say
) -> dict[str, Any]:
    result = measure()
    write_json(path, dated(result))
    if table:
        say(table(result))
    return result
