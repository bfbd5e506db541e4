"""`endotsr depth`: depth of a sequence, from its stereo pairs or from files of another program."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.errors import InputError
from endotsr.runs.files import refuse_unwritable

if TYPE_CHECKING:
    from endotsr.sequences.make_depth import DepthReport


@dataclass
class DepthOptions:
    """Make the depth of a folder that `endotsr prepare` wrote.

    From the stereo pairs: semi-global matching, a check of left against right, and edge-preserving smoothing. Pixels
    without a reliable match stay without depth. With --given, the files of another program are read as they are.
    """

    sequence: Annotated[Path, Option("SEQUENCE", positional=True)]
    """folder with sequence.toml"""
    given: Annotated[Path | None, Option("FOLDER")] = None
    """files of another program, one a frame: npy, pfm, tiff or png"""
    kind: Literal["disparity", "depth"] = "disparity"
    """what these files hold: disparity in pixels, or depth"""
    unit_scale: float = 1.0
    """length (or pixels of disparity) of one step of the stored numbers, in millimetres"""
    nearest: float = 20.0
    """nearest depth that is searched, mm"""
    farthest: float = 300.0
    """farthest depth that is searched, mm"""
    block: Literal[3, 5, 7, 9, 11] = 5
    """side of the matched blocks, px"""
    smooth: bool = True
    """edge-preserving smoothing by weighted least squares"""
    agreement: float = 1.0
    """largest difference between the disparities of left and right, px"""
    confidence: float = 0.5
    """least confidence of the smoothing, 0 to 1"""
    temporal: bool = False
    """median over three frames along the optical flow"""
    replace: bool = False
    """replace depth that exists"""
    json: JsonFile = None
    """also write the coverage of every frame as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(DepthOptions, words, "depth")
    refuse_unwritable(options.json)
    for name in ("nearest", "farthest", "unit_scale", "agreement"):
        if not 0 < getattr(options, name) < float("inf"):
            key = name.replace("_", "-")
            raise InputError(f"--{key} {getattr(options, name):g} is not allowed; allowed: a number > 0")
    report = _made(options)
    assert report.file.depth is not None
    coverage, unit, step = report.coverage, report.file.depth.unit, report.file.depth.scale
    lowest = min(range(len(coverage)), key=lambda i: coverage[i])
    print(
        f"depth of {len(coverage)} frames: {sum(coverage) / len(coverage):.1%} of the pixels on average,"
        f" {coverage[lowest]:.1%} in frame {lowest}; median {report.median:.4g} {unit}, steps of {step:g}"
    )
    print(f"next: endotsr train {options.sequence} --out RUN")
    write_result(options.json, sequence=options.sequence, coverage=coverage, median=report.median, unit=unit, step=step)
    return 0


def _made(options: DepthOptions) -> "DepthReport":
    """Depth of another program, or that of the stereo pairs."""
    from endotsr.sequences.make_depth import make_stereo_depth, take_given_depth
    from endotsr.sequences.stereo_depth import StereoSettings

    if options.given is not None:
        return take_given_depth(
            options.sequence, options.given, options.kind, options.unit_scale, options.replace, _said
        )
    names = ("nearest", "farthest", "block", "smooth", "agreement", "confidence", "temporal")
    settings = StereoSettings(**{name: getattr(options, name) for name in names})
    return make_stereo_depth(options.sequence, settings, options.replace, _said)


def _said(done: int, total: int) -> None:
    """A line that counts on a terminal; a pipe or a file gets none."""
    if sys.stdout.isatty():
        print(f"\rframe {done} of {total}", end="\n" if done == total else "", flush=True)
