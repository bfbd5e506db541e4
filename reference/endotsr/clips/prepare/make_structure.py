"""`endotsr poses --sfm`: camera poses by structure from motion, recorded in the `sequence.toml` of a clip.

In: a folder in the common format. Out: one pose for each frame, in the unit of the depth of the clip. A clip without
depth, or whose depth is an assumed plane, gets the depth of the points, and its unit becomes arbitrary: a single camera
shows no lengths.
"""

from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import ARBITRARY, Intrinsics
from endotsr.clips.poses.estimate import movement_of
from endotsr.clips.poses.matches import matcher_of
from endotsr.clips.poses.movement import Movement, drift, with_assumed_depth
from endotsr.clips.poses.path_scale import PathScale, scale_of
from endotsr.clips.poses.structure import Structure, reconstructed, refuse_too_few
from endotsr.clips.poses.views import Views, small_views
from endotsr.clips.prepare.make_depth import write_depth
from endotsr.clips.prepare.make_poses import SILENT, PoseProgress
from endotsr.clips.prepare.pose_record import as_now, cameras_of, gap_lines, open_for_poses, pose_entry, resting_views
from endotsr.clips.prepare.relative_depth import MadeDepth
from endotsr.clips.sequences.clip import Clip, Depth
from endotsr.clips.sequences.layouts.common import describe_prepared
from endotsr.clips.sequences.points import depth_from_points
from endotsr.clips.sequences.sequence_file import DEPTH, FILE_NAME, SequenceFile, sequence_text
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.untrusted.writing import replace_text

METHOD = "points of structure from motion, interpolated"
OWN_UNIT = "the scale is arbitrary: 1 is the median depth of the points"


class StructureReport(NamedTuple):
    """What `enter_structure` found."""

    written: bool
    movement: Movement
    unit: str
    structure: Structure | None = None  # None: the clip is left as it is
    scale: PathScale | None = None  # None: there was no depth to compare with
    cameras: tuple[Camera, ...] = ()
    interpolated: tuple[int, ...] = ()  # frames whose pose is interpolated between others
    held: tuple[int, ...] = ()  # frames before the first or after the last pose, which have its pose

    @property
    def path(self) -> float:
        """Length of the path of the camera, in the unit."""
        centres = np.array([-camera.rotation.T @ camera.translation for camera in self.cameras])
        return float(np.linalg.norm(np.diff(centres, axis=0), axis=1).sum())


def enter_structure(
    folder: Path, replace: bool = False, force: bool = False, watch: PoseProgress = SILENT
) -> StructureReport:
    """Reconstruct a folder in the common format and record its poses, and depth where it has none.

    replace   whether existing poses may be replaced
    force     whether poses are written even if the scope seems to be still by the depth of the clip, or does not
              clearly move by that of the points

    Raises:  InputError, leaving the folder unchanged: without pycolmap, without a model, if too few frames are
             registered, or if the depth of the clip does not tell one scale.
    """
    file, clip = open_for_poses(folder, replace)
    _refuse_stereo(folder, clip)
    views, known = resting_views(clip), _compared(clip.depth)
    if known is None and file.depth is None and (folder / DEPTH).exists():
        raise InputError(f"{folder / DEPTH}: {FILE_NAME} does not name this folder; the depth of the points goes there")
    moves = None if known is None else with_assumed_depth(movement_of(views)[2], known.assumed)
    if moves is not None and moves.answer == "still" and not force:
        return StructureReport(False, moves, clip.unit_in_words)
    watch.begin(views.count)
    found = reconstructed(views, watch.step)
    if found is None:
        raise InputError(f"{folder}: {_no_model(views)}")
    refuse_too_few(found)
    if moves is not None:
        scaled = _scaled(folder, found, views)
        return _recorded(folder, as_now(folder, file), scaled, views, moves)
    views = views._replace(depth=np.stack([_depth_of(found, views, k) for k in range(views.count)]))
    moves = movement_of(views)[2]
    if moves.answer != "moving" and not force:
        return StructureReport(False, moves, clip.unit_in_words)
    file = msgspec.structs.replace(as_now(folder, file), unit=ARBITRARY, depth=None)
    report = _recorded(folder, file, (found, None), views, moves)
    write_depth(folder, MadeDepth(iter(views.depth), METHOD, ""), replace=True)
    return report


def _recorded(
    folder: Path, file: SequenceFile, scaled: tuple[Structure, PathScale | None], views: Views, moves: Movement
) -> StructureReport:
    """The report, after its poses are written."""
    found, scale = scaled
    cameras, interpolated, held = cameras_of(found.poses, views.camera)
    said = "scaled to the depth of the clip" if scale else OWN_UNIT
    origin = f"structure from motion by pycolmap {version('pycolmap')}; {said}"
    entry = pose_entry(cameras, file.unit, origin, sorted(interpolated + held))
    replace_text(folder / FILE_NAME, sequence_text(msgspec.structs.replace(file, poses=entry)))
    unit = describe_prepared(folder).unit_in_words
    return StructureReport(True, moves, unit, found, scale, tuple(cameras), tuple(interpolated), tuple(held))


def _refuse_stereo(folder: Path, clip: Clip) -> None:
    """Raises InputError for a stereo pair or a baseline without depth: it is a length, and the path would have another
    unit."""
    if (clip.right or clip.baseline) and _compared(clip.depth) is None:
        raise InputError(
            f"{folder}: a stereo pair gives lengths: run endotsr depth {folder} first; --sfm then scales the path to it"
        )


def _compared(depth: Depth | None) -> Depth | None:
    """The depth to which the path is scaled: not that of an earlier reconstruction, and not an assumed plane."""
    return None if depth is None or depth.method == METHOD or depth.assumed == "shape" else depth


def _no_model(views: Views) -> str:
    moves = drift(matcher_of(small_views(views._replace(depth=np.ones_like(views.depth)))))
    return (
        "no three frames show enough common points from places that are far enough apart: the scope is still, only"
        f" turns, or shows too little texture; {moves.sentence}"
    )


def _scaled(folder: Path, found: Structure, views: Views) -> tuple[Structure, PathScale]:
    """The structure in the unit of the depth of the clip. Raises InputError if the scale cannot be told."""
    scale = scale_of(found, views)
    if not scale.told:
        raise InputError(
            f"{folder}: {scale.sentence}; without this depth, endotsr poses --sfm writes depth of the points, to which"
            " endotsr depth --given FILES --kind relative --replace fits scale and shift of every frame"
        )
    return found.scaled(scale.factor), scale


def _depth_of(found: Structure, views: Views, k: int) -> NDArray[np.float32]:
    """Depth (H, W) of the tissue of frame k, inside the hull of the points that it sees; 0 = none."""
    c, pose = views.camera, found.poses[k]
    if pose is None:
        return np.zeros((c.height, c.width), np.float32)
    intrinsics = Intrinsics(c.fx, c.fy, c.cx, c.cy, c.width, c.height)
    depth = depth_from_points(found.points[found.seen[k]], pose, intrinsics, "interpolated")
    return np.where(views.tissue[k], depth, np.float32(0))


def structure_lines(report: StructureReport, folder: Path) -> list[str]:
    """What is said of a report, in sentences."""
    lines, found = [report.movement.sentence], report.structure
    if found is None:
        why = "still" if report.movement.answer == "still" else "no clear motion of the scope"
        return [*lines, f"{folder}: {why}: left as it is; --force writes the poses all the same"]
    if report.movement.answer != "moving":
        lines.append("warning: if the scope is still, these poses are motion of the tissue; then do not use them")
    count = len(found.poses)
    lines.append(
        f"{count - len(found.without)} of {count} frames registered by {len(found.points)} points, which are"
        f" {found.error:.2f} pixels off on average; path {report.path:.4g} {report.unit}"
    )
    if found.others:
        lines.append(f"not used: further models of {', '.join(map(str, found.others))} frames, without a common scale")
    lines += gap_lines(list(report.interpolated), list(report.held))
    if report.scale is not None:
        lines.append(report.scale.sentence)
    else:
        lines.append(f"{OWN_UNIT}; the depth of the points is written to {DEPTH}/, and no length is a measurement")
    lines.append("what the whole tissue does in common, as in breathing, no method can tell from motion of the scope")
    return lines
