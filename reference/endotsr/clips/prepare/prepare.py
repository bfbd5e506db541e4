"""Conversion of a clip into a folder in the common format.

In: a `Clip` and `PrepareSettings`. Out: a new folder with pictures, masks, depth and `sequence.toml`, and notes on
every assumption. Frames are read, undistorted, resized and written one at a time. The folder appears when it is
complete.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import ARBITRARY, Intrinsics
from endotsr.clips.formats.choices import Border, DepthOfPoints, Gaps, PictureKind
from endotsr.clips.formats.files import shortened
from endotsr.clips.formats.trajectory import filled
from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import write_png
from endotsr.clips.prepare.editing import (
    chosen_frames,
    masks_by_time,
    paired_by_time,
    thinned,
    with_partner,
    without,
    written_times,
)
from endotsr.clips.prepare.prepared_masks import mask_entry, write_mask
from endotsr.clips.prepare.replaced import lost_notes, replaced_file
from endotsr.clips.prepare.stated_depth import refuse_no_lengths
from endotsr.clips.prepare.straighten import Straightener, straightener
from endotsr.clips.sequences.checks.agreement import agreement_findings, agreement_of
from endotsr.clips.sequences.checks.cameras import baseline_findings, intrinsics_findings
from endotsr.clips.sequences.checks.depth_pair import depth_pair_findings
from endotsr.clips.sequences.checks.frames import FrameFacts, frame_facts, frame_findings
from endotsr.clips.sequences.checks.guard import notes_of
from endotsr.clips.sequences.checks.kinds import Finding
from endotsr.clips.sequences.checks.written import WrittenFrames
from endotsr.clips.sequences.clip import Clip, PicturePair
from endotsr.clips.sequences.crop import Crop
from endotsr.clips.sequences.depth_files import CLIPPED, step_of_depth, write_levels
from endotsr.clips.sequences.layouts.common import describe_prepared
from endotsr.clips.sequences.points import depth_from_points
from endotsr.clips.sequences.sequence_file import (
    DEPTH,
    FILE_NAME,
    FORMAT,
    IMAGES,
    RIGHT,
    WRITTEN,
    CameraEntry,
    DepthEntry,
    MaskEntry,
    PoseEntry,
    SequenceFile,
    write_sequence_file,
)
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.writing import leftover_notes, new_folder

LARGEST = 99.8  # percentile taken as the largest depth of a frame, without outliers
FAR_BEYOND = "at least eight times the usual largest depth"  # where the largest level is, see `step_of_depth`
OnFrame = Callable[[int, int], None]


@dataclass(frozen=True)
class PrepareSettings:
    """Settings of the conversion."""

    frames: str = ""  # of the source; see `editing.chosen_frames`
    drop: str = ""  # frames to omit, in the same syntax
    rate: float | None = None  # frames per second to keep
    right_late: int = 0  # frames of the source by which the right view is late; negative: early
    masks_late: int = 0  # the same of the masks
    scale: float = 1.0
    gaps: Gaps = "refuse"  # frames without mask or pose where others have one
    border: Border = "auto"  # outside of the field of view; auto: excluded if the clip has no masks
    pictures: PictureKind = "png"
    points: DepthOfPoints = "interpolated"


def prepare(
    clip: Clip,
    out: Path,
    settings: PrepareSettings,
    on_frame: OnFrame = lambda i, n: None,
    replace: bool = False,
) -> tuple[SequenceFile, list[str]]:
    """Write the frames to the new folder `out`. Returns the contents of `sequence.toml`, and the notes.

    on_frame  called with (frames written, frames in all)
    replace   whether a folder written by `prepare` may be replaced once the new one is complete

    Raises:  InputError, leaving nothing behind.
    """
    if settings.right_late:
        clip = paired_by_time(clip, settings.right_late)
    if settings.masks_late:
        clip = masks_by_time(clip, settings.masks_late)
    notes = [*clip.notes, *(part.paired for part in (clip.masks, clip.depth) if part is not None and part.paired)]
    frames = without(chosen_frames(settings.frames, clip), settings.drop, clip)
    frames = with_partner(clip, frames, settings.right_late, "a right picture", notes)
    frames = with_partner(clip, frames, settings.masks_late, "a mask", notes)
    chosen = thinned(clip, frames, settings.rate, notes)
    chosen, poses = _poses_and_masks(clip, chosen, settings.gaps, notes)
    refuse_no_lengths(clip, chosen)
    if not chosen:
        raise InputError(f"{clip.where}: no frame is left")
    notes += leftover_notes(Path(out))
    before = replaced_file(out) if replace else None
    with new_folder(Path(out), FILE_NAME if replace else "", WRITTEN) as folder:
        found = _write_frames(clip, folder, chosen, poses, settings, notes, on_frame)
        write_sequence_file(found, folder)
        notes += _checked_depth(folder, found) + _checked_poses(folder, found) + lost_notes(before, found)
    return found, notes


def _checked_depth(folder: Path, found: SequenceFile) -> list[str]:
    """Notes on depth that the stereo pairs contradict."""
    return [] if found.depth is None else notes_of(depth_pair_findings(describe_prepared(folder)))


def _checked_poses(folder: Path, found: SequenceFile) -> list[str]:
    """Notes on poses that the pictures contradict. Raises InputError where another reading of them is right."""
    if found.poses is None or found.depth is None or found.frames < 2:
        return []
    clip = describe_prepared(folder)
    return notes_of(agreement_findings(agreement_of(clip, clip.cameras(range(clip.count))), "poses"))


def _poses_and_masks(
    clip: Clip, chosen: list[int], gaps: str, notes: list[str]
) -> tuple[list[int], list[CameraPose] | None]:
    """The frames to write and their poses. Gaps are refused, dropped or filled, and noted."""
    lacking: dict[str, list[int]] = {}
    if clip.poses is not None:
        lacking["pose"] = [i for i in chosen if clip.poses[i] is None]
    if clip.masks is not None:
        lacking["mask"] = [i for i in chosen if clip.masks(i) is None]
    for what, frames in lacking.items():
        if not frames:
            continue
        named = f"{len(frames)} of {len(chosen)} frames have no {what}: {shortened([str(i) for i in frames])}"
        if len(frames) == len(chosen):
            raise InputError(f"{clip.where}: {named}; use --frames some of which have one")
        if gaps == "refuse":
            paired = (
                f" ({clip.masks.paired})" if what == "mask" and clip.masks is not None and clip.masks.paired else ""
            )
            raise InputError(f"{clip.where}: {named}{paired}; use --gaps drop (without these) or --gaps fill")
        filling = "poses are interpolated" if what == "pose" else "the mask of the nearest frame is used"
        notes.append(f"{named}; {'left out' if gaps == 'drop' else filling}")
    if gaps != "refuse" and not any(lacking.values()):
        notes.append(f"no frame lacks a mask or a pose: --gaps {gaps} changes nothing")
    if gaps == "drop":
        without = set().union(*lacking.values())
        chosen = [i for i in chosen if i not in without]
    if clip.poses is None:
        return chosen, None
    every = filled(clip.poses, clip.times) if lacking["pose"] and gaps == "fill" else clip.poses
    return chosen, [pose for pose in (every[i] for i in chosen) if pose is not None]


def _write_frames(
    clip: Clip,
    folder: Path,
    chosen: list[int],
    poses: list[CameraPose] | None,
    settings: PrepareSettings,
    notes: list[str],
    on_frame: OnFrame,
) -> SequenceFile:
    straight: Straightener | None = None
    depth_scale, saturated = 0.0, 0
    without_depth: list[int] = []
    facts: list[FrameFacts] = []
    seen = WrittenFrames(len(chosen))
    (folder / IMAGES).mkdir()
    for k, (i, pair) in enumerate(zip(chosen, clip.pictures(chosen))):
        if straight is None:
            height, width = pair.left.shape[:2]
            straight = straightener(clip, width, height, settings.scale)
            notes += [*straight.notes, *_without_partner(clip, pair)]
            notes += _unchanged(settings.scale, width, height, straight)
        new = _checked(clip, i, pair, straight)
        facts.append(frame_facts(clip.names[i], new.left))
        _write_pictures(folder, k, new, settings.pictures)
        tissue = None if clip.masks is None else straight.mask(_mask_or_nearest(clip, i, chosen))
        if tissue is not None:
            write_mask(folder, k, tissue)
        depth = _depth(clip, i, straight, poses[k] if poses else None, settings.points, pair.left.shape[:2])
        if depth is not None and depth.any():
            depth_scale = depth_scale or step_of_depth(float(np.percentile(depth[depth > 0], LARGEST)))
            saturated += write_levels(_depth_file(folder, k), depth, depth_scale)
        elif clip.depth is not None or (clip.points is not None and settings.points != "none"):
            without_depth.append(i)
            _write_no_depth(folder, k, straight.intrinsics)
        seen.add(new, tissue, depth)
        on_frame(k + 1, len(chosen))
    assert straight is not None
    notes += notes_of(_findings(clip, straight, facts))
    notes += seen.notes(clip, settings.border)
    if without_depth:
        notes.append(f"frames without any depth: {shortened([str(i) for i in without_depth])}")
    if saturated:
        notes.append(f"{saturated} pixels are clipped at {65535 * depth_scale:g}, {FAR_BEYOND}")
    masks = mask_entry(clip, folder, len(chosen), seen, settings.border, notes)
    turned = [straight.pose(pose) for pose in poses] if poses else None
    return _file_of(clip, straight, turned, chosen, masks, depth_scale, settings, notes)


def _findings(clip: Clip, straight: Straightener, facts: list[FrameFacts]) -> list[Finding]:
    """What is noticeable about the pictures and the camera."""
    where = str(clip.where)
    found = frame_findings(facts, where)
    found += intrinsics_findings(straight.intrinsics, where, clip.crop)
    return found + baseline_findings(straight.baseline, clip.arbitrary, where)


def _without_partner(clip: Clip, pair: PicturePair) -> list[str]:
    """A note on the calibration of a pair beside pictures of one view."""
    if clip.calibration is None or pair.right is not None:
        return []
    return [
        "the calibration is that of a pair, and the pictures are read as its left view: if each of them has both views,"
        " --stereo side_by_side or --stereo stacked divides it; --right FILE adds the video of the right view"
    ]


def _unchanged(scale: float, width: int, height: int, straight: Straightener) -> list[str]:
    """A note on a scale that rounds to the size of the pictures."""
    if scale == 1 or (straight.intrinsics.width, straight.intrinsics.height) != (width, height):
        return []
    return [f"--scale {scale:g} changes nothing: pictures of {width}x{height} pixels keep their size"]


def _checked(clip: Clip, i: int, pair: PicturePair, straight: Straightener) -> PicturePair:
    """The pictures in the new camera. Raises InputError for a frame with another size than the first."""
    size = pair.left.shape[:2]
    expected = straight.left.x.shape if straight.left else None
    source = clip.calibration.left if clip.calibration else clip.intrinsics
    expected = expected or (source and (source.height, source.width))
    if expected and size != tuple(expected):
        raise InputError(
            f"{clip.where}: frame {clip.names[i]}: {size[1]}x{size[0]} pixels, others {expected[1]}x{expected[0]}"
        )
    if pair.right is not None and pair.right.shape != pair.left.shape:
        raise InputError(f"{clip.where}: frame {clip.names[i]}: left and right differ in size")
    return straight.pictures(pair)


def _mask_or_nearest(clip: Clip, i: int, chosen: list[int]) -> NDArray[np.bool_]:
    """The mask of a frame, or of the nearest frame with a mask."""
    assert clip.masks is not None
    for other in sorted(chosen, key=lambda k: (abs(k - i), k)):
        found = clip.masks(other)
        if found is not None:
            return found
    raise InputError(f"{clip.where}: no frame has a mask")


def _depth(
    clip: Clip, i: int, straight: Straightener, pose: CameraPose | None, points: str, size: tuple[int, ...]
) -> NDArray[np.float32] | None:
    if clip.depth is not None:
        found = clip.depth(i)
        if found is not None and found.shape != size:
            raise InputError(
                f"{clip.where}: frame {clip.names[i]}: depth of {found.shape[1]}x{found.shape[0]} pixels, the"
                f" picture has {size[1]}x{size[0]}; use one size (`endotsr depth --given` takes proportional ones)"
            )
        return None if found is None else straight.depth(found)
    if clip.points is None or pose is None or points == "none":
        return None
    return depth_from_points(clip.points(i), straight.pose(pose), straight.intrinsics, points)


def _write_pictures(folder: Path, k: int, pair: PicturePair, ending: str) -> None:
    for name, picture in ((IMAGES, pair.left), (RIGHT, pair.right)):
        if picture is not None:
            (folder / name).mkdir(exist_ok=True)
            path = folder / name / f"{k:06d}.{ending}"
            write_png(path, picture) if ending == "png" else write_jpeg(path, picture)


def _write_no_depth(folder: Path, k: int, size: Intrinsics) -> None:
    write_levels(_depth_file(folder, k), np.zeros((size.height, size.width), np.float32), 1.0)


def _depth_file(folder: Path, k: int) -> Path:
    (folder / DEPTH).mkdir(exist_ok=True)
    return folder / DEPTH / f"{k:06d}.png"


def _file_of(
    clip: Clip,
    straight: Straightener,
    poses: list[CameraPose] | None,
    chosen: list[int],
    masks: MaskEntry | None,
    depth_scale: float,
    settings: PrepareSettings,
    notes: list[str],
) -> SequenceFile:
    unit = ARBITRARY if clip.arbitrary else "mm"
    if (clip.depth or clip.points) and not depth_scale:
        notes.append("no frame has depth: none is written")
    method = clip.depth.method if clip.depth else f"points, {settings.points}"
    clipped = list(CLIPPED) if clip.depth and (straight.resized or clip.depth.clipped) else []
    assumed = clip.depth.assumed if clip.depth else ""
    entry = DepthEntry(unit=unit, scale=depth_scale or 1.0, clipped=clipped, method=method, assumed=assumed)
    times, rate = written_times(clip, chosen, settings.rate, notes)
    return SequenceFile(
        format=FORMAT,
        frames=len(chosen),
        camera=camera_entry(straight.intrinsics, straight.baseline, clip.crop),
        source=f"{clip.where.absolute().name} ({clip.layout})",
        unit=unit,
        frame_rate=rate,
        times=times,
        source_names=_source_names(clip, chosen),
        masks=masks,
        depth=entry if depth_scale else None,
        poses=_pose_entry(clip, chosen, poses) if poses else None,
    )


def _pose_entry(clip: Clip, chosen: list[int], poses: list[CameraPose]) -> PoseEntry:
    """The section of the poses, with their origin in a source that states it."""
    known = clip.poses or []
    between = [k for k, i in enumerate(chosen) if known[i] is None or i in clip.interpolated]
    return PoseEntry(origin=clip.pose_origin, interpolated=between, matrices=[pose_row(pose) for pose in poses])


def _source_names(clip: Clip, chosen: list[int]) -> list[str] | None:
    """The names of the frames in the recording; None if they are those of the written files, or not unique."""
    names = [(clip.source_names or clip.names)[i] for i in chosen]
    if len(set(names)) < len(names):  # pictures in folders of their own
        return None
    return None if names == [f"{k:06d}" for k in range(len(chosen))] else names


def camera_entry(intrinsics: Intrinsics, baseline: float | None, crop: Crop | None = None) -> CameraEntry:
    """The section [camera] of intrinsics without distortion."""
    window = [round(float(value), 6) for value in crop or ()]
    fx, fy, cx, cy = (float(value) for value in (intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy))
    return CameraEntry(
        width=intrinsics.width, height=intrinsics.height, fx=fx, fy=fy, cx=cx, cy=cy, baseline=float(baseline or 0.0),
        crop=window[:4], crop_of=window[4:],
    )  # fmt: skip


def pose_row(pose: CameraPose) -> list[float]:
    """The twelve numbers of a pose in [poses] matrices."""
    return [float(value) for value in np.column_stack([pose.rotation, pose.translation]).ravel()]
