"""Parts shared by several layouts: picture files as frames, masks and depth, stated cameras.

In: paths and the statements of `SourceOptions`. Out: the fields of a `Clip`.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.calibrations import StatedCamera, calibrated
from endotsr.clips.formats.camera import ARBITRARY, Intrinsics, checked_intrinsics, intrinsics_of_view, scene_factor
from endotsr.clips.formats.conversions import conversion
from endotsr.clips.formats.depth_stacks import ENDINGS as ARRAY_ENDINGS
from endotsr.clips.formats.depth_stacks import stack_planes
from endotsr.clips.formats.files import list_pictures
from endotsr.clips.formats.trajectory import USUAL_UNIT, poses_of_frames, read_trajectory
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS, read_picture
from endotsr.clips.sequences.clip import Clip, Depth, Masks, PicturePair, colour_picture
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS, depth_plane, read_plane
from endotsr.clips.sequences.mask_values import levels_of_set, refuse_coded_objects, white_pixels
from endotsr.clips.sequences.mask_videos import coloured_plane_of, mask_files, plane_of
from endotsr.clips.sequences.pairing import paired
from endotsr.clips.sequences.smaller import resized_nearest
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.stored_pairs import split_pair
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.json import read_json, text
from endotsr.untrusted.names import choice

PROPOSAL, MASKS = "proposal.json", "masks"  # next to a folder of masks that a program proposed; that folder
MASK_ENDINGS = (*PICTURE_ENDINGS, *ARRAY_ENDINGS)
LARGEST_MARK = 1 << 16  # bytes of this file


def files_of(path: Path, endings: tuple[str, ...]) -> list[Path]:
    """The file itself, or the files of a folder in time order. Raises InputError."""
    if path.is_file():
        if path.suffix.lower() not in endings:
            allowed = f"use a file that ends in {choice(endings)}, or a folder of such files"
            raise InputError(f"{path}: {allowed}{conversion(path)}")
        return [path]
    return list_pictures(path, endings)


def size_of(files: list[Path]) -> tuple[int, int]:
    """Width and height of the first picture. Raises InputError."""
    height, width = colour_picture(read_picture(files[0]), files[0]).shape[:2]
    return width, height


def pictures_from_files(
    left: list[Path], right: list[Path], stereo: str = "none"
) -> Callable[[list[int]], Iterator[PicturePair]]:
    """Frames from picture files: two lists, or one list of pictures that contain both views."""

    def pictures(wanted: list[int]) -> Iterator[PicturePair]:
        for i in wanted:
            picture = colour_picture(read_picture(left[i]), left[i])
            if right:
                yield PicturePair(picture, colour_picture(read_picture(right[i]), right[i]))
            else:
                yield split_pair(picture, stereo, left[i])

    return pictures


def masks_of(files: list[Path | None], excluded_value: str, width: int, height: int, proposed: bool = False) -> Masks:
    """Masks from files, one per frame; None where a frame has none.

    A mask of another size but equal aspect ratio is resized by nearest-neighbour sampling. The meaning of the numbers
    follows from all files together, see `mask_values`. The polarity states which side is excluded.

    Raises:  InputError for another aspect ratio, or a picture that is not a mask.
    """
    given = sorted({path for path in files if path is not None})
    where = given[0].parent if len(given) > 1 else given[0] if given else ""
    levels = cache(lambda: levels_of_set(lambda k: plane_of(given[k]), given, where))
    numbered = lambda path: np.atleast_3d(coloured_plane_of(path)).max(axis=2)  # numbers or colours of objects
    checked = cache(lambda: refuse_coded_objects(lambda k: numbered(given[k]), len(given), where))

    def mask(i: int) -> NDArray[np.bool_] | None:
        path = files[i]
        if path is None:
            return None
        if excluded_value == "nonzero":
            checked()
            return resized_nearest(numbered(path) == 0, width, height, path)
        white, _ = white_pixels(plane_of(path), levels(), path)
        tissue = ~white if excluded_value == "white" else white
        return resized_nearest(tissue, width, height, path)

    return Masks(mask, excluded_value=excluded_value, proposed=proposed)


def depth_of(files: list[Path | None], scale: float) -> Depth:
    """Depth from files, one per frame, in millimetres or the arbitrary unit; None where a frame has none."""

    def depth(i: int) -> NDArray[np.float32] | None:
        path = files[i]
        return None if path is None else depth_plane(read_plane(path), scale, path)

    return Depth(depth, scale=scale)


def stated_masks(
    options: SourceOptions, frames: list[Path] | int, width: int, height: int, source_names: list[str] | None = None
) -> Masks | None:
    """The masks of `--masks`, paired with frame files or with the frame numbers of a video; None if not stated.

    source_names   as in `pairing.paired`

    Masks next to the mark of `endotsr masks` are an unchecked proposal.
    """
    if options.masks is None:
        return None
    proposed = (options.masks / PROPOSAL).is_file() and (options.masks / MASKS).is_dir()
    where = options.masks / MASKS if proposed else options.masks  # of the folder that `endotsr masks` wrote
    files = mask_files(where) or files_of(where, MASK_ENDINGS)
    mark = where.parent / PROPOSAL
    both = paired(frames, files, options.pairing, source_names)
    found = masks_of(both.files, options.excluded_value, width, height, mark.is_file())
    found = replace(found, paired=both.note)
    if not found.proposed:
        return found
    return replace(found, origin=text(read_json(mark, LARGEST_MARK).get("origin", ""), f"{mark}: origin"))


def stated_depth(
    options: SourceOptions, frames: list[Path] | int, source_names: list[str] | None = None
) -> Depth | None:
    """The depth of `--depth`, as `stated_masks`."""
    if options.depth is None:
        return None
    scale = options.depth_scale * scene_factor(options.depth_unit)
    planes = stack_planes(options.depth)
    both = paired(frames, planes or files_of(options.depth, DEPTH_ENDINGS), options.pairing, source_names)
    depth = depth_of(both.files, scale)
    return replace(depth, unit=options.depth_unit, stated=options.depth, trusted=options.trust_depth, paired=both.note)


def with_stated(clip: Clip, options: SourceOptions) -> Clip:
    """The clip with its masks and depth replaced by those of `--masks` and `--depth`, if stated, and a note on each.

    Raises:  InputError for files that do not match its frames, or if only one of depth and clip is in millimetres.
    """
    if clip.intrinsics is None or (options.masks is None and options.depth is None):
        return clip
    frames = clip.images or [clip.where / f"{name}.png" for name in clip.names]
    masks = stated_masks(options, frames, clip.intrinsics.width, clip.intrinsics.height, clip.source_names)
    depth = stated_depth(options, frames, clip.source_names)
    if depth is not None and (options.depth_unit == ARBITRARY) != clip.arbitrary:
        raise InputError(f"{clip.where}: --depth-unit {options.depth_unit} with the unit {clip.unit}")
    both = (("masks", masks, clip.masks), ("depth", depth, clip.depth))
    notes = [replaced(f"{name} of the source", name) for name, stated, own in both if stated and own]
    return replace(clip, masks=masks or clip.masks, depth=depth or clip.depth, notes=[*clip.notes, *notes])


def replaced(part: str, option: str) -> str:
    """The note on a part of a source in whose place an option states another file."""
    return f"{part}: not read, because --{option} is stated"


def stated_camera(options: SourceOptions, width: int, height: int, where: object) -> StatedCamera:
    """What `--camera`, `--field-of-view`, `--calibration` and `--baseline` state for pictures of this size.

    Raises:  InputError for a calibration of another aspect ratio; proportional sizes are scaled.
    """
    if options.calibration is not None:
        found = calibrated(options.calibration, width, height)
        return found._replace(baseline=options.baseline or found.baseline)
    notes = ()
    if options.camera is not None:
        fx, fy, cx, cy = options.camera
        stated = Intrinsics(fx, fy, cx, cy, width, height)
    elif options.field_of_view is not None:
        stated = intrinsics_of_view(options.field_of_view, width, height)
        notes = (f"{options.field_of_view:g} degrees from left to right: focal length {stated.fx:.1f} px, centred",)
    else:
        return StatedCamera(baseline=options.baseline)
    stated = checked_intrinsics(stated._replace(distortion=options.distortion), where)
    return StatedCamera(stated, baseline=options.baseline, notes=notes)


def stated_poses(
    options: SourceOptions,
    count: int,
    rate: float | None,
    times: FloatArray | None = None,
    numbers: list[int] | None = None,
    clock: FloatArray | None = None,
) -> tuple[list[CameraPose | None] | None, list[str]]:
    """The poses of `--trajectory`, and a note; (None, []) without it. See `poses_of_frames`. Raises InputError."""
    if options.trajectory is None:
        return None, []
    unit = options.trajectory_unit or USUAL_UNIT
    trajectory = read_trajectory(options.trajectory, unit, options.direction, options.axes or "opencv")
    poses, how = poses_of_frames(trajectory, count, rate, times, numbers, clock)
    return poses, ["; ".join([f"{options.trajectory.name}: {how}", f"positions in {unit}", *trajectory.notes])]


def unit_of(options: SourceOptions) -> str:
    """`mm` or `arbitrary`, by the units of trajectory (default: m) and depth. Raises InputError if they contradict."""
    stated = []
    if options.trajectory is not None:
        stated.append(options.trajectory_unit or USUAL_UNIT)
    if options.depth is not None:
        stated.append(options.depth_unit)
    if len({unit == ARBITRARY for unit in stated}) > 1:
        raise InputError("one of --trajectory-unit and --depth-unit is arbitrary: use both or neither")
    return ARBITRARY if ARBITRARY in stated else "mm"
