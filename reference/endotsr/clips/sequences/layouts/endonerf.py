"""EndoNeRF folders.

    images/*.png     RGB, or jpg, tiff, webp, bmp     poses_bounds.npy (or pose_bounds.npy)   LLFF rows, see poses.py
    depth/*.png      z in millimetres, 0 = none; .npy and .tiff too
    masks/*.png      or as above, white = excluded unless the configuration says otherwise
    gt_masks/*.png   the same; read in place of masks/ only where the setting `sequence.masks` names it

File names are free, with one pattern per folder. The number in the name orders and pairs the frames.
"""

from pathlib import Path

from endotsr.clips.formats.picture_fields import picture_notes
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.folder_reader import FolderReader
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.poses import (
    POSE_FILES,
    RowConvention,
    cameras_of_rows,
    find_pose_file,
    read_pose_rows,
)
from endotsr.clips.sequences.sequence_file import DEPTH, IMAGES, MASKS, RIGHT
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import size_of, with_stated
from endotsr.config import SequenceConfig
from endotsr.errors import InputError

AXES_TAKEN = (
    "poses: axes right, up, backward, as EndoNeRF clips have them; for those of LLFF's own tool, down, right, backward:"
    " prepare --trajectory-axes llff"
)


def recognises(path: Path) -> bool:
    """Whether a path is a folder with pictures and an LLFF pose file."""
    return (path / IMAGES).is_dir() and any((path / name).is_file() for name in POSE_FILES)


def describe_endonerf(path: Path, options: SourceOptions) -> Clip:
    """The folder as a clip. An invalid part is among its faults; an invalid pose is a gap."""
    settings = options.settings or SequenceConfig(
        masks=MASKS if (path / MASKS).is_dir() else "none",
        excluded_value="black" if options.excluded_value == "black" else "white",
    )
    _refuse_other_than_folder(path, settings)
    folder = FolderReader(path)
    folder.list_pictures(IMAGES, RIGHT)
    masks = None if settings.masks == "none" else folder.masks(settings.masks, settings.excluded_value)
    depth = folder.depth(DEPTH, 1.0)
    where = next((path / name for name in POSE_FILES if (path / name).exists()), path)
    rows = folder.tried(lambda: read_pose_rows(find_pose_file(path), len(folder.images)), "cameras", where)
    size = folder.size = _size(folder) or (None if rows is None else (int(rows[0, 9]), int(rows[0, 4])))
    convention = RowConvention(options.axes or "opengl", options.direction, options.trajectory_unit or "mm")
    found = None if rows is None or size is None else cameras_of_rows(rows, *size, where, convention)
    notes = [AXES_TAKEN] if found is not None and found.poses is not None and options.axes is None else []
    if options.settings is None:
        notes += picture_notes(folder.images) + _other_poses(path, where)
    clip = Clip(
        layout="endonerf",
        where=path,
        names=[file.stem for file in folder.images],
        pictures=folder.pictures,
        images=folder.images,
        right=folder.right,
        masks=masks,
        depth=depth,
        unit="mm",
        baseline=options.baseline,
        rate=options.rate,
        notes=notes,
        stated_in=where,
        faults=folder.faults,
        inside=folder.inside,
        read_here=("masks", "gt_masks") if options.settings else (),  # a setting of training selects one or none
        **({} if found is None else found._asdict()),
    )
    return with_stated(clip, options)


def _refuse_other_than_folder(path: Path, settings: SequenceConfig) -> None:
    if path.is_file():
        raise InputError(f"{path}: is a file; use a folder with images/, depth/, {settings.masks}/ and poses")
    if not path.is_dir():
        raise InputError(f"{path}: sequence folder not found")


def _other_poses(path: Path, where: Path) -> list[str]:
    """A note on a second pose file."""
    others = [name for name in POSE_FILES if (path / name).exists() and path / name != where]
    return [f"{where.name} is read; not read: {', '.join(others)}"] if others else []


def _size(folder: FolderReader) -> tuple[int, int] | None:
    """Width and height of the first picture; None if it cannot be read, which its reader reports."""
    try:
        return size_of(folder.images[:1])
    except (InputError, IndexError):
        return None


LAYOUT = Layout(
    name="endonerf",
    about="a folder with images/, depth/, masks/ and poses_bounds.npy",
    rank=1,
    recognises=recognises,
    describe=describe_endonerf,
    direct=True,
    reads=("images", "images_right", "depth", "masks", "pose?_bounds.npy", "pose_bounds.npy", "images_*", "truth*"),
    takes=("baseline", "masks", "depth"),
)
