"""`endotsr depth`: depth of a sequence, from its stereo pairs or from another program."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import given_names, parse
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.clips.formats.choices import Align, Pairing
from endotsr.clips.prepare.stereo_depth import StereoSettings
from endotsr.errors import InputError
from endotsr.untrusted.names import counted

STEREO = StereoSettings()
LARGEST_RATIO = 100.0  # farthest to nearest tissue

if TYPE_CHECKING:
    from endotsr.clips.prepare.make_depth import DepthReport


@dataclass
class DepthOptions:
    """Add depth to a folder that `endotsr prepare` wrote.

    Stereo pairs are matched by semi-global matching with a left-right consistency check and edge-preserving smoothing.
    Pixels without a reliable match get no depth. --given reads the files of another program instead.

    For a monocular clip there are two options. --kind relative reads the inverse depth of a monocular network; its
    scale and shift are fitted to existing depth (points of a reconstruction) or assumed. --flat needs no files: it
    assumes a plane parallel to the image. With assumed values, lengths and other viewpoints are not metric.
    """

    sequence: Annotated[Path, Option("SEQUENCE", positional=True)]
    """folder with sequence.toml"""
    given: Annotated[Path | None, Option("FOLDER")] = None
    """files of another program, one per frame: npy, npz, mat, pfm, tiff or png; or one array of all frames"""
    kind: Literal["disparity", "depth", "relative"] = "disparity"
    """content of these files: disparity in pixels, depth, or relative inverse depth of a network (larger = nearer)"""
    pairing: Pairing = "auto"
    """how these files belong to frames: by number, by the number in the source of the clip, or in order"""
    align: Align = "auto"
    """with --kind relative: fit scale and shift per frame, or once (auto: per frame if the clip has depth)"""
    farthest_over_nearest: float = 3.0
    """with --kind relative and no reference depth: assumed ratio of the farthest to the nearest tissue"""
    trust_depth: bool = False
    """with --kind depth or relative: read these files so, even if the pictures or the numbers contradict it"""
    flat: bool = False
    """assume a plane parallel to the image, for a clip without any depth"""
    unit_scale: float = 1.0
    """millimetres (or pixels of disparity) per unit of the stored values"""
    stereo: Annotated[StereoSettings, Option(flat=True)] = STEREO
    replace: bool = False
    """replace existing depth"""
    json: JsonFile = None
    """also write the coverage of every frame as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(DepthOptions, words, "depth")
    if not 0 < options.unit_scale < float("inf"):
        raise InputError(f"--unit-scale {options.unit_scale:g} is not allowed; use a number > 0")
    _check_ratio(options)
    from endotsr.cli.parts.next_step import training_step
    from endotsr.clips.sequences.checks.kinds import KINDS
    from endotsr.clips.sequences.sequence_file import DEPTH
    from endotsr.training.runs.files import refuse_linked, refuse_read_only

    refuse_read_only(options.sequence)
    refuse_linked(options.sequence / DEPTH)

    report = _made(options)
    assert report.file.depth is not None
    coverage, unit, step = report.coverage, report.file.depth.unit, report.file.depth.scale
    lowest = min(range(len(coverage)), key=lambda i: coverage[i])
    print(
        f"depth of {counted(len(coverage), 'frame')}: {sum(coverage) / len(coverage):.1%} of the pixels on average,"
        f" {coverage[lowest]:.1%} in frame {lowest}; median {report.median:.4g} {unit}, steps of {step:g}"
    )
    if report.note:
        print(f"  {report.note}")
    if report.file.depth.method.startswith(("relative", "assumed")):
        print(f"  {report.file.depth.method}")
    if "farthest-over-nearest" in given_names(DepthOptions, words) and not report.file.depth.assumed:
        print("  --farthest-over-nearest changes nothing: the clip has depth that fixes scale and shift")
    if report.file.depth.assumed:
        print(f"not metric ({report.file.depth.assumed} of the depth assumed): {KINDS['assumed-depth'].why}")
    for line in depth_warnings(report, options) + _pair_warnings(options):
        print(line)
    print(training_step(options.sequence, report.file))
    write_result(options.json, sequence=options.sequence, coverage=coverage, median=report.median, unit=unit, step=step)
    return 0


def depth_warnings(report: "DepthReport", options: DepthOptions) -> list[str]:
    """Lines on little depth, and on depth in millimetres at no distance of an endoscope."""
    from endotsr.clips.sequences.checks.depth import LITTLE, unit_finding
    from endotsr.clips.sequences.checks.kinds import KINDS

    assert report.file.depth is not None
    said, usual = [], sum(report.coverage) / len(report.coverage)
    if usual < LITTLE:
        pair = "" if options.given else "; are the views rectified, of one moment, and neither mirrored nor turned?"
        said.append(f"warning: little-depth: {usual:.1%} of the pixels have depth; {KINDS['little-depth'].why}{pair}")
    if report.file.depth.unit == "mm":
        found = unit_finding(report.median, str(options.sequence))
        remedy = "--unit-scale states millimetres, or pixels of disparity, per stored unit" if options.given else ""
        remedy = remedy or "check the baseline and its unit"
        said += [f"warning: {each.code}: {each.what}; {each.why}; {remedy}" for each in found]
    return said


def _pair_warnings(options: DepthOptions) -> list[str]:
    """Lines on the pairs that were matched."""
    from endotsr.clips.sequences.checks.stereo import pair_findings
    from endotsr.clips.sequences.layouts.common import describe_prepared

    found = [] if options.flat or options.given else pair_findings(describe_prepared(options.sequence))
    return [f"warning: {each.code}: {each.what}; {each.why}; {each.remedy}" for each in found]


def _check_ratio(options: DepthOptions) -> None:
    """Raises InputError for an invalid ratio of depths."""
    if not 1 < options.farthest_over_nearest <= LARGEST_RATIO:
        raise InputError(
            f"--farthest-over-nearest {options.farthest_over_nearest:g} is not allowed; use a number over 1 to"
            f" {LARGEST_RATIO:g}"
        )


def _made(options: DepthOptions) -> "DepthReport":
    """Compute or read the depth and write it."""
    from endotsr.clips.prepare.make_depth import from_files, from_pairs, from_relative, write_depth
    from endotsr.clips.prepare.relative_depth import flat_depth
    from endotsr.clips.sequences.layouts.common import describe_prepared

    folder, given = options.sequence, options.given
    if options.flat:
        made = flat_depth(describe_prepared(folder))
    elif given is not None and options.kind == "relative":
        farthest, trusted = options.farthest_over_nearest, options.trust_depth
        made = from_relative(folder, given, options.align, farthest, trusted, options.replace, options.pairing)
    elif given is not None and options.kind != "relative":
        made = from_files(folder, given, options.kind, options.unit_scale, options.pairing, options.trust_depth)
    else:
        made = from_pairs(folder, options.stereo)
    return write_depth(folder, made, options.replace, _show_count)


def _show_count(done: int, total: int) -> None:
    """Show a counter on a terminal; nothing for a pipe or a file."""
    if sys.stdout.isatty():
        print(f"\rframe {done} of {total}", end="\n" if done == total else "", flush=True)
