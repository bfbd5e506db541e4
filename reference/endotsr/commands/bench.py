"""`endotsr bench`: where the time of a training iteration goes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from endotsr.commands.options import parse
from endotsr.errors import InputError


@dataclass
class BenchOptions:
    """Time one full training iteration on the common workload: render, all losses, reverse passes, optimiser."""

    what: tyro.conf.Positional[Literal["iteration"]] = "iteration"
    """what to time"""
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
    precision: Literal["float32", "float64"] = "float32"
    """arithmetic"""
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """also write the figures as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(BenchOptions, words, "bench")
    for name, least in (("gaussians", 4), ("repeats", 1), ("width", 16), ("height", 16)):
        if getattr(options, name) < least:
            raise InputError(f"bench: --{name} {getattr(options, name)} is not allowed; allowed: an integer >= {least}")
    import msgspec

    from endotsr.bench.iteration import benchmark_iteration, table
    from endotsr.commands.threads import use_threads
    from endotsr.config import PAPER
    from endotsr.runs import machine, versions, write_json

    threads = use_threads(options.threads)
    config = msgspec.structs.replace(
        PAPER, training=msgspec.structs.replace(PAPER.training, precision=options.precision)
    )
    result = benchmark_iteration(options.gaussians, options.repeats, options.width, options.height, config)
    result |= {"threads": threads, "machine": machine(), "versions": versions()}
    print(
        f"one training iteration: {options.gaussians} Gaussians, {options.width}x{options.height}, colour and depth, "
        f"all losses, {options.precision}, {threads} threads, {options.repeats} repeats"
    )
    print(table(result))
    peak = result["peak_memory_bytes"]
    print(f"first iteration, compiled code loaded or made: {result['first_iteration_s']:.1f} s")
    print(f"peak memory: {peak / 1e9:.2f} GB" if peak else "peak memory: not known")
    if options.json:
        write_json(options.json, result)
    return 0
