"""`endotsr masks`: proposed masks of a clip, recorded in a sequence or written to a separate folder.

In: a clip. Out: mask pictures (white = excluded), an overlay for inspection, and a mark of the proposal: `proposed
= true` in `sequence.toml`, or the file `proposal.json` next to the masks.
"""

import json
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv import area_resize, write_png
from endotsr.clips.sequences.clip import Clip, Picture
from endotsr.clips.sequences.files import shortened
from endotsr.clips.sequences.layouts.common import describe_prepared
from endotsr.clips.sequences.propose_masks import Proposal, overlay, propose_masks
from endotsr.clips.sequences.sequence_file import FILE_NAME, MASKS, MaskEntry, read_sequence_file, sequence_text
from endotsr.clips.sequences.sources import PROPOSAL
from endotsr.errors import InputError
from endotsr.untrusted.writing import new_folder, replace_text, replacing_folder

OVERLAY = "proposed_masks.png"
MOST_WITHOUT = 0.5  # of the frames; a proposal that leaves more frames without tissue is wrong
SHOWN, ACROSS, SHOWN_WIDTH = 12, 4, 320  # pictures of the overlay, per row, and their largest width


def left_pictures(clip: Clip) -> Iterator[Picture]:
    """The left pictures of all frames, decoded one at a time."""
    return (pair.left for pair in clip.pictures(list(range(clip.count))))


def _proposed(clip: Clip) -> Proposal:
    """The proposal for a clip. Raises InputError if it leaves most frames without tissue."""
    proposal = propose_masks(left_pictures(clip))
    empty = without_tissue(clip, proposal)
    if len(empty) > MOST_WITHOUT * clip.count:
        raise InputError(
            f"{clip.where}: the proposed masks leave hardly any tissue in {len(empty)} of {clip.count}"
            f" frames: {shortened(empty)}; allowed: masks of another program (prepare --masks)"
        )
    return proposal


def _static_mask(clip: Clip) -> NDArray[np.bool_] | None:
    """The excluded pixels (H, W) if the masks are not a proposal and are equal in all frames; else None."""
    if clip.masks is None or clip.masks.proposed:
        return None
    first = clip.masks(0)
    assert first is not None
    for i in range(1, clip.count):
        if not np.array_equal(clip.masks(i), first):  # pyright: ignore[reportArgumentType]
            return None
    return ~first


def without_tissue(clip: Clip, proposal: Proposal) -> list[str]:
    """Names of the frames in which a proposal leaves almost no tissue."""
    return [clip.names[i] for i in proposal.without_tissue]


def enter_masks(folder: Path, replace: bool = False) -> Proposal:
    """Propose masks for a folder in the common format and record them. Without a proposal the folder is unchanged.

    A mask that is equal in all frames, such as a field of view, is united with the proposal.

    replace   whether existing masks may be replaced

    Raises:  InputError, leaving the folder unchanged.
    """
    clip = describe_prepared(folder)
    static = None if replace else _static_mask(clip)
    if (clip.masks or (folder / MASKS).exists()) and not replace and static is None:
        raise InputError(f"{folder}: has masks already; allowed: --replace, or --out FOLDER")
    proposal = _proposed(clip)
    if proposal.found and static is not None:
        united = [plane | static for plane in proposal.excluded]
        proposal = proposal._replace(excluded=united, reason=f"{proposal.reason}; united with the mask of all frames")
    if not proposal.found:
        return proposal
    with replacing_folder(folder / MASKS) as place:
        _write_masks(place, clip.names, proposal)
    found = msgspec.structs.replace(read_sequence_file(folder), masks=MaskEntry(proposed=True))
    replace_text(folder / FILE_NAME, sequence_text(found))
    write_png(folder / OVERLAY, overlays(clip, proposal))
    return proposal


def write_proposal(clip: Clip, out: Path) -> Proposal:
    """Write masks, overlay and mark into the new folder `out`. Without a proposal nothing is written.

    Raises:  InputError, leaving nothing behind.
    """
    proposal = _proposed(clip)
    if not proposal.found:
        return proposal
    with new_folder(out) as place:
        (place / MASKS).mkdir()
        _write_masks(place / MASKS, clip.names, proposal)
        write_png(place / OVERLAY, overlays(clip, proposal))
        about = {"source": clip.where.name, "proposed": True, "excluded_value": "white", "found": proposal.reason}
        (place / PROPOSAL).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8", newline="\n")
    return proposal


def _write_masks(folder: Path, names: list[str], proposal: Proposal) -> None:
    for name, plane in zip(names, proposal.excluded):
        write_png(folder / f"{name}.png", np.where(plane, 255, 0).astype(np.uint8))


def overlays(clip: Clip, proposal: Proposal) -> Picture:
    """Up to twelve frames of the clip in rows, with proposed pixels in green, (H, W, 3) uint8."""
    chosen = np.unique(np.linspace(0, clip.count - 1, min(SHOWN, clip.count)).astype(int)).tolist()
    shown = []
    for i, pair in zip(chosen, clip.pictures(chosen)):
        picture = overlay(pair.left, proposal.excluded[i])
        factor = min(1.0, SHOWN_WIDTH / picture.shape[1])
        shown.append(area_resize(picture, round(picture.shape[1] * factor), round(picture.shape[0] * factor)))
    height, width = shown[0].shape[:2]
    shown = [picture for picture in shown if picture.shape == (height, width, 3)]
    rows = -(-len(shown) // ACROSS)
    shown += [np.zeros((height, width, 3), np.uint8)] * (rows * ACROSS - len(shown))
    return np.concatenate([np.concatenate(shown[k * ACROSS : (k + 1) * ACROSS], axis=1) for k in range(rows)])
