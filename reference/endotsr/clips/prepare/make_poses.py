"""`endotsr poses`: camera poses of a clip with depth, recorded in its `sequence.toml`.

In: a folder in the common format, or a `Sequence` in memory. Out: one pose for each frame, with frames named whose pose
is interpolated. An interrupted call leaves its frames in `poses.partial.json`, and the next one continues there.
"""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from endotsr.clips.poses.chain import Chain, Link
from endotsr.clips.poses.estimate import ADJUSTMENTS, APART, PathEstimate, estimated, movement_of
from endotsr.clips.poses.matches import Matcher
from endotsr.clips.poses.movement import FramePair, Movement, with_assumed_depth
from endotsr.clips.poses.views import Views
from endotsr.clips.prepare.pose_record import as_now, cameras_of, gap_lines, open_for_poses, pose_entry, resting_views
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.sequence_file import FILE_NAME, sequence_text
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera, CameraPose
from endotsr.untrusted.json import read_json, typed
from endotsr.untrusted.names import counted
from endotsr.untrusted.sections import Section
from endotsr.untrusted.writing import replace_text

PARTIAL = "poses.partial.json"
KEEP_EVERY = 16  # frames between two writes of the partial result
ORIGIN = "estimated by endotsr poses from pictures and depth"
Row = Annotated[list[float], msgspec.Meta(min_length=12, max_length=12)]


class EstimatedPoses(NamedTuple):
    """Cameras of every frame, and the estimate."""

    cameras: list[Camera]  # n
    interpolated: list[int]  # frames whose pose is interpolated between others
    held: list[int]  # frames before the first or after the last pose, which have its pose
    estimate: PathEstimate


class PoseReport(NamedTuple):
    """What `enter_poses` found."""

    written: bool
    movement: Movement
    found: EstimatedPoses | None  # None: the clip is left as it is
    unit: str


class _Partial(Section, frozen=True, kw_only=True):
    """The chain of an interrupted call; lists have one entry for each frame done."""

    clip: str  # hash of the files
    poses: list[Row | None]
    links: list[tuple[int, int, float, float, float] | None]
    key: int
    last: int


class PoseProgress(NamedTuple):
    """What is told of the work while it goes on."""

    begin: Callable[[int], object] = lambda steps: None
    step: Callable[[], object] = lambda: None


SILENT = PoseProgress()


def estimate_poses(sequence: Sequence, watch: PoseProgress = SILENT) -> EstimatedPoses:
    """The cameras of a sequence, from its pictures, masks and depth. The first one keeps its pose.

    watch     called with the number of steps, and after each

    Raises:   InputError for one frame, no depth, frames that do not match, or too long a gap.
    """
    views = Views(sequence.images, sequence.masks, sequence.depth, sequence.cameras[0])
    watch.begin(sequence.count - 1 + ADJUSTMENTS)
    found = estimated(views, on_frame=lambda chain: watch.step(), on_step=watch.step)
    return _with_cameras(found, sequence.cameras[0])


def enter_poses(folder: Path, replace: bool = False, force: bool = False, watch: PoseProgress = SILENT) -> PoseReport:
    """Estimate the poses of a folder in the common format and record them.

    replace   whether existing poses may be replaced
    force     whether poses are written even if the scope seems to be still, or the shape of the depth is assumed

    Raises:   InputError, leaving the folder unchanged but for the partial result.
    """
    file, clip = open_for_poses(folder, replace)
    if clip.depth is None:
        raise InputError(
            f"{folder}: no depth, and poses are estimated from it; run endotsr depth {folder} first, or endotsr poses"
            f" {folder} --sfm, which needs none: structure from motion"
        )
    views, unit = resting_views(clip), clip.unit_in_words
    matcher, pairs, moves = movement_of(views)
    known = matcher, pairs, with_assumed_depth(moves, clip.depth.assumed)
    # On a real rigid clip, poses fitted to a plane gave a scene that is worse than a copy of the nearest frame.
    if (known[2].answer == "still" or clip.depth.assumed == "shape") and not force:
        return PoseReport(False, known[2], None, unit)
    found = _resumed(folder, views, known, watch)
    entry = pose_entry(found.cameras, file.unit, ORIGIN, sorted(found.interpolated + found.held))
    replace_text(folder / FILE_NAME, sequence_text(msgspec.structs.replace(as_now(folder, file), poses=entry)))
    (folder / PARTIAL).unlink(missing_ok=True)
    return PoseReport(True, known[2], found, unit)


def _resumed(
    folder: Path, views: Views, known: tuple[Matcher, list[FramePair], Movement], watch: PoseProgress
) -> EstimatedPoses:
    """PathEstimate, beginning with the partial result of this clip, and keep one on the way."""
    mark, latest = _mark(views), [_read_partial(folder / PARTIAL, _mark(views))]
    watch.begin(views.count - 1 + ADJUSTMENTS)
    for _ in range(len(latest[0].poses) - 1 if latest[0] else 0):
        watch.step()

    def on_frame(chain: Chain) -> None:
        latest[0] = chain
        if len(chain.poses) % KEEP_EVERY == 0:
            _write_partial(folder / PARTIAL, mark, chain)
        watch.step()

    try:
        found = estimated(views, on_frame=on_frame, on_step=watch.step, begun=latest[0], known=known)
    except KeyboardInterrupt:
        if latest[0] is not None:
            _write_partial(folder / PARTIAL, mark, latest[0])
        raise KeyboardInterrupt(f"the same command continues from {folder / PARTIAL}") from None
    return _with_cameras(found, views.camera)


def _with_cameras(found: PathEstimate, first: Camera) -> EstimatedPoses:
    """A camera for each frame: gaps are interpolated, and both ends are held."""
    cameras, interpolated, held = cameras_of(found.poses, first)
    return EstimatedPoses(cameras, interpolated, held, found)


def _mark(views: Views) -> str:
    """SHA-256 of everything that the poses depend on."""
    found = hashlib.sha256(repr(views.camera[2:]).encode())
    for plane in (views.images, views.tissue, views.depth):
        found.update(np.ascontiguousarray(plane).data)
    return found.hexdigest()


def _read_partial(path: Path, mark: str) -> Chain | None:
    """The chain of an interrupted call on the same clip; None without one, or if the file is of no use."""
    if not path.is_file():
        return None
    try:
        kept = typed(read_json(path), _Partial, path)
    except InputError:
        return None
    ends = (kept.key, kept.last, next((k for k, pose in enumerate(kept.poses) if pose), -1))
    whole = len(kept.poses) == len(kept.links) and all(0 <= k < len(kept.poses) and kept.poses[k] for k in ends)
    if kept.clip != mark or not whole:
        return None
    poses = [None if row is None else _pose_of(row) for row in kept.poses]
    return Chain(poses, [None if link is None else Link(*link) for link in kept.links], kept.key, kept.last)


def _pose_of(row: list[float]) -> CameraPose:
    matrix = np.array(row, np.float64).reshape(3, 4)
    return CameraPose(np.ascontiguousarray(matrix[:, :3]), np.ascontiguousarray(matrix[:, 3]))


def _write_partial(path: Path, mark: str, chain: Chain) -> None:
    rows = [None if pose is None else np.column_stack(pose).ravel().tolist() for pose in chain.poses]
    kept = {"clip": mark, "poses": rows, "links": chain.links, "key": chain.key, "last": chain.last}
    replace_text(path, json.dumps(kept) + "\n")


def lines_of(report: PoseReport, folder: Path) -> list[str]:
    """What is said of a report, in sentences."""
    lines = [report.movement.sentence]
    found = report.found
    if found is None:
        return [*lines, f"{folder}: {_why_left(report.movement)}: left as it is; --force estimates poses all the same"]
    if report.movement.answer == "unclear":
        lines.append("warning: if the scope is still, these poses are motion of the tissue; then do not use them")
    e, unit = found.estimate, report.unit
    left = f"the poses leave {e.left:.2f} pixels of the {e.still:.2f} that the picture moves"
    left = left if np.isfinite(e.left) else "no pair of frames is left to hold the poses against"
    lines.append(f"path {e.path:.4g} {unit}; {e.agreeing:.0%} of the matches agree; {left}")
    if e.returns:
        lines.append(
            f"the scope sees earlier places again: {len(e.returns)} pairs of frames hold the path against drift"
        )
    lines += gap_lines(found.interpolated, found.held)
    apart = min(APART, len(e.poses) - 1)
    own = f"beside the rigid motion, tissue moves by {e.own:.2g} {unit}"
    own += f" (median, over {counted(apart, 'frame')})"
    if not np.isfinite(e.own):
        own = "how tissue moves beside the rigid motion cannot be told: no two frames apart match"
    lines.append(
        f"{own}; what the whole tissue does in common, as in breathing, no method can tell from motion of the scope: it"
        " is in the path"
    )
    return lines


def _why_left(moves: Movement) -> str:
    if moves.assumed and moves.answer != "still":
        return "the shape of the depth is assumed, and poses are as wrong as the depth that they are fitted to"
    return "still"
