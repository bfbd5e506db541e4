"""The masks of a prepared clip: the files, what `sequence.toml` says of them, and the border outside the field of view.

In: the masks of a clip, and the field of view that its pictures show. Out: white = excluded in `masks/`.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.choices import Border
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks.dark_border import crop_without
from endotsr.clips.sequences.checks.written import WrittenFrames
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.sequence_file import MASKS, MaskEntry
from endotsr.method.kernels.arrays import BoolArray


def write_mask(folder: Path, k: int, tissue: BoolArray) -> None:
    """Write the mask (H, W), True = tissue, of frame k."""
    (folder / MASKS).mkdir(exist_ok=True)
    write_png(folder / MASKS / f"{k:06d}.png", np.where(tissue, 0, 255).astype(np.uint8))


def mask_entry(
    clip: Clip, folder: Path, frames: int, seen: WrittenFrames, policy: Border, notes: list[str]
) -> MaskEntry | None:
    """The section of the masks, None without any. Excludes the border outside the field of view as `policy` says.

    frames   number of frames whose masks are written, if the clip has masks
    seen     what the written pictures show
    policy   auto: a clip with masks of its own keeps them as they are
    """
    entry = MaskEntry(proposed=clip.masks.proposed, origin=clip.masks.origin) if clip.masks is not None else None
    border = seen.view.outside()
    if border is None:
        if policy != "auto":
            notes.append(f"--border {policy} changes nothing: no dark border is shared by all frames")
        return entry
    what = f"{border.mean():.1%} of the picture is a dark border that all frames share"
    if policy == "keep" or (policy == "auto" and entry is not None):
        if entry is None:
            notes.append(f"{what}: it counts as tissue, by --border keep")
        return entry
    for k in range(frames):
        excluded = read_png(folder / MASKS / f"{k:06d}.png") > 0 if entry is not None else border
        write_mask(folder, k, ~(excluded | border))
    keep = f"--border keep counts it as tissue{crop_without(seen.view.dark_border())}"
    notes.append(f"{what}: it is excluded as outside of the field of view; {keep}")
    said = f"field of view {border.mean():.1%}"
    if entry is None:
        return MaskEntry(origin=said)
    return MaskEntry(proposed=entry.proposed, origin=f"{entry.origin or 'given'}, {said}")
