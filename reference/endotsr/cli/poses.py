"""`endotsr poses`: poses of a moving scope, from pictures and depth."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile, write_result

if TYPE_CHECKING:
    from endotsr.clips.sequences.make_poses import PoseReport


@dataclass
class PosesOptions:
    """Estimate one camera pose per frame, for a clip of a moving scope without a trajectory.

    SEQUENCE is a folder from `endotsr prepare` with depth. The poses are added to its sequence.toml, where their origin
    is stated. Frames that show too little are interpolated, and named. A scope that seems to be still is left as it is,
    and so is a clip whose depth is a plane (`endotsr depth --flat`). Motion of the whole tissue, as in breathing,
    cannot be told from motion of the scope. An interrupted command continues where it was. Exit code 1: nothing
    written, for one of these two reasons.
    """

    sequence: Annotated[Path, Option("SEQUENCE", positional=True)]
    """folder with sequence.toml"""
    replace: bool = False
    """replace existing poses"""
    force: bool = False
    """estimate poses even if the scope seems to be still or the shape of the depth is assumed"""
    html: Annotated[Path | None, Option("FILE.html", written=True)] = None
    """write a page with the path and the quality of every frame"""
    json: JsonFile = None
    """also write poses and their quality as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(PosesOptions, words, "poses")
    from endotsr.cli.parts.progress import StepBar
    from endotsr.clips.sequences.make_poses import PoseProgress, enter_poses, lines_of
    from endotsr.results.report.poses_page import poses_page
    from endotsr.untrusted.writing import replace_text

    with StepBar("poses") as bar:
        report = enter_poses(options.sequence, options.replace, options.force, PoseProgress(bar.begin, bar.step))
    for line in lines_of(report, options.sequence):
        print(line)
    if report.written:
        print(f"written: {options.sequence}; next: endotsr train {options.sequence} --out RUN")
    if options.html is not None:
        replace_text(options.html, poses_page(options.sequence.name, report, lines_of(report, options.sequence)))
        print(f"report: {options.html}")
    _write(options, report)
    return 0 if report.written else 1


def _write(options: PosesOptions, report: "PoseReport") -> None:
    moves = report.movement
    said = {"answer": moves.answer, "left": moves.left, "flow": moves.flow, "pairs": moves.pairs}
    if report.found is None:
        write_result(options.json, sequence=options.sequence, written=False, movement=said)
        return
    found, e = report.found, report.found.estimate
    write_result(
        options.json, sequence=options.sequence, written=True, movement=said, unit=report.unit, path=e.path,
        agreeing=e.agreeing, pixels_left=e.left, pixels_without_motion=e.still, tissue_motion=e.own,
        residual_before=e.before.scale, residual_after=e.after.scale, interpolated=found.interpolated, held=found.held,
        returns=[{"source": one.source, "target": one.target, "agree": one.agree} for one in e.returns],
        poses=[{"rotation": c.rotation.tolist(), "translation": c.translation.tolist()} for c in found.cameras],
    )  # fmt: skip
