"""`endotsr bench`: the time of each stage of a training iteration on this machine, with its lower bound."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile
from endotsr.errors import InputError
from endotsr.studies.bench.case import BenchCase, Precision
from endotsr.training.runs.files import write_json

LEAST = {"gaussians": 4, "repeats": 1, "width": 16, "height": 16, "threads": 1}


@dataclass
class BenchOptions:
    """Time every stage of a training iteration, with a lower bound from the measured peaks of this machine.

    The iteration is one of the published schedule with all components active, on a standard workload or on trained
    --scenes. Every combination of size, precision and threads is measured in a separate process.
    """

    gaussians: Annotated[tuple[int, ...], Option("INT ...", may_be_empty=True)] = (60_000,)
    """numbers of Gaussians of the standard workload; may be empty with --scenes"""
    scenes: Annotated[tuple[Path, ...], Option("FILE ...")] = ()
    """trained scenes to time too: npz with xyz, log_scale, quat_wxyz, rgb, opacity"""
    precisions: tuple[Precision, ...] = ("float32",)
    """arithmetic: float32, float64"""
    threads: tuple[int, ...] = (2,)
    """numbers of threads"""
    width: int = 640
    """width of the picture, pixels"""
    height: int = 512
    """height of the picture, pixels"""
    repeats: int = 11
    """timed iterations per case"""
    json: JsonFile = None
    """also write the results as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(BenchOptions, words, "bench")
    _refuse(options)

    from endotsr.studies.bench import stages
    from endotsr.training.runs.machine import dated

    result = stages.measure_stages(cases_of(options), print)
    for case in result["cases"]:
        print(f"\n{stages.name_of(case['case'])}\n{stages.table(case)}")
    if options.json:
        write_json(options.json, dated(result))
    return 0


def _refuse(options: BenchOptions) -> None:
    for name, least in LEAST.items():
        values = getattr(options, name)
        for value in values if isinstance(values, tuple) else (values,):
            if value < least:
                raise InputError(f"bench: --{name} {value} is not allowed; use an integer >= {least}")
    if not options.gaussians and not options.scenes:
        raise InputError("bench: --gaussians is empty and there are no --scenes; use one or more numbers, or --scenes")


def cases_of(options: BenchOptions) -> list[BenchCase]:
    """Every combination of scene, precision and threads, the standard workload first."""
    base = BenchCase(width=options.width, height=options.height, repeats=options.repeats)
    scenes = [replace(base, gaussians=n) for n in options.gaussians]
    scenes += [replace(base, scene=str(path)) for path in options.scenes]
    return [
        replace(scene, precision=precision, threads=threads)
        for scene in scenes
        for precision in options.precisions
        for threads in options.threads
    ]
