"""Reading EndoNeRF folders.

    images/*.png     RGB, or jpg, tiff, webp, bmp     poses_bounds.npy (or pose_bounds.npy)   LLFF rows, see poses.py
    depth/*.png      z in millimetres, 0 = none; .npy and .tiff too
    masks/*.png      or gt_masks/*.png (or as above), white = excluded unless the configuration says otherwise

File names are free, with one pattern per folder. The number in the name orders and pairs the frames. In: a folder, and
the `SequenceConfig` or the statements of a user. Out: a `Sequence` in memory or a `Clip`; notes state every
assumption. Unusable input raises an `InputError` of one line that names file, frame and reason. This module does not
depend on models or training.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.pictures import PICTURE_ENDINGS, read_picture
from endotsr.clips.sequences.assemble import assemble, check_percentiles
from endotsr.clips.sequences.clip import CameraPose, Clip, Intrinsics, grey_plane
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS
from endotsr.clips.sequences.files import check_pairing, hash_files, list_pictures
from endotsr.clips.sequences.masks import tissue_masks
from endotsr.clips.sequences.poses import POSE_FILES, cameras_from_rows, find_pose_file, read_pose_rows
from endotsr.clips.sequences.read_frames import FrameFiles
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.sequence_file import DEPTH, IMAGES, MASKS, RIGHT
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import depth_reader, pictures_from_files, size_of, stated_depth, stated_masks
from endotsr.clips.sequences.splits import selected_frames
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera

NEAR = 0.2  # near plane of every preset, scene units
UNIT = "mm"
NO_MASKS = "none"  # value of `sequence.masks`: masks are ignored


class Folder(NamedTuple):
    """The files of a sequence that a configuration selects, in time order."""

    images: list[Path]
    masks: list[Path]  # empty: masks are ignored
    depth: list[Path]
    poses: Path
    frames: range  # selected frames, as numbers within the folder
    total: int  # frames in the folder


def recognises(path: Path) -> bool:
    """Whether a path is a folder with pictures and an LLFF pose file."""
    return (path / IMAGES).is_dir() and any((path / name).is_file() for name in POSE_FILES)


def select_files(folder: Path, config: SequenceConfig) -> Folder:
    """List, pair and select the files to read.

    Raises:  InputError for a missing folder, a file without its partner, a bad frame range or an impossible split.
    """
    folder = Path(folder)
    if folder.is_file():
        raise InputError(f"{folder}: is a file; allowed: a folder with images/, depth/, {config.masks}/ and poses")
    if not folder.is_dir():
        raise InputError(f"{folder}: sequence folder not found")
    images = list_pictures(folder / IMAGES, PICTURE_ENDINGS)
    masks = _list_masks(folder, config)
    depth = list_pictures(folder / DEPTH, DEPTH_ENDINGS)
    if masks:
        check_pairing(images, masks)
    check_pairing(images, depth)
    total = len(images)
    frames = selected_frames(config, total, folder)
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


def _read_cameras(files: Folder, width: int, height: int) -> list[Camera]:
    rows = read_pose_rows(files.poses, files.total)
    return cameras_from_rows(rows, width, height, files.poses, files.frames)


def read_endonerf(folder: Path, config: SequenceConfig, near: float = NEAR) -> Sequence:
    """Read the frames that `config` selects.

    near     near plane, scene units; a sequence whose depth is entirely in front of it is refused

    The steps, in order: frame range, split and t = i / n over the selected frames; masks thresholded and converted to
    True = tissue; depth clipped per frame to percentiles of its non-zero values (0 stays 0); everything scaled by
    `config.scale`. Images are averaged over areas. A pixel is tissue only if all pixels it covers are. Depth is the
    mean of the non-zero values it covers. The camera is scaled accordingly.

    Raises:  InputError (see the module docstring).
    """
    check_percentiles(config)
    files = select_files(folder, config)
    height, width = read_picture(files.images[0]).shape[:2]
    cameras = _read_cameras(files, width, height)
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


def open_endonerf(folder: Path, options: SourceOptions) -> Clip:
    """The folder as a clip. Raises InputError."""
    files = select_files(folder, SequenceConfig(masks=MASKS if (folder / MASKS).is_dir() else NO_MASKS))
    width, height = size_of(files.images)
    cameras = _read_cameras(files, width, height)
    right = list_pictures(folder / RIGHT, PICTURE_ENDINGS) if (folder / RIGHT).is_dir() else []
    if right:
        check_pairing(files.images, right)

    def mask(i: int) -> NDArray[np.bool_]:
        plane = grey_plane(read_picture(files.masks[i]), files.masks[i])
        return tissue_masks([plane], [str(files.masks[i])], options.excluded_value)[0]

    first, moves = cameras[0], cameras[0] is not cameras[-1]
    return Clip(
        layout="endonerf",
        where=folder,
        names=[file.stem for file in files.images],
        pictures=pictures_from_files(files.images, right),
        masks=stated_masks(options, files.images, width, height) or (mask if files.masks else None),
        depth=stated_depth(options, files.images) or depth_reader([*files.depth], 1.0),
        unit=UNIT,
        intrinsics=Intrinsics(first.fx, first.fy, first.cx, first.cy, width, height),
        baseline=options.baseline,
        poses=[CameraPose(camera.rotation, camera.translation) for camera in cameras] if moves else None,
        rate=options.rate,
    )
