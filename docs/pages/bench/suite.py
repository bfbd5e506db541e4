"""`docs/make.py bench measure`: every measurement in one call, as JSON in one folder.

The measurements run one after the other, each in separate processes, on an otherwise idle machine.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.method.kernels.threads import use_threads
from endotsr.results.export.npz import read_arrays
from endotsr.studies.bench import stages
from endotsr.studies.bench.case import BenchCase, Precision, apart
from endotsr.studies.bench.stages import Say
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import dated
from pages.bench import effects as bench_effects
from pages.bench import peers as bench_peers
from pages.bench import scaling as bench_scaling
from pages.bench import start as bench_start

RESULTS = Path(__file__).parents[2] / "results"
FILES = {
    "start": "bench_start.json", "stages": "bench_stages.json", "peers": "bench_peers.json",
    "scaling": "scaling.json", "effects": "bench_effects.json",
}  # fmt: skip
USUAL = ("start", "stages", "peers", "scaling")  # of the page docs/bench.md; `effects` belongs to docs/effects.md
SIZES, THREADS, REPEATS = (20_000, 60_000, 150_000), (1, 2), 11
PRECISIONS: tuple[Precision, ...] = ("float32", "float64")
LARGEST = 1_000_000  # Gaussians; takes about 10 GB
AXES = ("gaussians", "pairs", "pixels", "bases", "frequencies", "frames")
EFFECTS = (20_000, 15, 320, 256)  # Gaussians, repeats, columns, rows


def grid(scenes: tuple[Path, ...]) -> list[BenchCase]:
    """The common workload in every size, precision and number of threads, then the trained scenes."""
    cases = [
        BenchCase(n, precision=precision, threads=threads, repeats=REPEATS)
        for n in SIZES
        for precision in PRECISIONS
        for threads in THREADS
    ]
    return cases + [BenchCase(scene=str(path), repeats=REPEATS) for path in scenes]


def measured_effects() -> dict[str, Any]:
    """Of one thread; the times are processor times."""
    use_threads(1)
    return bench_effects.benchmark_effects(*EFFECTS) | {"threads": 1}


def run_all(out: Path, names: tuple[str, ...], scenes: tuple[Path, ...], say: Say) -> None:
    """Measure and write into `out`. Without torch and gsplat the existing figures of the peers are kept.

    Raises: InputError before anything is measured, if a file of `scenes` is not a trained scene.
    """
    for path in scenes:
        read_arrays(path)
    out.mkdir(parents=True, exist_ok=True)
    measures: dict[str, tuple[Callable[[], Any], Callable[[Any], str] | None]] = {
        "start": (lambda: bench_start.measure_start(3), bench_start.table),
        "stages": (lambda: stages.measure_stages(grid(scenes), say), None),
        "peers": (lambda: bench_peers.measure_peers((60_000,), PRECISIONS, 2, 2), bench_peers.table),
        "scaling": (lambda: bench_scaling.measure_scaling(LARGEST, AXES, say), bench_scaling.table),
        "effects": (lambda: apart(measured_effects), bench_effects.table),
    }
    for name, (measure, table) in measures.items():
        if name not in names:
            continue
        try:
            result = measure()
        except InputError as error:
            if name != "peers" or len(names) == 1:
                raise
            say(f"peers not measured: {error}")
            continue
        write_json(out / FILES[name], dated(result))
        if table:
            say(table(result))


def main(words: list[str]) -> None:
    """The command. Raises: InputError as `run_all`."""
    parser = argparse.ArgumentParser(prog="docs/make.py bench measure", description=__doc__)
    parser.add_argument("what", nargs="*", metavar="WHAT", help=f"{', '.join(FILES)} (default: {', '.join(USUAL)})")
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="FOLDER", help="folder of the JSON files")
    parser.add_argument("--scenes", type=Path, nargs="+", default=[], metavar="FILE", help="trained scenes (npz)")
    options = parser.parse_args(words)
    if unknown := [name for name in options.what if name not in FILES]:
        raise InputError(f"bench: {unknown[0]!r} is not allowed; allowed: {', '.join(FILES)}")
    run_all(options.out, tuple(options.what) or USUAL, tuple(options.scenes), print)
