"""The common format, written by `endotsr prepare`: `sequence.toml` with `images/`, `masks/`, `depth/`, `images_right/`.

`sequence_file` describes the fields of `sequence.toml`. The file states the units and the polarity of the masks; the
setting `sequence.excluded_value = "black"` overrides the polarity.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from endotsr.clips.sequences.checks.kinds import finding
from endotsr.clips.sequences.clip import Clip, Depth, Masks
from endotsr.clips.sequences.crop import stated_crop
from endotsr.clips.sequences.folder_reader import FolderReader
from endotsr.clips.sequences.layouts import Layout, without_faults
from endotsr.clips.sequences.sequence_file import (
    DEPTH,
    FILE_NAME,
    IMAGES,
    MASKS,
    RIGHT,
    WRITTEN,
    SequenceFile,
    read_poses,
    read_sequence_file,
)
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import with_stated
from endotsr.errors import InputError
from endotsr.untrusted.names import counted

STATES = f"{FILE_NAME} states"


def recognises(path: Path) -> bool:
    """Whether a path is a folder in the common format."""
    return (path / FILE_NAME).is_file()


def describe_common(path: Path, options: SourceOptions) -> Clip:
    """The folder as a clip. An invalid part is among its faults; an invalid pose is a gap."""
    folder, where = FolderReader(path), path / FILE_NAME
    found = folder.tried(lambda: read_sequence_file(path), "sequence-file", where)
    if found is None:
        return Clip("common", path, [], folder.pictures, stated_in=where, faults=folder.faults)
    _list_pictures(folder, found, where)
    intrinsics = found.camera.intrinsics(where)
    folder.size, folder.size_said = (intrinsics.width, intrinsics.height), STATES
    masks, notes = _masks(folder, found, options)
    poses, pose_faults = folder.tried(lambda: read_poses(found, where), "cameras", where) or (None, {})
    clip = Clip(
        layout="common",
        where=path,
        names=[file.stem for file in folder.images],
        source_names=found.source_names,
        pictures=folder.pictures,
        images=folder.images,
        right=folder.right,
        masks=masks,
        depth=_depth(folder, found),
        unit="arbitrary" if found.arbitrary else "mm",
        intrinsics=intrinsics,
        crop=stated_crop(found.camera.crop, found.camera.crop_of, where),
        baseline=found.baseline or None,
        poses=poses,
        pose_origin=found.poses.origin if found.poses else "given",
        interpolated=tuple(found.poses.interpolated) if found.poses else (),
        rate=found.frame_rate or None,
        times=None if found.times is None else np.array(found.times, np.float64),
        notes=[*([f"source: {found.source}"] if found.source else []), *notes],
        stated_in=where,
        size_said=STATES,
        faults=folder.faults,
        pose_faults=pose_faults,
        inside=folder.inside,
        read_here=tuple(entry.folder.lower() for entry in (found.masks, found.depth) if entry is not None),
    )
    return with_stated(clip, options)


def _list_pictures(folder: FolderReader, found: SequenceFile, where: Path) -> None:
    """List the pictures; another number of them than the stated one is a fault."""
    folder.list_pictures(IMAGES, RIGHT)
    if folder.images and len(folder.images) != found.frames:
        what = f"{where}: frames = {found.frames}, but images/ holds {counted(len(folder.images), 'picture')}"
        folder.faults.append(finding("sequence-file", where, what))


def describe_prepared(path: Path) -> Clip:
    """The clip of a folder in the common format. Raises InputError."""
    return without_faults(describe_common(path, SourceOptions()))


def _masks(folder: FolderReader, found: SequenceFile, options: SourceOptions) -> tuple[Masks | None, list[str]]:
    """The masks, and a note where a setting overrides their polarity. Raises InputError for `gt_masks`."""
    settings = options.settings
    if settings is not None and settings.masks == "gt_masks":
        raise InputError(
            f"{folder.path}: sequence.masks = 'gt_masks': {FILE_NAME} names the mask folder; use masks or none"
        )
    if found.masks is None or (settings is not None and settings.masks == "none"):
        return None, []
    value, stated_in = found.masks.excluded_value, str(folder.path / FILE_NAME)
    if settings is not None and value == "white":  # the default, which a setting overrides
        value, stated_in = settings.excluded_value, ""
    masks = folder.masks(found.masks.folder, value, stated_in, found.masks.proposed)
    masks = masks and replace(masks, origin=found.masks.origin)
    if masks is None or value == found.masks.excluded_value:
        return masks, []
    return masks, [f"sequence.excluded_value = {value!r} overrides the value in {FILE_NAME}"]


def _depth(folder: FolderReader, found: SequenceFile) -> Depth | None:
    """The depth that the file describes."""
    entry = found.depth
    depth = folder.depth(entry.folder, found.depth_scale) if entry else None
    if depth is None or entry is None:
        return None
    return replace(depth, unit=entry.unit, clipped=tuple(entry.clipped), method=entry.method, assumed=entry.assumed)


LAYOUT = Layout(
    name="common",
    about="a folder with sequence.toml and images/",
    rank=0,
    recognises=recognises,
    describe=describe_common,
    direct=True,
    reads=tuple(name for name in WRITTEN if name not in (MASKS, DEPTH)),
    takes=("masks", "depth"),
)
