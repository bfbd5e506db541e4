"""`endotsr masks`: proposed masks of a clip, recorded in a sequence or written to a separate folder.

In: a clip. Out: mask pictures (white = excluded), an overlay for inspection, and a mark of the proposal: `proposed
= true` in `sequence.toml`, or the file `proposal.json` next to the masks.
"""

import json
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.flow.clip_flows import motion_of
from endotsr.clips.formats.files import shortened, visible_files
from endotsr.clips.masks.carry_masks import LEAST_GAIN, carry_masks
from endotsr.clips.masks.drawing import DrawnClip, drawing_of
from endotsr.clips.masks.drawn_masks import FORMAT, DrawnFile, DrawnKey, KeyMasks, key_masks, read_drawn
from endotsr.clips.masks.key_checks import polarity_warnings, refuse_no_tissue
from endotsr.clips.masks.mask_shapes import shapes_of
from endotsr.clips.masks.propose_masks import Proposal, overlay, propose_masks
from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.clip import Clip, Picture
from endotsr.clips.sequences.clip_pictures import left_pictures
from endotsr.clips.sequences.folder_reader import of_size
from endotsr.clips.sequences.layouts.common import describe_prepared
from endotsr.clips.sequences.masks import mask_levels, threshold_masks
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence_file import FILE_NAME, MASKS, MaskEntry, read_sequence_file, sequence_text
from endotsr.clips.sequences.sources import PROPOSAL
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray
from endotsr.untrusted.files import in_threads
from endotsr.untrusted.names import counted
from endotsr.untrusted.writing import new_folder, replace_text, replacing_folder

OVERLAY = "proposed_masks.png"
MOST_WITHOUT = 0.5  # of the frames; a proposal that leaves more frames without tissue is wrong
OTHER_COLOUR, DRAWN_COLOUR, NEVER_COLOUR = (0, 255, 0), (0, 110, 255), (255, 150, 0)  # of the overlay
SHOWN, ACROSS, SHOWN_WIDTH = 12, 4, 320  # pictures of the overlay, per row, and their largest width


def _proposed(clip: Clip) -> Proposal:
    """The proposal for a clip. Raises InputError if it leaves most frames without tissue."""
    proposal = propose_masks(pair.left for pair in clip.pictures(list(range(clip.count))))
    empty = without_tissue(clip, proposal)
    if len(empty) > MOST_WITHOUT * clip.count:
        raise InputError(
            f"{clip.where}: the proposed masks leave hardly any tissue in {len(empty)} of {clip.count}"
            f" frames: {shortened(empty)}; use masks of another program (prepare --masks)"
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


Propose = Callable[[Clip], Proposal]


def from_keys(source: Path, margin: int, said: list[str]) -> Propose:
    """Masks carried from those of a few key frames.

    source   the file of the drawing page, or a folder with one picture per key frame with the name of the frame, white
             = instrument
    margin   px by which the masks grow, see `carry_masks`
    said     receives a line for frames that are not trusted, and one for the frame to draw next

    The function raises InputError for a folder without keys, a name that is no frame, a picture that is no mask, a
    file that `read_drawn` refuses, and masks that leave hardly any tissue.
    """

    def propose(clip: Clip) -> Proposal:
        pictures = left_pictures(clip)
        found = read_keys(source, clip, pictures[0])
        carried = carry_masks(motion_of(pictures), found.keys, margin)
        if carried.distrusted:
            named = shortened([clip.names[i] for i in carried.distrusted])
            said.append(f"not trusted, look at these frames or draw one of them: {named}")
        if carried.next_key is not None:
            named, gain = clip.names[carried.next_key], f"{carried.gain:.3f}"
            said.append(f"the mask that would help most: {named} (expected gain of the mean agreement at most {gain})")
        else:
            said.append(f"no further key is expected to raise the mean agreement by {LEAST_GAIN}")
        said.extend(polarity_warnings(found.keys, pictures))
        frames = counted(len(found.keys), "key frame")
        never = found.never
        excluded = carried.excluded if never is None else [plane | never for plane in carried.excluded]
        refuse_no_tissue(excluded, clip.names, source, margin)
        never_said = "" if never is None else f"; {never.mean():.1%} of the picture is never tissue"
        said_of = f"carried from {frames}, margin {margin} px{never_said}"
        return Proposal(excluded, said_of, kind="carried", drawn=tuple(sorted(found.keys)), never=never)

    return propose


def read_keys(source: Path, clip: Clip, picture: Picture) -> KeyMasks:
    """Masks of key frames from a file of the drawing page or from a folder. Raises: see `from_keys`."""
    height, width = picture.shape[:2]
    if source.is_dir():
        return KeyMasks(_folder_keys(source, clip, width, height))
    return key_masks(read_drawn(source, clip, width, height))


def _folder_keys(folder: Path, clip: Clip, width: int, height: int) -> dict[int, BoolArray]:
    """Frame -> mask (H, W), True = instrument, of the pictures of a folder, which have the size of the clip's."""
    files = [file for file in visible_files(folder) if file.suffix.lower() == ".png"]
    if not files:
        raise InputError(f"{folder}: no PNG masks of key frames; name each as its frame, such as {clip.names[0]}.png")
    place = {name: i for i, name in enumerate(clip.names)}
    for file in files:
        if file.stem not in place:
            raise InputError(f"{file}: is not the name of a frame; use names such as {clip.names[0]}.png")
    said = "the pictures of the clip have"
    pictures = [of_size(read_png(file), file, (width, height), said) for file in files]
    planes = [picture if picture.ndim == 2 else picture.max(axis=2) for picture in pictures]
    levels = mask_levels(planes, [str(file) for file in files])
    return {place[f.stem]: threshold_masks([p], [str(f)], [], levels=levels)[0] for f, p in zip(files, planes)}


def drawing_for(clip: Clip, keys: Path | None, wanted: int) -> DrawnClip:
    """The content of the drawing page.

    keys     the file of an earlier page, or a folder of masks, which become polygons; None: a first page, with drafts
             by colour
    wanted   number of frames of a first page

    Raises:  InputError as `from_keys` and `drawing_of`.
    """
    pictures = left_pictures(clip)
    if keys is None:
        return drawing_of(clip, pictures, wanted, propose_masks(pictures))
    height, width = pictures[0].shape[:2]
    if keys.is_dir():
        found = [
            DrawnKey(frame=i, name=clip.names[i], shapes=shapes_of(mask, "drawn"))
            for i, mask in sorted(_folder_keys(keys, clip, width, height).items())
        ]
        drawn = DrawnFile(format=FORMAT, frames=clip.count, width=width, height=height, keys=found)
    else:
        drawn = read_drawn(keys, clip, width, height)
    return drawing_of(clip, pictures, wanted, None, drawn)


def enter_masks(folder: Path, replace: bool = False, propose: Propose | None = None) -> Proposal:
    """Propose masks for a folder in the common format and record them. Without a proposal the folder is unchanged.

    A mask that is equal in all frames, such as a field of view, is united with the proposal, unless `replace`.

    replace   whether existing masks may be replaced
    propose   where the masks come from; None = by colour and motion

    Raises:  InputError, leaving the folder unchanged, unless the overlay alone cannot be written.
    """
    clip = describe_prepared(folder)
    static = None if replace else _static_mask(clip)
    if (clip.masks or (folder / MASKS).exists()) and not replace and static is None:
        raise InputError(f"{folder}: has masks already; use --replace, or --out FOLDER")
    proposal = (propose or _proposed)(clip)
    if proposal.found and static is not None:
        united = [plane | static for plane in proposal.excluded]
        proposal = proposal._replace(excluded=united, reason=f"{proposal.reason}; united with the mask of all frames")
    if not proposal.found:
        return proposal
    entry = MaskEntry(proposed=True, origin=origin_of(proposal, static))

    def record() -> None:
        found = msgspec.structs.replace(read_sequence_file(folder), masks=entry)
        replace_text(folder / FILE_NAME, sequence_text(found))

    with replacing_folder(folder / MASKS, then=record) as place:
        _write_masks(place, clip.names, proposal)
    write_png(folder / OVERLAY, overlays(clip, proposal))
    return proposal


def write_proposal(clip: Clip, out: Path, propose: Propose | None = None, replace: bool = False) -> Proposal:
    """Write masks, overlay and mark into the new folder `out`. Without a proposal nothing is written.

    propose   where the masks come from; None = by colour and motion
    replace   whether `out` may be the folder of an earlier proposal, which the new one replaces

    Raises:  InputError, leaving nothing behind.
    """
    proposal = (propose or _proposed)(clip)
    if not proposal.found:
        return proposal
    with new_folder(out, PROPOSAL if replace else "", (MASKS, OVERLAY)) as place:
        (place / MASKS).mkdir()
        _write_masks(place / MASKS, clip.names, proposal)
        write_png(place / OVERLAY, overlays(clip, proposal))
        about = {"source": clip.where.absolute().name, "proposed": True, "excluded_value": "white"}
        about |= {"found": proposal.reason, "origin": origin_of(proposal)}
        (place / PROPOSAL).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8", newline="\n")
    return proposal


def _write_masks(folder: Path, names: list[str], proposal: Proposal) -> None:
    def write(i: int) -> None:
        write_png(folder / f"{names[i]}.png", np.where(proposal.excluded[i], 255, 0).astype(np.uint8))

    in_threads(write, len(proposal.excluded))


def origin_of(proposal: Proposal, given: BoolArray | None = None) -> str:
    """Where the excluded pixels come from, in words, with their fractions of all pixels.

    given   (H, W) pixels that the clip excluded before

    A pixel with several origins counts for the first one: given, never tissue, then drawn, carried or proposed.
    """
    fractions, covered = {}, np.zeros(proposal.excluded[0].shape, bool)
    for name, plane in (("given", given), ("never tissue", proposal.never)):
        if plane is not None:
            fractions[name] = float((plane & ~covered).mean())
            covered = covered | plane
    for i, plane in enumerate(proposal.excluded):
        name = f"drawn on {counted(len(proposal.drawn), 'frame')}" if i in proposal.drawn else proposal.kind
        fractions[name] = fractions.get(name, 0.0) + float((plane & ~covered).mean()) / len(proposal.excluded)
    return ", ".join(f"{name} {fraction:.1%}" for name, fraction in fractions.items())


def overlays(clip: Clip, proposal: Proposal) -> Picture:
    """Up to twelve frames of the clip in rows, (H, W, 3) uint8, with excluded pixels in colour.

    Blue: drawn by a person; green: carried or proposed; orange: never tissue.
    """
    chosen = even_frames(clip.count, SHOWN)
    shown = []
    for i, pair in zip(chosen, clip.pictures(chosen)):
        never, drawn = proposal.never, i in proposal.drawn
        own = proposal.excluded[i] if never is None else proposal.excluded[i] & ~never
        picture = overlay(pair.left, own, DRAWN_COLOUR if drawn else OTHER_COLOUR)
        picture = picture if never is None else overlay(picture, never, NEVER_COLOUR)
        factor = min(1.0, SHOWN_WIDTH / picture.shape[1])
        shown.append(area_resize(picture, round(picture.shape[1] * factor), round(picture.shape[0] * factor)))
    height, width = shown[0].shape[:2]
    shown = [picture for picture in shown if picture.shape == (height, width, 3)]
    rows = -(-len(shown) // ACROSS)
    shown += [np.zeros((height, width, 3), np.uint8)] * (rows * ACROSS - len(shown))
    return np.concatenate([np.concatenate(shown[k * ACROSS : (k + 1) * ACROSS], axis=1) for k in range(rows)])
