"""What the drawing page shows: key frames with their shapes, drafts, and the motion between them.

In: a clip and, after the first round, the file of the page. Out: a `DrawnClip`. In the first round the frames are
evenly spaced and the drafts come from the colours. Later the frames of the file are shown with those whose mask would
help most, and their drafts are the carried masks.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from endotsr.clips.flow.clip_flows import ClipFlows, motion_of
from endotsr.clips.masks.carry_masks import LEAST_AGREEMENT, carried_once, carry_masks, overlap_of
from endotsr.clips.masks.drawn_masks import DrawnFile, DrawnKey, key_masks
from endotsr.clips.masks.mask_shapes import LARGEST, MaskShape, Origin, shapes_of
from endotsr.clips.masks.propose_masks import Proposal
from endotsr.clips.opencv.flow import sample_bilinear
from endotsr.clips.sequences.clip import Clip, Picture
from endotsr.clips.sequences.sampling import even_frames
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray

MOST_KEY_FRAMES = 60  # of a first page
PROPOSED = 3  # further frames of a later page
STEP, MOST_COLUMNS = 16, 48  # px between the nodes of the grid of motion, at least, and nodes across


class Draft(NamedTuple):
    """Shapes that a person has not accepted yet."""

    origin: Origin  # `colour` or `carried`
    shapes: list[MaskShape]


class DrawnFrame(NamedTuple):
    """A frame of the page."""

    frame: int
    name: str
    picture: Picture
    shapes: list[MaskShape]
    key: bool  # whether a person has drawn this frame, or stated that it shows no instrument
    draft: Draft | None
    ahead: FloatArray | None  # (2, m) px: displacement of the nodes to the next frame of the page
    back: FloatArray | None  # (2, m) px: displacement to the previous one


class DrawnClip(NamedTuple):
    """All of the page."""

    count: int  # frames of the clip
    width: int
    height: int
    frames: list[DrawnFrame]
    never: list[MaskShape]
    step: int  # px between the nodes; the first one is at (step / 2, step / 2)
    columns: int


def drawing_of(
    clip: Clip, pictures: Sequence[Picture], wanted: int, colour: Proposal | None, drawn: DrawnFile | None = None
) -> DrawnClip:
    """The content of the page.

    pictures   (H, W, 3) of all frames
    wanted     number of frames of a first page
    colour     masks by colour, which become drafts; the dark border of all frames is drawn as *never tissue*
    drawn      the file of an earlier page

    Raises:  InputError for a number of frames that is not allowed, and for pictures that are too large.
    """
    if not 1 <= wanted <= MOST_KEY_FRAMES:
        raise InputError(f"masks: --key-frames {wanted} is not allowed; use 1 to {MOST_KEY_FRAMES}")
    height, width = pictures[0].shape[:2]
    if max(height, width) > LARGEST:
        raise InputError(f"{clip.where}: pictures of {width}x{height}; a page shows at most {LARGEST} pixels a side")
    motion = motion_of(pictures)
    keys = {key.frame: key for key in drawn.keys} if drawn else {}
    if drawn and keys:
        shown, drafts = _next_frames(motion, key_masks(drawn).keys)
    else:
        shown = even_frames(len(pictures), wanted)
        instruments = instruments_of(colour)
        offered = plausible_drafts(motion, instruments)
        drafts = {i: Draft("colour", shapes_of(instruments[i], "colour")) for i in shown if i in offered}
    step = max(STEP, math.ceil(width / MOST_COLUMNS))
    nodes = np.stack(np.meshgrid(np.arange(step / 2, width, step), np.arange(step / 2, height, step)))
    columns, points = nodes.shape[2], nodes.reshape(2, -1)
    frames = []
    for before, i, after in zip((None, *shown), shown, (*shown[1:], None)):
        ahead, back = (None if k is None else displacement(motion, i, k, points) for k in (after, before))
        frames.append(_frame(clip, pictures, i, keys.get(i), drafts.get(i))._replace(ahead=ahead, back=back))
    border = shapes_of(colour.border, "colour") if colour and colour.border is not None else []
    return DrawnClip(len(pictures), width, height, frames, drawn.never if drawn else border, step, columns)


def instruments_of(colour: Proposal | None) -> list[BoolArray]:
    """The masks by colour (H, W) of all frames without the border of the field of view; empty without a proposal."""
    if colour is None or colour.border is None:
        return colour.excluded if colour else []
    return [plane & ~colour.border for plane in colour.excluded]


def plausible_drafts(motion: ClipFlows, colour: list[BoolArray]) -> set[int]:
    """Frames whose draft is offered: the dense flow carries it to the draft of each neighbour.

    A region that is marked in one frame and not in its neighbours is hardly an instrument.

    Edges:   frames without marked pixels, and a clip of one frame, have no draft.
    """
    pairs = [
        overlap_of(carried_once(a.astype(np.float32), flow) > 0.5, b) >= LEAST_AGREEMENT
        for a, b, flow in zip(colour, colour[1:], motion.backward)
    ]
    sides = [pairs[max(i - 1, 0) : i + 1] for i in range(len(colour))]
    return {i for i, plane in enumerate(colour) if plane.any() and sides[i] and all(sides[i])}


def _frame(clip: Clip, pictures: Sequence[Picture], i: int, key: DrawnKey | None, draft: Draft | None) -> DrawnFrame:
    shapes = key.shapes if key else []
    usable = draft if key is None and draft and draft.shapes else None
    return DrawnFrame(i, clip.names[i], pictures[i], shapes, key is not None, usable, None, None)


def _next_frames(motion: ClipFlows, keys: dict[int, BoolArray]) -> tuple[list[int], dict[int, Draft]]:
    """The key frames and up to PROPOSED further ones, in order, and the carried masks of these as drafts.

    A further frame is the next key when the carried masks of the earlier ones count as drawn.
    """
    known, drafts, gaps = dict(keys), {}, {}
    for _ in range(PROPOSED):
        carried = carry_masks(motion, known, known=gaps)
        if carried.next_key is None:
            break
        mask = carried.excluded[carried.next_key]
        known[carried.next_key] = mask
        drafts[carried.next_key] = Draft("carried", shapes_of(mask, "carried"))
    return sorted(known), drafts


def displacement(motion: ClipFlows, source: int, target: int, points: FloatArray) -> FloatArray:
    """Displacement (2, m) px of points (2, m) of one frame to another one, along the dense flows between them."""
    at, way = points.astype(np.float64), 1 if target > source else -1
    for i in range(source, target, way):
        flow = motion.forward[i] if way > 0 else motion.backward[i - 1]
        at = at + sample_bilinear(flow, at[0] - 0.5, at[1] - 0.5)
    return at - points
