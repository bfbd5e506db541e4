"""`endotsr bench`: where the time goes, how it grows, how it compares. One options class for each thing to measure."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from endotsr.commands.options import parse
from endotsr.errors import InputError

JsonFile = Annotated[Path | None, tyro.conf.arg(metavar="FILE")]
Precision = Literal["float32", "float64"]


@dataclass
class IterationOptions:
    """Time one full training iteration on the common workload: render, all losses, reverse passes, optimiser."""

    gaussians: int = 60_000
    """number of Gaussians"""
    width: int = 640
    """columns of the picture"""
    height: int = 512
    """rows of the picture"""
    repeats: int = 15
    """timed iterations"""
    threads: int = 2
    """threads, 0 = all cores"""
    precision: Precision = "float32"
    """arithmetic"""
    json: JsonFile = None
    """also write the figures as JSON"""


@dataclass
class StagesOptions:
    """Time every stage of an iteration, beside the limit that the measured peaks of this machine set it."""

    gaussians: tuple[int, ...] = (20_000, 60_000, 150_000)
    """numbers of Gaussians of the common workload; none with an empty list"""
    scenes: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE ...")] = ()
    """trained scenes (npz) to time as well"""
    precisions: tuple[Precision, ...] = ("float32", "float64")
    """arithmetic"""
    threads: tuple[int, ...] = (1, 2)
    """numbers of threads"""
    width: int = 640
    """columns of the picture"""
    height: int = 512
    """rows of the picture"""
    repeats: int = 11
    """timed iterations a case"""
    json: JsonFile = None
    """also write the figures as JSON"""
    plot: JsonFile = None
    """also draw the stacked bars as a picture (png or svg)"""


def run(words: list[str]) -> int:
    """The command: the first word says what to measure."""
    if not words or words[0] in ("-h", "--help"):
        print(_overview())
        return 0
    what, rest = (words[0], words[1:]) if not words[0].startswith("-") else ("iteration", words)
    if what not in MEASURES:
        raise InputError(f"bench: unknown {what!r}; allowed: {', '.join(MEASURES)}")
    options, measure = MEASURES[what]
    chosen = parse(options, rest, f"bench {what}")
    _refuse_nothing(chosen)
    measure(chosen)
    return 0


def _refuse_nothing(options: Any) -> None:
    for name, least in (("gaussians", 4), ("repeats", 1), ("width", 16), ("height", 16), ("threads", 0)):
        values = getattr(options, name, least)
        for value in values if isinstance(values, tuple) else (values,):
            if value < least:
                raise InputError(f"bench: --{name} {value} is not allowed; allowed: an integer >= {least}")


def _overview() -> str:
    lines = ["usage: endotsr bench WHAT [OPTIONS]", "", "what to measure:"]
    lines += [f"  {name:<10}{(options.__doc__ or '').splitlines()[0]}" for name, (options, _) in MEASURES.items()]
    return "\n".join(
        [*lines, "", "`endotsr bench WHAT --help` lists the options; `iteration` is measured without WHAT."]
    )


def _record(path: Path | None, result: dict[str, Any]) -> None:
    """The figures as JSON, dated, with the machine and the versions."""
    from endotsr.runs import machine, now, versions, write_json

    if path:
        write_json(path, {"date": now(), "machine": machine(), "versions": versions()} | result)


def _iteration(options: IterationOptions) -> None:
    import msgspec

    from endotsr.bench.iteration import benchmark_iteration, table
    from endotsr.commands.threads import use_threads
    from endotsr.config import PAPER

    threads = use_threads(options.threads)
    config = msgspec.structs.replace(
        PAPER, training=msgspec.structs.replace(PAPER.training, precision=options.precision)
    )
    result = benchmark_iteration(options.gaussians, options.repeats, options.width, options.height, config)
    print(
        f"one training iteration: {options.gaussians} Gaussians, {options.width}x{options.height}, colour and depth, "
        f"all losses, {options.precision}, {threads} threads, {options.repeats} repeats"
    )
    print(table(result))
    peak = result["peak_memory_bytes"]
    print(f"first iteration, compiled code loaded or made: {result['first_iteration_s']:.1f} s")
    print(f"peak memory: {peak / 1e9:.2f} GB" if peak else "peak memory: not known")
    _record(options.json, result | {"threads": threads})


def _stages(options: StagesOptions) -> None:
    from endotsr.bench import charts, stages

    result = stages.measure_stages(stages.grid(options), print)
    for case in result["cases"]:
        print(f"\n{stages.name_of(case['case'])}\n{stages.table(case)}")
    _record(options.json, result)
    if options.plot:
        charts.stage_bars(result["cases"], options.plot)


MEASURES: dict[str, tuple[type, Callable[[Any], None]]] = {
    "iteration": (IterationOptions, _iteration),
    "stages": (StagesOptions, _stages),
}
