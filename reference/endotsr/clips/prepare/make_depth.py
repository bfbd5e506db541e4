"""`endotsr depth`: depth for every frame of a folder in the common format, from its stereo pairs or from files.

In: the folder. Out: `depth/`, the section [depth] of its `sequence.toml`, and the coverage of every frame. The new
`depth/` replaces an old one when it is complete.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace as replaced
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import ARBITRARY, Intrinsics
from endotsr.clips.formats.choices import Align, Pairing
from endotsr.clips.formats.depth_stacks import stack_planes
from endotsr.clips.prepare.relative_depth import MadeDepth, moves, relative_depth
from endotsr.clips.prepare.stated_depth import refuse_no_lengths_given
from endotsr.clips.prepare.stereo_depth import StereoSettings, disparity_range, stereo_depth, temporal_median
from endotsr.clips.sequences.checks.depth import LITTLE, depth_facts, mark_finding
from endotsr.clips.sequences.clip import Clip, Depth, PicturePair
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS, read_plane, step_of_depth, write_levels
from endotsr.clips.sequences.layouts.common import describe_prepared
from endotsr.clips.sequences.pairing import every_frame
from endotsr.clips.sequences.sequence_file import (
    DEPTH,
    FILE_NAME,
    DepthEntry,
    SequenceFile,
    read_sequence_file,
    sequence_text,
)
from endotsr.clips.sequences.smaller import resized_nearest
from endotsr.clips.sequences.sources import files_of
from endotsr.errors import InputError
from endotsr.untrusted.writing import replace_text, replacing_folder

FIXED_POINT = ((16, "StereoBM and StereoSGBM of OpenCV"), (256, "16-bit PNG of KITTI and others"))
NO_MATCH = (-16, 65520)  # one pixel below a smallest disparity of 0, times 16, and as an integer without a sign
# Of the width: the largest median disparity, at which the views share half of a picture; and a usual one.
WIDEST, USUAL_DISPARITY = 0.5, 0.08
EXCHANGED = 3.0  # ratio of matches that indicates exchanged left and right pictures
OnFrame = Callable[[int, int], None]
Kind = Literal["depth", "disparity"]


class DepthReport(NamedTuple):
    """What was written."""

    file: SequenceFile
    coverage: list[float]  # per frame, fraction of its pixels
    median: float  # of the frame medians
    note: str = ""  # on the files, and on depth that does not fit into them


def stereo_frames(clip: Clip, settings: StereoSettings) -> Iterator[NDArray[np.float32]]:
    """Depth of every frame from its stereo pair. Raises InputError without right pictures or baseline."""
    if clip.intrinsics is None or not clip.baseline:
        raise InputError(
            f"{clip.where}: the baseline is unknown: [camera] baseline is 0 in {FILE_NAME};"
            " use the distance between the two cameras in the unit of the file"
        )
    intrinsics, baseline = clip.intrinsics, clip.baseline
    disparity_range(settings, intrinsics, baseline)
    pairs: list[PicturePair] = []
    depths: list[NDArray[np.float32]] = []
    for i, pair in enumerate(clip.pictures(list(range(clip.count)))):
        if pair.right is None:
            raise InputError(f"{clip.where}: no right pictures (images_right/); use a stereo sequence")
        found = stereo_depth(pair.left, pair.right, intrinsics, baseline, settings)
        if i == 0 and (found > 0).mean() < LITTLE:
            exchanged = stereo_depth(pair.right, pair.left, intrinsics, baseline, settings)
            _refuse_exchanged(float((found > 0).mean()), float((exchanged > 0).mean()), clip.where)
        if not settings.temporal:
            yield found
            continue
        pairs, depths = [*pairs, pair][-3:], [*depths, found][-3:]
        if i:
            middle = len(depths) - 2
            yield _consistent(depths, pairs, middle)
    if settings.temporal:
        yield _consistent(depths[-2:], pairs[-2:], len(depths[-2:]) - 1)


def _refuse_exchanged(coverage: float, exchanged: float, where: Path) -> None:
    """Refuse exchanged left and right pictures, from the fractions of matched pixels as stored and exchanged."""
    if exchanged > max(LITTLE, EXCHANGED * coverage):
        raise InputError(
            f"{where}: {coverage:.1%} of the pixels of the first frame match the right picture, and {exchanged:.1%}"
            " with left and right exchanged; use left pictures in images/ and right ones in images_right/"
        )


def _consistent(depths: list[NDArray[np.float32]], pairs: list[PicturePair], middle: int) -> NDArray[np.float32]:
    return temporal_median(depths, [pair.left for pair in pairs], middle)


def from_pairs(folder: Path, settings: StereoSettings) -> MadeDepth:
    """Depth from the stereo pairs of a folder. Raises InputError; for a single frame, when the frame is requested."""
    smooth = " and weighted least squares" if settings.smooth else ""
    method = f"semi-global matching, left-right check{smooth}{', median along the flow' if settings.temporal else ''}"
    return MadeDepth(stereo_frames(describe_prepared(folder), settings), method, "")


def from_files(
    folder: Path, source: Path, kind: Kind, scale: float, pairing: Pairing = "auto", trusted: bool = False
) -> MadeDepth:
    """Depth from the files of another program, one per frame.

    trusted   take files of the kind `depth` as lengths even if values, light or the right view contradict it

    Raises:  InputError as `from_pairs`, and for files of the kind `depth` that most likely hold no lengths.
    """
    clip = describe_prepared(folder)
    files, note = every_frame(clip, stack_planes(source) or files_of(source, DEPTH_ENDINGS), pairing)
    intrinsics, baseline = clip.intrinsics, clip.baseline
    assert intrinsics is not None

    def depth(i: int) -> NDArray[np.float32]:
        file = files[i]
        return _without_mark(depth_of_values(read_plane(file), kind, scale, intrinsics, baseline, file), kind, file)

    if kind == "depth" and not trusted:
        refuse_no_lengths_given(replaced(clip, depth=Depth(depth, scale=scale, stated=source)))
    return MadeDepth(map(depth, range(len(files))), f"{kind} from {source.name}", "", note)


def depth_of_values(
    values: NDArray, kind: Kind, scale: float, intrinsics: Intrinsics, baseline: float | None, where: object
) -> NDArray[np.float32]:
    """Depth (H, W) in the unit of the sequence and at its size, 0 = none, from the values of another program.

    values  as stored. Disparities refer to the left picture, in pixels at the width of the file. Their sign is reversed
            if none of them is positive.
    kind    of the values
    scale   length, or pixels of disparity, per stored unit

    Raises:  InputError for another aspect ratio, for disparities without a baseline, or with a median beyond the width.
    """
    numbers = values.astype(np.float64) * scale
    numbers[~np.isfinite(numbers)] = 0.0
    if kind == "disparity":
        if not baseline:
            raise InputError(f"{where}: disparity needs the baseline: [camera] baseline is 0 in sequence.toml")
        if (numbers <= 0).all():
            numbers = -numbers
        _refuse_fixed_point(numbers, values, scale, where)
        focal = intrinsics.fx * values.shape[1] / intrinsics.width
        numbers = np.divide(focal * baseline, numbers, out=np.zeros_like(numbers), where=numbers > 0)
    depth = resized_nearest(np.maximum(numbers, 0.0), intrinsics.width, intrinsics.height, where).astype(np.float32)
    depth[~np.isfinite(depth)] = 0.0
    return depth


def _refuse_fixed_point(disparity: NDArray, stored: NDArray, scale: float, where: object) -> None:
    """Raises InputError for disparities that are stored times 16 or 256, by their size or by the mark of OpenCV."""
    found, width = disparity[disparity > 0], stored.shape[1]
    middle = float(np.median(found)) / width if found.size else 0.0
    marks = stored[np.isin(stored, NO_MATCH)] if scale == 1 and not (stored % 1).any() else stored[:0]
    if not marks.size and middle <= WIDEST:
        return
    fits = [abs(np.log(middle / times / USUAL_DISPARITY)) for times, _ in FIXED_POINT] if middle else [0.0]
    times, whose = FIXED_POINT[0 if marks.size else int(np.argmin(fits))]
    why = f"the median disparity is {middle * width:g} pixels, and the picture is {width} pixels wide"
    why = f"{marks[0]:g} marks pixels without a match" if marks.size else why
    raise InputError(f"{where}: {why}; disparities times {times} ({whose}): --unit-scale {1 / times}")


def _without_mark(depth: NDArray[np.float32], kind: Kind, file: Path) -> NDArray[np.float32]:
    """The depth. Raises InputError if one value among the lengths seems to mark missing depth."""
    if kind == "depth" and (marked := mark_finding([depth_facts(file.name, depth, depth, None)], str(file))):
        raise InputError(f"{file}: {marked[0].what}: {marked[0].why}; {marked[0].remedy}")
    return depth


def from_relative(
    folder: Path,
    source: Path,
    align: Align,
    farthest: float,
    trusted: bool,
    replace: bool,
    pairing: Pairing = "auto",
) -> MadeDepth:
    """Depth from the relative inverse depth of a network; see `relative_depth`. Raises InputError."""
    clip = describe_prepared(folder)
    if clip.depth and not replace:
        raise InputError(
            f"{folder}: has depth already; use --replace, which fits scale and shift to it and fills the holes"
        )
    files, note = every_frame(clip, stack_planes(source) or files_of(source, DEPTH_ENDINGS), pairing)
    made = relative_depth(clip, source, files, align, farthest, trusted)
    return made._replace(note=note)


def write_depth(
    folder: Path, made: MadeDepth, replace: bool = False, on_frame: OnFrame = lambda i, n: None
) -> DepthReport:
    """Write the depth of a sequence and record it in its `sequence.toml`.

    made      the depth; if any part of it is assumed, the unit of the sequence becomes arbitrary, and measured depth
              in its place gives it back millimetres, unless the poses have the assumed scale
    replace   whether existing depth may be replaced

    Raises:  InputError, leaving the folder unchanged.
    """
    clip, file = describe_prepared(folder), read_sequence_file(folder)
    names = clip.names
    if (file.depth or (folder / DEPTH).exists()) and not replace:
        raise InputError(f"{folder}: has depth already; use --replace")
    coverage, medians, step, clipped = [], [], 0.0, 0

    def record() -> None:
        nonlocal file
        file = _with_entry(folder, clip, made, step)
        replace_text(folder / FILE_NAME, sequence_text(file))

    with replacing_folder(folder / DEPTH, then=record) as place:
        for k, depth in enumerate(made.frames):
            known = depth[depth > 0]
            if known.size:
                step = step or step_of_depth(float(np.percentile(known, 99.8)))
                medians.append(float(np.median(known)))
            coverage.append(known.size / depth.size)
            clipped += write_levels(place / f"{names[k]}.png", depth, step or 1.0)
            on_frame(k + 1, len(names))
        if not medians:
            raise InputError(f"{folder}: no frame has any depth; is the baseline, the unit or the range wrong?")
    usual = "at least eight times the usual largest depth of the first frame"
    lost = f"{clipped} pixels are clipped at {65535 * step:g}, {usual}"
    notes = [made.note] * bool(made.note) + [lost] * bool(clipped)
    return DepthReport(file, coverage, float(np.median(medians)), "; ".join(notes))


def _with_entry(folder: Path, clip: Clip, made: MadeDepth, step: float) -> SequenceFile:
    """`sequence.toml` as it is now, since other commands may have changed it meanwhile, with the new depth."""
    file = read_sequence_file(folder)
    unit = ARBITRARY if made.assumed or (file.arbitrary and not _only_assumed(clip)) else "mm"
    entry = DepthEntry(folder=DEPTH, unit=unit, scale=step, method=made.method, assumed=made.assumed)
    stated = unit if (unit == ARBITRARY) != file.arbitrary else file.unit
    return msgspec.structs.replace(file, depth=entry, unit=stated)


def _only_assumed(clip: Clip) -> bool:
    """Whether the unit of a clip is arbitrary for its assumed depth alone: no poses share its scale."""
    poses = [pose for pose in clip.poses or [] if pose is not None]
    return bool(clip.depth and clip.depth.assumed) and not moves(poses)
