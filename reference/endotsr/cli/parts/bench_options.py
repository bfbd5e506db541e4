"""The options of each measurement of `endotsr bench`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from endotsr.bench.case import Precision
from endotsr.cli.parts.fields import Option

File = Annotated[Path | None, Option("FILE")]


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
    json: File = None
    """also write the figures as JSON"""


@dataclass
class StagesOptions:
    """Time every stage of an iteration, beside its limit from the measured peaks of this machine."""

    gaussians: Annotated[tuple[int, ...], Option("INT ...", may_be_empty=True)] = (20_000, 60_000, 150_000)
    """numbers of Gaussians of the common workload; may be empty with --scenes"""
    scenes: Annotated[tuple[Path, ...], Option("FILE ...")] = ()
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
    json: File = None
    """also write the figures as JSON"""
    plot: File = None
    """also draw the stacked bars as a picture (png or svg)"""


@dataclass
class EffectsOptions:
    """Measure what each part that can be switched off takes of an iteration, and that a part that is off is free."""

    gaussians: int = 20_000
    """Gaussians of the common workload"""
    width: int = 320
    """columns of the picture"""
    height: int = 256
    """rows of the picture"""
    repeats: int = 15
    """timed turns of each state"""
    threads: int = 1
    """threads, 0 = all cores; times are processor times of all threads"""
    json: File = None
    """also write the figures as JSON"""


@dataclass
class ScalingOptions:
    """Measure cost against each size alone, with fitted exponents, and memory per Gaussian."""

    axes: tuple[Literal["gaussians", "pairs", "pixels", "bases", "frequencies", "frames"], ...] = (
        "gaussians", "pairs", "pixels", "bases", "frequencies", "frames",
    )  # fmt: skip
    """which sizes to vary"""
    largest: int = 1_000_000
    """Gaussians of the largest scene; a million takes about 10 GB"""
    json: File = None
    """also write the figures as JSON"""
    plot: File = None
    """also draw the curves as a picture (png or svg)"""


@dataclass
class PeersOptions:
    """Compare with gsplat's pure-torch reference on the same arrays in the same run. Needs torch."""

    gaussians: tuple[int, ...] = (60_000,)
    """numbers of Gaussians of the common workload"""
    precisions: tuple[Precision, ...] = ("float32", "float64")
    """arithmetic"""
    threads: int = 2
    """threads of both"""
    repeats: int = 2
    """timed repeats of the peer"""
    json: File = None
    """also write the figures as JSON"""


@dataclass
class StartOptions:
    """Time from the call to the end of the first iteration, without compiled kernels and with them."""

    repeats: int = 3
    """warm starts"""
    json: File = None
    """also write the figures as JSON"""


@dataclass
class AllOptions:
    """Run start, stages, peers and scaling on an otherwise idle machine; write JSON files and pictures to --out."""

    out: Path
    """folder for the results"""
    scenes: Annotated[tuple[Path, ...], Option("FILE ...")] = ()
    """trained scenes (npz) to time as well"""
