"""Dense flows between the neighbouring frames of a clip, kept in a cache between commands.

The masks of a clip are drawn in rounds, which carry them along the same flows. Flows are stored in steps of 1/32 px, to
which OpenCV 4 rounds the positions of a warp, and take half the space of float32. In: pictures in time order. Out:
`ClipFlows`. The cache is a folder of the user's cache directory; `endotsr --cache` shows and removes it. The flows of a
missing or damaged file are computed; a failure to write one is no error.
"""

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.flow import dense_flow
from endotsr.clips.opencv.library import cv2_library
from endotsr.clips.sequences.clip import Picture
from endotsr.clips.sequences.clip_pictures import all_decoded, fingerprint
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.files import in_threads
from endotsr.untrusted.writing import replace_file

STEPS = 32  # per px
FARTHEST = np.iinfo(np.int16).max  # steps; 1023 px
MOST_BYTES = 1_000_000_000  # of the folder; longer clips are not kept


class StoredFlows(Sequence[FloatArray]):
    """Flows as integers (n, 2, H, W) in steps of 1/32 px; an item is one flow (2, H, W) in px, float32."""

    def __init__(self, levels: NDArray[np.int16]) -> None:
        self.levels = levels

    def __len__(self) -> int:
        return len(self.levels)

    def __getitem__(self, i):
        if isinstance(i, slice):
            return StoredFlows(self.levels[i])
        return self.levels[i].astype(np.float32) * np.float32(1 / STEPS)


class ClipFlows(NamedTuple):
    """Dense flows between neighbouring frames, (2, H, W) px each."""

    forward: Sequence[FloatArray]  # frame i -> frame i + 1
    backward: Sequence[FloatArray]  # frame i + 1 -> frame i


def flow_folder() -> Path:
    """The folder of the kept flows."""
    from platformdirs import user_cache_dir

    return Path(user_cache_dir("endotsr")) / "flows"


def motion_of(pictures: Sequence[Picture]) -> ClipFlows:
    """The flows of a clip, pictures (H, W, 3) uint8 in time order, from the cache if they are there."""
    if len(pictures) < 2:
        return ClipFlows([], [])
    file = flow_folder() / f"{fingerprint(pictures, f'{cv2_library().__version__} {STEPS}')}.npy"
    levels = _kept(file, (2, len(pictures) - 1, 2, *pictures[0].shape[:2]))
    if levels is None:
        levels = _computed(pictures)
        _keep(file, levels)
    return ClipFlows(StoredFlows(levels[0]), StoredFlows(levels[1]))


def _computed(pictures: Sequence[Picture]) -> NDArray[np.int16]:
    """The flows (2, n - 1, 2, H, W) in steps, forward first."""
    planes = [np.ascontiguousarray(picture.transpose(2, 0, 1)) for picture in all_decoded(pictures)]
    levels = np.empty((2, len(planes) - 1, 2, *planes[0].shape[1:]), np.int16)

    def between(i: int) -> None:
        for way, flow in enumerate((dense_flow(planes[i], planes[i + 1]), dense_flow(planes[i + 1], planes[i]))):
            levels[way, i] = np.clip(np.rint(flow * np.float32(STEPS)), -FARTHEST, FARTHEST)

    in_threads(between, len(planes) - 1)
    return levels


def _kept(file: Path, shape: tuple[int, ...]) -> NDArray[np.int16] | None:
    """The array of a file, mapped; None if the file is not what `_keep` writes."""
    try:
        levels = np.load(file, mmap_mode="r", allow_pickle=False)
        file.touch()  # the files that were not used for the longest time are removed first
    except (OSError, ValueError, EOFError):
        return None
    return levels if levels.shape == shape and levels.dtype == np.int16 else None


def _keep(file: Path, levels: NDArray[np.int16]) -> None:
    """Write the array, after removing older ones until there is room."""
    if levels.nbytes > MOST_BYTES:
        return
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        others = sorted(file.parent.glob("*.npy"), key=lambda other: other.stat().st_mtime)
        total = levels.nbytes + sum(other.stat().st_size for other in others)
        for other in others:
            if total > MOST_BYTES:
                total -= other.stat().st_size
                other.unlink()
        replace_file(file, lambda temporary: np.save(temporary, levels))
