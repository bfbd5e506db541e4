"""Measure the distribution of time, and write the generated parts of docs/bench.md and its pictures.

    python docs/make.py bench measure [WHAT ...] [--scenes FILE ...] [--out FOLDER]

on an otherwise idle machine: start, stages, peers and scaling, or the named measurements; `effects` belongs to
docs/effects.md. They run one after the other, each in separate processes. The stages of a machine without AVX-512 have
a file of their own. The command `endotsr bench` only times the stages on this machine.
"""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.method.kernels.threads import use_threads
from endotsr.method.kernels.vectors import REGISTER
from endotsr.results.export.npz import read_arrays
from endotsr.studies.bench import stages
from endotsr.studies.bench.case import BenchCase, Precision, apart
from endotsr.studies.bench.stages import Say
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import dated
from endotsr.untrusted.names import choice
from pages.bench import charts, parts, peers, scaling, start
from pages.bench import effects as bench_effects
from pages.store.commands import loaded
from pages.store.marks import read_json
from pages.store.program import RESULTS, Program

FILES = {
    "start": "bench_start.json", "stages": "bench_stages.json", "peers": "bench_peers.json",
    "scaling": "scaling.json", "effects": "bench_effects.json",
}  # fmt: skip
AVX2 = "bench_stages_avx2.json"  # the stages of a machine without AVX-512
USUAL = ("stages", "scaling", "peers", "start")  # of the page docs/bench.md; `effects` belongs to docs/effects.md
READ = {name: FILES[name] for name in USUAL} | {"avx2": AVX2}  # measurements of the page by name
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


def run_all(out: Path, names: tuple[str, ...], scenes: tuple[Path, ...], say: Say = print) -> None:
    """Measure and write into `out`. Without torch and gsplat the existing figures of the peers are kept.

    Raises: InputError before anything is measured, if a name is unknown or a file of `scenes` is no trained scene.
    """
    if unknown := [name for name in names if name not in FILES]:
        raise InputError(f"bench: {unknown[0]!r} is not allowed; use {choice(FILES)}")
    for path in scenes:
        read_arrays(path)
    out.mkdir(parents=True, exist_ok=True)
    measures: dict[str, Callable[[], Any]] = {
        "start": lambda: start.measure_start(3),
        "stages": lambda: stages.measure_stages(grid(scenes), say),
        "peers": lambda: peers.measure_peers((60_000,), PRECISIONS, 2, 2),
        "scaling": lambda: scaling.measure_scaling(LARGEST, AXES, say),
        "effects": lambda: apart(measured_effects),
    }
    for name in (name for name in measures if name in names):
        try:
            result = measures[name]()
        except InputError as error:
            if name != "peers" or len(names) == 1:
                raise
            say(f"peers not measured: {error}")
            continue
        narrow = name == "stages" and REGISTER < 64
        write_json(out / (AVX2 if narrow else FILES[name]), dated(result))


def read(folder: Path = RESULTS) -> dict[str, dict[str, Any]]:
    """The measurements by name. Raises: InputError if a file is missing or cannot be read."""
    return {name: read_json(folder / file, "python docs/make.py bench measure") for name, file in READ.items()}


def read_runs() -> dict[str, dict[str, Any]]:
    """Records of whole runs, by name."""
    return {path.stem: loaded(path)["run"] for path in sorted(RESULTS.glob("pulling*.json"))}


def fragments(found: Mapping[str, dict[str, Any]], runs: Mapping[str, dict[str, Any]]) -> dict[str, str]:
    """Every generated part by name, from the measurements and the records of whole runs."""
    return {
        "machine": parts.machine(found["stages"]),
        "targets": parts.targets(found["stages"], found["scaling"], found["peers"], found["start"], runs),
        "stages": parts.stages(found["stages"]),
        "avx2": f"{parts.machine(found['avx2'])}\n\n{parts.stage_table(found['avx2'])}",
        "gain": parts.gain(found["stages"]),
        "cases": parts.cases(found["stages"]),
        "scaling": parts.scaling(found["scaling"]),
        "peers": parts.peers(found["peers"]),
        "start": parts.start(found["start"]),
        "runs": parts.runs(runs),
    }


def draw(folder: Path) -> None:
    """The pictures, beside the measurements."""
    found = read(folder)
    charts.stage_bars(found["stages"]["cases"], folder / "bench_stages.png")
    charts.scaling_curves(found["scaling"]["axes"], folder / "scaling.png")


def measured(options: argparse.Namespace) -> None:
    """The named measurements."""
    run_all(options.out, tuple(options.what) or USUAL, tuple(options.scenes))


PROGRAM = Program(
    __name__, "bench.md", lambda: fragments(read(), read_runs()), "", measured,
    {
        "what": {"nargs": "*", "metavar": "WHAT", "help": f"{', '.join(FILES)} (default: {', '.join(USUAL)})"},
        "--out": {"type": Path, "default": RESULTS, "metavar": "FOLDER", "help": "folder of the JSON files"},
        "--scenes": {"type": Path, "nargs": "+", "default": [], "metavar": "FILE", "help": "trained scenes (npz)"},
    },
    lambda record: draw(RESULTS),
)  # fmt: skip
