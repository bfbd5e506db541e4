"""Proposed instrument masks without a network: grey metal on red tissue, and motion relative to the tissue.

Tissue is red, orange or mauve, and metal is grey. With the redness of a pixel,

    s = (R - min(G, (G + B) / 2)) / (R + G + B + FLOOR),

and the usual redness m of the clip, pixels with s < SEED m are seeds, and connected pixels with s < GROW m join them.
Gaps and holes are filled, and a margin is added: with a mask that is too small, metal is trained as tissue. Such a
region is an instrument if it has an edge, and enters from the border of the picture, moves relative to the surrounding
tissue, or overlaps an instrument of the previous or next frame. It has an edge if the redness rises there by EDGE m or
more within some pixels: pale and overexposed tissue fades instead. A region without an edge counts where it covers most
of the instrument of the previous or next frame, as smoke does. Other regions, such as highlights, remain tissue.
Tissue-coloured and blood-covered instruments are not found.

The dark border outside the field of view (`field_of_view`) is found first, from all frames together. It is excluded in
every frame and from the search.

In: the pictures of a clip. Out: a `Proposal`, or the reason why there is none. A person has to inspect it.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.flow import dense_flow
from endotsr.clips.sequences.clip import Picture
from endotsr.clips.sequences.field_of_view import DARK, outside_of_view, reduced
from endotsr.clips.sequences.smaller import resized_nearest
from endotsr.method.kernels.arrays import BoolArray, FloatArray

FLOOR = 12.0  # grey levels: the redness of a black pixel is noise
SEED, GROW = 0.12, 0.4  # of the usual redness
LEAST_REDNESS = 0.05  # usual redness of a clip; below it, metal is not distinguishable
LEAST_AREA = 0.003  # of the picture
ENTERING_AREA = 0.008  # of the picture, for a region accepted only because it touches the border
CLOSING, MARGIN = 0.012, 0.02  # of the longer side: closed gaps, and margin added to a region
RING = 0.05  # of the longer side: ring around a region whose motion counts as tissue motion
EDGE = 0.5  # of the usual redness, its least rise from the inside of a region to the outside
EDGE_FROM, EDGE_TO = 2, 5  # px at the working size: the two bands along the edge whose redness is compared
UNLIKE = 1.5  # px at the working size: motion relative to the tissue
OVERLAP = 0.5  # fraction of a region that overlaps the instruments of a neighbouring frame
LITTLE_TISSUE = 0.05  # of the field of view; a frame with less has almost no tissue


class Proposal(NamedTuple):
    """Proposed masks."""

    excluded: list[BoolArray]  # (H, W) per frame, True = instrument; empty if nothing was found
    reason: str  # number of frames with an instrument, or why there is no proposal
    outside: float = 0.0  # fraction of the picture outside the field of view, excluded in every frame
    without_tissue: tuple[int, ...] = ()  # frames with almost no remaining tissue
    kind: str = "proposed"  # or `carried`: how the frames that no person drew got their masks
    drawn: tuple[int, ...] = ()  # frames that a person drew
    never: BoolArray | None = None  # (H, W) True where no frame shows tissue, as drawn by a person
    border: BoolArray | None = None  # (H, W) True outside the field of view; part of the excluded pixels

    @property
    def found(self) -> bool:
        """Whether there are proposed masks."""
        return bool(self.excluded)


class _Region(NamedTuple):
    """A connected grey region of one frame."""

    pixels: BoolArray  # (h, w)
    enters: bool  # large, and touches the border of the picture
    edge: bool  # whether the redness rises at its edge


def propose_masks(pictures: Iterable[Picture]) -> Proposal:
    """Instrument masks for the pictures (H, W, 3) of a clip, in time order.

    Edges:  a single picture: motion is not used. A clip without colour: the dark border alone, or without one no
            proposal.
    """
    small, sizes = [], []
    for picture in pictures:
        sizes.append(picture.shape[:2])
        small.append(reduced(picture))
    if not small:
        return Proposal([], "there are no pictures")
    outside = outside_of_view(small)
    chosen, reason = _instruments(small, outside)
    if not outside.any():
        excluded = [_enlarged(_widened(plane), size) for plane, size in zip(chosen, sizes)]
        return Proposal(excluded, reason, 0.0, frames_without_tissue(excluded, 1.0))
    border = _enlarged(outside, sizes[0])
    widened = [_widened(plane) for plane in chosen] or [np.zeros_like(outside)] * len(sizes)
    excluded = [_enlarged(plane | outside, size) for plane, size in zip(widened, sizes)]
    fraction = float(border.mean())
    said = f"field of view: {1 - fraction:.1%} of the picture, the dark border of all frames is excluded; {reason}"
    return Proposal(excluded, said, fraction, frames_without_tissue(excluded, 1 - fraction), border=border)


def frames_without_tissue(excluded: Sequence[BoolArray], view: float = 1.0) -> tuple[int, ...]:
    """Frames with less than `LITTLE_TISSUE` of the field of view left; `view` is its fraction of the picture."""
    return tuple(i for i, plane in enumerate(excluded) if 1 - plane.mean() < LITTLE_TISSUE * view)


def _instruments(small: list[Picture], outside: BoolArray) -> tuple[list[BoolArray], str]:
    """The instruments of every picture, empty if there are none, and the reason. Only the field of view is searched."""
    redness = [_redness(picture) for picture in small]
    bounded = bool(outside.any())
    inside = [plane[~outside][::16] if bounded else plane[::4, ::4].ravel() for plane in redness]
    usual = float(np.median(np.concatenate(inside)))
    if usual < LEAST_REDNESS:
        return [], f"the usual redness is {usual:.3f}: grey metal is not distinguishable in such pictures"
    if bounded:  # near the edge of the view, pixels are too dark for a colour
        redness = [np.where(outside | (p.max(axis=2) < DARK), usual, r) for r, p in zip(redness, small)]
    regions = [_regions(plane, usual, outside) for plane in redness]
    chosen = _chosen(small, regions)
    frames = sum(plane.any() for plane in chosen)
    if not frames:
        return [], "no grey region with an edge enters from the border or moves relative to the tissue"
    return chosen, f"instruments in {frames} of {len(chosen)} frames, usual redness {usual:.3f}"


def _redness(picture: Picture) -> FloatArray:
    """(h, w) in [-0.5, 1], smoothed with a standard deviation of 1 px."""
    from scipy.ndimage import gaussian_filter

    red, green, blue = (gaussian_filter(picture[..., k].astype(np.float32), 1.0) for k in range(3))
    return (red - np.minimum(green, (green + blue) / 2)) / (red + green + blue + FLOOR)


def _regions(redness: FloatArray, usual: float, outside: BoolArray) -> list[_Region]:
    """Connected grey regions above the least area. They enter at the border of the picture or of the field of view."""
    from scipy import ndimage

    reach = max(1, round(CLOSING * max(redness.shape)))
    grown = ndimage.binary_propagation(redness < SEED * usual, mask=redness < GROW * usual)
    padded = np.pad(ndimage.binary_opening(grown), reach, "edge")  # closing must not erode at the border
    closed = ndimage.binary_closing(padded, iterations=reach)[reach:-reach, reach:-reach]
    labels: Any
    labels, count = ndimage.label(ndimage.binary_fill_holes(closed))  # pyright: ignore[reportGeneralTypeIssues]
    border = outside if outside.shape == redness.shape else np.zeros(redness.shape, bool)
    near_border = np.asarray(ndimage.binary_dilation(border, iterations=2), bool)
    found = []
    for label in range(1, count + 1):
        pixels = labels == label
        if pixels.mean() >= LEAST_AREA:
            touches = pixels[[0, -1]].any() or pixels[:, [0, -1]].any() or (pixels & near_border).any()
            enters, rise = bool(touches) and pixels.mean() >= ENTERING_AREA, _rise(pixels, redness, border)
            found.append(_Region(pixels, enters, rise >= EDGE * usual))
    return found


def _rise(pixels: BoolArray, redness: FloatArray, border: BoolArray) -> float:
    """The median redness just outside of a region minus that just inside; 0 without pixels outside.

    A region that is too thin for the inner band counts whole.
    """
    from scipy.ndimage import binary_dilation, binary_erosion

    near, far = (np.asarray(binary_dilation(pixels, iterations=width), bool) for width in (EDGE_FROM, EDGE_TO))
    thick, core = (np.asarray(binary_erosion(pixels, iterations=w, border_value=1), bool) for w in (EDGE_FROM, EDGE_TO))
    inside, outside = thick & ~core, far & ~near & ~border
    if not outside.any():
        return 0.0
    return float(np.median(redness[outside]) - np.median(redness[inside if inside.any() else pixels]))


def _chosen(pictures: list[Picture], regions: list[list[_Region]]) -> list[BoolArray]:
    """The union of the instruments, per frame."""
    chosen, left = [], []
    for i, found in enumerate(regions):
        flow = _flow(pictures, i) if any(region.edge and not region.enters for region in found) else None
        plane, rest = np.zeros(pictures[i].shape[:2], bool), []
        for region in (region for region in found if region.edge):
            if region.enters or (flow is not None and _moves_alone(region.pixels, flow)):
                plane |= region.pixels
            else:
                rest.append(region.pixels)
        chosen.append(plane)
        left.append(rest)
    sure = list(chosen)
    for i, rest in enumerate(left):
        beside = [sure[k] for k in (i - 1, i + 1) if 0 <= k < len(sure) and sure[k].shape == chosen[i].shape]
        for pixels in rest:
            if any((pixels & other).sum() >= OVERLAP * pixels.sum() for other in beside):
                chosen[i] = chosen[i] | pixels
    _continue(chosen, [[region.pixels for region in found if not region.edge] for found in regions])
    return chosen


def _continue(chosen: list[BoolArray], faded: list[list[BoolArray]]) -> None:
    """Add the regions without an edge that cover most of the instrument of a neighbour, from frame to frame."""
    n = len(chosen)
    for i, k in [(i, i - 1) for i in range(1, n)] + [(i, i + 1) for i in range(n - 2, -1, -1)]:
        beside = chosen[k]
        if beside.any() and beside.shape == chosen[i].shape:
            for pixels in faded[i]:
                if (pixels & beside).sum() >= OVERLAP * beside.sum():
                    chosen[i] = chosen[i] | pixels


def _flow(pictures: list[Picture], i: int) -> NDArray[np.float32] | None:
    """(2, h, w) px to the next picture, for the last one to the previous; None without a neighbour of equal size."""
    other = i + 1 if i + 1 < len(pictures) else i - 1
    if other < 0 or pictures[other].shape != pictures[i].shape:
        return None
    here, there = (np.ascontiguousarray(pictures[k].transpose(2, 0, 1)) for k in (i, other))
    return dense_flow(here, there)


def _moves_alone(pixels: BoolArray, flow: NDArray[np.float32]) -> bool:
    """Whether the median motion of a region differs from the surrounding tissue."""
    from scipy.ndimage import binary_dilation

    reach = max(2, round(RING * max(pixels.shape)))
    near, far = (np.asarray(binary_dilation(pixels, iterations=width), bool) for width in (2, reach))
    ring = far & ~near
    if not ring.any():
        return False
    inside, around = (np.median(flow[:, part], axis=1) for part in (pixels, ring))
    return float(np.hypot(*(inside - around))) > UNLIKE


def _widened(plane: BoolArray) -> BoolArray:
    from scipy.ndimage import binary_dilation

    if not plane.any():
        return plane
    return np.asarray(binary_dilation(plane, iterations=max(1, round(MARGIN * max(plane.shape)))), bool)


def _enlarged(plane: BoolArray, size: tuple[int, ...]) -> BoolArray:
    """The mask at picture size."""
    return resized_nearest(plane, size[1], size[0], "mask")


def overlay(picture: Picture, excluded: BoolArray, colour: tuple[int, int, int] = (0, 255, 0)) -> Picture:
    """The picture with the excluded pixels in a colour, half transparent, (H, W, 3) uint8."""
    shown = picture.copy()
    shown[excluded] = (0.5 * picture[excluded] + 0.499 * np.array(colour)).astype(np.uint8)
    return shown
