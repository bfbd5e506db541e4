"""Reading EndoNeRF folders.

    images/*.png     RGB, or jpg, tiff, webp, bmp     poses_bounds.npy (or pose_bounds.npy)   LLFF rows, see poses.py
    depth/*.png      z in millimetres, 0 = none; .npy and .tiff too
    masks/*.png      or gt_masks/*.png (or as above), white = excluded unless the configuration says otherwise

File names are free, in one pattern a folder; frames are ordered and paired by the number in the name. In: a folder and
the `SequenceConfig`. Out: a `Sequence` in memory, whose notes state every assumption. Input that cannot be used raises
an `InputError` of one line that names file, frame and reason. This module does not depend on models or training.
"""

from pathlib import Path
from typing import NamedTuple

from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.opencv.pictures import PICTURE_ENDINGS, read_picture
from endotsr.sequences.assemble import assemble, check_percentiles
from endotsr.sequences.depth_files import DEPTH_ENDINGS
from endotsr.sequences.files import check_pairing, hash_files, list_pictures
from endotsr.sequences.poses import cameras_from_rows, find_pose_file, read_pose_rows
from endotsr.sequences.read_frames import FrameFiles
from endotsr.sequences.sequence import Sequence
from endotsr.sequences.splits import parse_frame_range, split_frames

NEAR = 0.2  # near plane of every preset, scene units
UNIT = "mm"
NO_MASKS = "none"  # value of `sequence.masks`: none are read


class Folder(NamedTuple):
    """The files of a sequence that a configuration selects, in time order."""

    images: list[Path]
    masks: list[Path]  # empty: none are read
    depth: list[Path]
    poses: Path
    frames: range  # selected frames, as numbers within the folder
    total: int  # frames in the folder


def select_files(folder: Path, config: SequenceConfig) -> Folder:
    """List, pair and select the files to read.

    Raises:  InputError for a missing folder, a file without its partner, a bad frame range or an impossible split.
    """
    folder = Path(folder)
    if folder.is_file():
        raise InputError(f"{folder}: is a file; allowed: a folder with images/, depth/, {config.masks}/ and poses")
    if not folder.is_dir():
        raise InputError(f"{folder}: sequence folder not found")
    images = list_pictures(folder / "images", PICTURE_ENDINGS)
    masks = _list_masks(folder, config)
    depth = list_pictures(folder / "depth", DEPTH_ENDINGS)
    if masks:
        check_pairing(images, masks)
    check_pairing(images, depth)
    try:
        total = len(images)
        frames = parse_frame_range(config.frames, total)
        split_frames(len(frames), config.split, config.block_length)  # an impossible split is refused before reading
    except InputError as error:
        raise InputError(f"{folder}: {error}") from None
    images, masks, depth = ([files[i] for i in frames if files] for files in (images, masks, depth))
    return Folder(images, masks, depth, find_pose_file(folder), frames, total)


def _list_masks(folder: Path, config: SequenceConfig) -> list[Path]:
    """The mask files; none if the configuration asks for none."""
    if config.masks == NO_MASKS:
        return []
    if not (folder / config.masks).is_dir():
        raise InputError(
            f"{folder / config.masks}: folder not found; a clip without masks is read with --sequence.masks none"
        )
    return list_pictures(folder / config.masks, PICTURE_ENDINGS)


def read_endonerf(folder: Path, config: SequenceConfig, near: float = NEAR) -> Sequence:
    """Read the frames that `config` selects.

    near     near plane, scene units: depth that lies wholly in front of it is refused

    Order of the steps: frame range, split and t = i / n over the selected frames; masks thresholded and turned to
    True = tissue; depth clipped per frame to percentiles of its non-zero values (0 stays 0); then everything is
    scaled by `config.scale`: images by area, a pixel is tissue only if all pixels it covers are, depth is the mean
    of the non-zero values it covers, the camera follows.

    Raises:  InputError (see the module docstring).
    """
    check_percentiles(config)
    files = select_files(folder, config)
    rows = read_pose_rows(files.poses, files.total)
    height, width = read_picture(files.images[0]).shape[:2]
    cameras = cameras_from_rows(rows, width, height, files.poses, files.frames)

    found = FrameFiles(
        files.images,
        files.masks,
        files.depth,
        size=(width, height),
        size_said="the first image has",
        excluded_value=config.excluded_value,
        unit=UNIT,
        depth_unit=UNIT,
    )
    return assemble(found, cameras, config, near, Path(folder), [])


def input_hashes(folder: Path, config: SequenceConfig) -> dict[str, str]:
    """SHA-256 (hex) of every file that `read_endonerf` reads with this configuration, by path inside the folder."""
    files = select_files(folder, config)
    return hash_files(Path(folder), [*files.images, *files.masks, *files.depth, files.poses])
