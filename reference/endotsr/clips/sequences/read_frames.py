"""Reading all frames of a clip into arrays, in several threads, with the facts for the checks.

In: the files with their size and units, and the settings. Out: the arrays, in memory or in a file (see `frame_store`).
"""

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.depth import DepthFacts, depth_facts
from endotsr.clips.sequences.checks.frames import FrameFacts, frame_facts
from endotsr.clips.sequences.clip import colour_picture, grey_plane
from endotsr.clips.sequences.depth_files import check_depth_scale, clip_depth, depth_plane, read_plane
from endotsr.clips.sequences.frame_store import FrameStore
from endotsr.clips.sequences.masks import tissue_masks
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.untrusted.files import in_threads


class FrameFiles(NamedTuple):
    """The files of the selected frames, with their size, units and conventions."""

    images: list[Path]
    masks: list[Path]  # empty: every pixel is tissue
    depth: list[Path]
    size: tuple[int, int]  # width and height of every file
    size_said: str  # source of this size, for messages
    excluded_value: str  # of the masks, white or black
    unit: str  # of the sequence, in words
    depth_unit: str  # of the numbers of a depth file
    depth_scale: float = 1.0  # unit of the sequence per unit of a depth file
    stated_in: str = ""  # the file that states the excluded value; "": the settings state it
    arbitrary: bool = False  # the unit is unknown: the scale of the world is free
    seconds: NDArray[np.float64] | None = None  # (n,) of the frames, ascending; None: evenly spaced
    assumed: str = ""  # properties of the depth that are not measured
    duration: float = 0.0  # seconds from time 0 to time 1; 0 = unknown


class Frames(NamedTuple):
    """The arrays of n frames, as read."""

    images: NDArray[np.uint8]  # (n, 3, H, W)
    masks: NDArray[np.bool_]  # (n, H, W) True = tissue; everywhere without masks
    depth: NDArray[np.float32]  # (n, H, W) clipped; 0 = none
    facts: tuple[list[FrameFacts], list[DepthFacts]]  # n of each: facts on pictures and stored depth, for the checks
    store: FrameStore


def read_frames(files: FrameFiles, config: SequenceConfig, where: object, notes: list[str]) -> Frames:
    """Read all files; notes on the masks are appended.

    Raises:  InputError naming the file of the first unusable frame, or for a clip that fits neither memory nor disk.
    """
    (width, height), n = files.size, len(files.images)
    store = FrameStore(n, width, height, config.memory, where)
    images = store.array((n, 3, height, width), np.uint8)
    depth = store.array((n, height, width), np.float32)
    stored_masks = store.array((n, height, width), np.uint8) if store.in_file and files.masks else None
    masks, types = [depth] * n, [depth.dtype] * n
    facts: list[tuple[FrameFacts, DepthFacts] | None] = [None] * n
    sized = partial(of_size, size=files.size, said=files.size_said)

    def read_frame(i: int) -> None:
        image, mask, prior = files.images[i], files.masks[i] if files.masks else None, files.depth[i]
        picture = colour_picture(sized(read_picture(image), image), image)
        images[i] = picture.transpose(2, 0, 1)
        if mask:
            masks[i] = _kept(grey_plane(sized(read_picture(mask), mask), mask), stored_masks, i)
        raw = sized(read_plane(prior), prior)
        types[i] = raw.dtype
        plane = depth_plane(raw, files.depth_scale, prior)
        facts[i] = frame_facts(image.name, picture), depth_facts(prior.name, plane, raw, None)
        depth[i] = clip_depth(plane, config.depth_percentiles)

    in_threads(read_frame, n)
    check_depth_scale(depth, files.depth, types, files.depth_unit)
    tissue = store.array((n, height, width), bool)
    if files.masks:
        tissue_masks(masks, [str(file) for file in files.masks], files.excluded_value, notes, tissue)
    else:
        tissue[...] = True
    both = [fact for fact in facts if fact is not None]
    return Frames(images, tissue, depth, ([fact[0] for fact in both], [fact[1] for fact in both]), store)


def of_size(pixels: NDArray, path: Path, size: tuple[int, int], said: str) -> NDArray:
    """The pixels of a file. Raises InputError for another width and height than `size`, whose source is `said`."""
    if pixels.shape[1::-1] != size:
        raise InputError(f"{path}: {pixels.shape[1]}x{pixels.shape[0]} pixels, {said} {size[0]}x{size[1]}")
    return pixels


def _kept(plane: NDArray, stored: NDArray[np.uint8] | None, i: int) -> NDArray:
    """The mask, or its copy in the array of the store if there is one and the mask has 8 bits."""
    if stored is None or plane.dtype != np.uint8:
        return plane
    stored[i] = plane
    return stored[i]
