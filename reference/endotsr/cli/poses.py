"""`endotsr poses`: poses of a moving scope, from pictures and depth, or from pictures alone."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile, write_result

if TYPE_CHECKING:
    from endotsr.clips.poses.movement import Movement
    from endotsr.clips.prepare.make_poses import PoseReport
    from endotsr.clips.prepare.make_structure import StructureReport
    from endotsr.method.splatting.camera import Camera


@dataclass
class PosesOptions:
    """Estimate one camera pose per frame, for a clip of a moving scope without a trajectory.

    SEQUENCE is a folder from `endotsr prepare` with depth. The poses are added to its sequence.toml, where their origin
    is stated. Frames that show too little are interpolated, and named. A scope that seems to be still is left as it is,
    and so is a clip whose depth is a plane (`endotsr depth --flat`). Motion of the whole tissue, as in breathing,
    cannot be told from motion of the scope. An interrupted command continues where it was. Exit code 1: nothing
    written, for one of these two reasons.

    --sfm needs no depth: structure from motion by pycolmap (`pip install 'endotsr[sfm]'`). Its path has the unit of the
    depth of the clip. Without depth, the unit becomes arbitrary, and the depth of the points is written. An interrupted
    --sfm begins anew.
    """

    sequence: Annotated[Path, Option("SEQUENCE", positional=True)]
    """folder with sequence.toml"""
    sfm: bool = False
    """structure from motion, from pictures and masks"""
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
    from endotsr.cli.parts.next_step import training_step
    from endotsr.clips.sequences.sequence_file import read_sequence_file
    from endotsr.training.runs.files import refuse_read_only
    from endotsr.untrusted.writing import replace_text

    refuse_read_only(options.sequence)
    written, lines, page = _structure(options) if options.sfm else _estimate(options)
    for line in lines:
        print(line)
    if written:
        print(f"written: {options.sequence}; {training_step(options.sequence, read_sequence_file(options.sequence))}")
    if options.html is not None:
        replace_text(options.html, page())
        print(f"report: {options.html}")
    return 0 if written else 1


Said = tuple[bool, list[str], Callable[[], str]]  # whether poses are written, the sentences, and the page


def _estimate(options: PosesOptions) -> Said:
    """Poses from pictures and depth."""
    from endotsr.cli.parts.progress import StepBar
    from endotsr.clips.prepare.make_poses import PoseProgress, enter_poses, lines_of
    from endotsr.results.report.poses_page import poses_page

    with StepBar("poses") as bar:
        report = enter_poses(options.sequence, options.replace, options.force, PoseProgress(bar.begin, bar.step))
    _write(options, report)
    lines = lines_of(report, options.sequence)
    return report.written, lines, lambda: poses_page(options.sequence.absolute().name, report, lines)


def _structure(options: PosesOptions) -> Said:
    """Poses by structure from motion."""
    from endotsr.cli.parts.progress import StepBar
    from endotsr.clips.prepare.make_poses import PoseProgress
    from endotsr.clips.prepare.make_structure import enter_structure, structure_lines
    from endotsr.results.report.poses_page import structure_page

    with StepBar("poses") as bar:
        report = enter_structure(options.sequence, options.replace, options.force, PoseProgress(bar.begin, bar.step))
    _write_structure(options, report)
    lines = structure_lines(report, options.sequence)
    return report.written, lines, lambda: structure_page(options.sequence.absolute().name, report, lines)


def _movement(moves: "Movement") -> dict[str, Any]:
    return {"answer": moves.answer, "left": moves.left, "flow": moves.flow, "pairs": moves.pairs}


def _rows(cameras: Iterable["Camera"]) -> list[dict[str, Any]]:
    return [{"rotation": c.rotation.tolist(), "translation": c.translation.tolist()} for c in cameras]


def _write(options: PosesOptions, report: "PoseReport") -> None:
    said = _movement(report.movement)
    if report.found is None:
        write_result(options.json, sequence=options.sequence, written=False, movement=said)
        return
    found, e = report.found, report.found.estimate
    write_result(
        options.json, sequence=options.sequence, written=True, movement=said, unit=report.unit, path=e.path,
        agreeing=e.agreeing, pixels_left=e.left, pixels_without_motion=e.still, tissue_motion=e.own,
        residual_before=e.before.scale, residual_after=e.after.scale, interpolated=found.interpolated, held=found.held,
        returns=[{"source": one.source, "target": one.target, "agree": one.agree} for one in e.returns],
        poses=_rows(found.cameras),
    )  # fmt: skip


def _write_structure(options: PosesOptions, report: "StructureReport") -> None:
    said = _movement(report.movement) | {"drift": report.movement.drift}
    found, scale = report.structure, report.scale
    if found is None:
        write_result(options.json, sequence=options.sequence, written=False, movement=said)
        return
    told = {} if scale is None else {"factor": scale.factor, "spread": scale.spread, "inside": scale.inside}
    write_result(
        options.json, sequence=options.sequence, written=True, movement=said, unit=report.unit, path=report.path,
        points=len(found.points), pixels_off=found.error, other_models=found.others, scale=told or None,
        interpolated=list(report.interpolated), held=list(report.held), poses=_rows(report.cameras),
    )  # fmt: skip
