"""Masks in one file, as programs that segment videos write them: a video, or a NumPy array.

A plane of such a file has the name `FILE/000003`, so that planes are listed, paired and read like files.
"""

import os
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.depth_stacks import ENDINGS, stack_planes
from endotsr.clips.formats.mask_arrays import KINDS, array_plane, in_array
from endotsr.clips.formats.video_file import is_video, video_facts, video_pictures
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.clip import grey_plane
from endotsr.clips.sequences.mask_values import LEAST_WHITE, OBJECTS
from endotsr.errors import InputError
from endotsr.untrusted.names import counted

MOST_BYTES = 1 << 31  # of the planes of a video that are held


def mask_files(path: Path) -> list[Path] | None:
    """The names of the planes of a video or an array of masks; None for any other path. Raises InputError."""
    if path.suffix.lower() in ENDINGS:
        return stack_planes(path, KINDS)
    if (path.is_file() and path.suffix.lower() in (".png", ".webp")) or not is_video(path):
        return None
    facts = video_facts(path)
    if facts.count * facts.width * facts.height > MOST_BYTES:
        raise InputError(
            f"{path}: {counted(facts.count, 'mask')} of {facts.width}x{facts.height} pixels; use a video of at"
            f" most {MOST_BYTES} pixels, or a folder of pictures"
            f" (`ffmpeg -i {path.name} -start_number 0 masks/%06d.png`)"
        )
    return [path / f"{k:06d}" for k in range(facts.count)]


def plane_of(path: Path) -> NDArray:
    """The plane (H, W) of a mask: a picture file, or a name of `mask_files`. Raises InputError."""
    if in_array(path):
        return array_plane(path)
    file = path.parent
    if not file.is_file():
        return grey_mask(read_picture(path), path)
    status = os.stat(file)
    return _planes(file, status.st_mtime_ns, status.st_size)[int(path.name)]


def grey_mask(pixels: NDArray, path: Path) -> NDArray:
    """The channel of a mask. Raises InputError for a coloured picture, with the option that reads one."""
    try:
        return grey_plane(pixels, path)
    except InputError as error:
        raise InputError(f"{error}, {OBJECTS}") from None


def coloured_plane_of(path: Path) -> NDArray:
    """As `plane_of`, with the channels of a coloured picture. Raises InputError."""
    return plane_of(path) if in_array(path) or path.parent.is_file() else read_picture(path)


@lru_cache(maxsize=2)
def _planes(path: Path, changed: int, size: int) -> NDArray[np.uint8]:
    """The planes (n, H, W) of a video. Raises InputError for coloured pictures."""
    count = video_facts(path).count
    planes: list[NDArray[np.uint8]] = []
    for k, picture in enumerate(video_pictures(path, list(range(count)))):
        spread = picture.max(axis=2).astype(np.int16) - picture.min(axis=2)
        if spread.max() >= LEAST_WHITE:
            raise InputError(f"{path}: picture {k} is coloured; use masks in black and white")
        planes.append(np.ascontiguousarray(picture[:, :, 1]))
    return np.stack(planes)
