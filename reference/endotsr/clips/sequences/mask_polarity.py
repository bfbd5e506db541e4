"""Checks of the polarity of masks, of a clip and of single frames, against depth and colour.

The configuration states the polarity. It is never guessed, but a wrong statement is detected. Measured on a public
sequence of 63 frames, a third of whose pixels have no depth:

| masks folder | fraction without depth: tissue / excluded | redness R - B: tissue / excluded |
|---|---|---|
| `masks`, right polarity | 0.000 / 1.000 | 69 / 4 |
| `gt_masks`, right polarity | 0.093 / 1.000 | 66 / -3 |

The wrong polarity swaps each pair, while the tissue fraction (0.34 and 0.27) still looks plausible. Stereo depth is
missing on instruments and at borders. A polarity is refused if depth, where enough of it is missing, or colour
contradicts it and the other one does not support it.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import shortened
from endotsr.clips.sequences.masks import ALLOW, LEAST_TISSUE_FRACTION
from endotsr.clips.sequences.sampling import sparse_step
from endotsr.errors import InputError

LEAST_MISSING_FRACTION = 0.01  # of all pixels; less missing depth is no evidence of polarity
MISSING_MARGIN = 0.25  # measured differences are 0.9 and more
REDNESS_MARGIN = 20.0  # grey levels; measured differences are 65 and more
SINGLE_MISSING_MARGIN = 0.5  # as MISSING_MARGIN, for a single frame
OPPOSITE_FRACTION = 0.75  # of a frame; right masks differ by 0.04 from the next frame, by up to 0.36 from any other


class PolarityEvidence(NamedTuple):
    """What depth and colour say about the polarity of masks.

    Depth contradicts it if at least 1 % of all pixels lack depth and the fraction without depth is larger by 0.25 on
    "tissue" than on excluded pixels. Colour contradicts it if the mean R - B of excluded pixels exceeds that of tissue
    by 20 grey levels. Each supports it with tissue and excluded pixels exchanged.
    """

    missing_tissue: float  # fraction of the tissue without depth
    missing_excluded: float
    missing: float  # of all pixels
    red_tissue: float  # mean red minus blue, grey levels
    red_excluded: float

    @property
    def depth(self) -> int:
        """1: depth supports the polarity, -1: it contradicts it, 0: neither."""
        apart = self.missing_excluded - self.missing_tissue
        return int(np.sign(apart)) if self.missing >= LEAST_MISSING_FRACTION and abs(apart) > MISSING_MARGIN else 0

    @property
    def colour(self) -> int:
        """As `depth`, for the colour."""
        apart = self.red_tissue - self.red_excluded
        return int(np.sign(apart)) if abs(apart) > REDNESS_MARGIN else 0

    @property
    def against(self) -> bool:
        """Whether depth or colour contradicts the polarity and the other one does not support it."""
        return min(self.depth, self.colour) < 0 and max(self.depth, self.colour) <= 0

    @property
    def said(self) -> str:
        """The evidence in words."""
        colour = f"{self.red_tissue:.0f} on tissue and {self.red_excluded:.0f} on excluded pixels"
        if not self.depth:
            return f"mean red minus blue is {colour}"
        missing = f"{self.missing_tissue:.1%} of the tissue and {self.missing_excluded:.1%} of the excluded pixels"
        opposed = f", but mean red minus blue is {colour}" if self.colour == -self.depth else ""
        return f"depth is missing on {missing}{opposed}"


def check_polarity(
    masks: NDArray[np.bool_],
    depth: NDArray[np.floating],
    images: NDArray[np.uint8],
    where: str,
    excluded_value: str,
    allow: bool,
    stated_in: str = "",
) -> str:
    """Refuse a polarity that the pictures contradict. Otherwise return a sentence on the evidence.

    masks    (n, H, W) True = tissue, with the stated polarity
    depth    (n, H, W) 0 = missing
    images   (n, 3, H, W) display RGB
    stated_in   the file that states the polarity; "": the settings state it

    Raises:  InputError if the pictures contradict it, see `PolarityEvidence`, unless `allow`.
    """
    if masks.all() or not masks.any():
        return "polarity not checked: the masks exclude everything or nothing"
    evidence = PolarityEvidence(*_missing_fractions(masks, depth), *_redness(images, masks))
    if evidence.against and not allow:
        other = "black" if excluded_value == "white" else "white"
        mend = f'--sequence.excluded-value {other} (TOML: [sequence] excluded_value = "{other}")'
        mend = f'[masks] excluded_value = "{other}" in {stated_in}' if stated_in else mend
        advice = f"the masks seem to have the other polarity: set {mend}; to use these masks anyway, set {ALLOW}"
        raise InputError(f"{where}: with {excluded_value} = excluded, {evidence.said}; {advice}")
    return evidence.said


def check_single_masks(
    masks: NDArray[np.bool_],
    depth: NDArray[np.floating],
    images: NDArray[np.uint8],
    names: list[str],
    allow: bool,
) -> list[str]:
    """Refuse a single wrong mask among right ones, which statistics over all frames do not reveal.

    masks, depth, images   as for `check_polarity`
    names    n mask files
    returns  notes on frames without tissue or without excluded pixels, which are valid and rare

    Wrong if (a) a frame has some tissue, but less than 5 %, while half the frames have more; (b) the mask differs on
    more than 75 % of the pixels from both neighbouring masks with tissue; or (c) the mask resembles the opposite of
    most masks, and the pictures contradict it but not most of the others.

    Raises:  InputError naming the file, the reason and the overriding setting. With `allow` it becomes a note.
    """
    step = sparse_step(masks.shape[1])
    sparse = masks[:, ::step, ::step]
    fractions = np.count_nonzero(masks, axis=(1, 2)) / masks[0].size
    wrong = _too_little_tissue(fractions) | _against_pictures(
        sparse, depth[:, ::step, ::step], images[:, :, ::step, ::step]
    )
    wrong |= _against_neighbours(sparse, fractions)
    notes = []
    if wrong:
        first = min(wrong)
        more = f" (more masks look wrong: {len(wrong) - 1})" if len(wrong) > 1 else ""
        found = f"{names[first]}: {wrong[first]}{more}"
        if not allow:
            raise InputError(f"{found}; is this mask inverted? If it is right, set {ALLOW}")
        notes.append(found)
    for frames, what in ((fractions == 0, "no tissue, hence nothing to compare"), (fractions == 1, "nothing excluded")):
        if frames.any():
            notes.append(f"{what}: mask {shortened([Path(names[i]).name for i in np.flatnonzero(frames)])}")
    return notes


def _too_little_tissue(fractions: NDArray[np.floating]) -> dict[int, str]:
    usual = float(np.median(fractions))
    if usual < LEAST_TISSUE_FRACTION:
        return {}
    few = np.flatnonzero((fractions > 0) & (fractions < LEAST_TISSUE_FRACTION))
    return {int(i): f"{fractions[i]:.1%} of the pixels count as tissue, in the median frame {usual:.1%}" for i in few}


def _against_neighbours(masks: NDArray[np.bool_], fractions: NDArray[np.floating]) -> dict[int, str]:
    """Frames whose mask is nearly the opposite of the masks of the two nearest frames with tissue."""
    found = {}
    usable = [int(i) for i in np.flatnonzero(fractions > 0)]
    for k, i in enumerate(usable):
        start = min(
            max(k - 1, 0), max(len(usable) - 3, 0)
        )  # the first and the last frame have both neighbours on one side
        differing = [float((masks[i] != masks[j]).mean()) for j in usable[start : start + 3] if j != i]
        if fractions[i] < 1 and len(differing) == 2 and min(differing) > OPPOSITE_FRACTION:
            found[i] = (
                f"it differs from the masks of the nearest two frames on {min(differing):.1%} of the pixels or more"
            )
    return found


def _against_pictures(
    masks: NDArray[np.bool_], depth: NDArray[np.floating], images: NDArray[np.uint8]
) -> dict[int, str]:
    """Frames whose mask resembles the opposite of the usual mask and contradicts depth or colour."""
    verdicts = [_verdict(mask, frame == 0, image) for mask, frame, image in zip(masks, depth, images)]
    signs = np.array([sign for sign, _ in verdicts])
    if np.count_nonzero(signs < 0) >= np.count_nonzero(signs > 0):
        return {}  # not a fault of single frames: see `check_polarity`
    usual = masks.mean(axis=0) >= 0.5
    resembles_opposite = (masks != usual).mean(axis=(1, 2)) > 0.5
    return {int(i): verdicts[i][1] for i in np.flatnonzero((signs < 0) & resembles_opposite)}


def _verdict(mask: NDArray[np.bool_], missing: NDArray[np.bool_], image: NDArray[np.uint8]) -> tuple[int, str]:
    """Whether the picture supports a mask (1), contradicts it (-1) or neither (0), and the evidence."""
    if mask.all() or not mask.any():
        return 0, ""
    on_tissue, on_excluded = float(missing[mask].mean()), float(missing[~mask].mean())
    if missing.mean() >= LEAST_MISSING_FRACTION and abs(on_tissue - on_excluded) > SINGLE_MISSING_MARGIN:
        found = f"depth is missing on {on_tissue:.1%} of its tissue and {on_excluded:.1%} of its excluded pixels"
        return (-1 if on_tissue > on_excluded else 1), found
    redness = image[0].astype(np.int32) - image[2]
    on_tissue, on_excluded = float(redness[mask].mean()), float(redness[~mask].mean())
    if abs(on_tissue - on_excluded) <= REDNESS_MARGIN:
        return 0, ""
    found = f"mean red minus blue is {on_tissue:.0f} on its tissue and {on_excluded:.0f} on its excluded pixels"
    return (-1 if on_tissue < on_excluded else 1), found


def _missing_fractions(masks: NDArray[np.bool_], depth: NDArray[np.floating]) -> tuple[float, float, float]:
    """Fractions without depth of tissue, excluded pixels and all pixels; no group may be empty."""
    tissue = missing_tissue = missing = 0  # frame by frame, without an array over all frames
    for mask, plane in zip(masks, depth):
        without = plane == 0
        tissue += np.count_nonzero(mask)
        missing_tissue += np.count_nonzero(without & mask)
        missing += np.count_nonzero(without)
    return missing_tissue / tissue, (missing - missing_tissue) / (masks.size - tissue), missing / masks.size


def _redness(images: NDArray[np.uint8], masks: NDArray[np.bool_]) -> tuple[float, float]:
    """Mean R - B over tissue and over excluded pixels, grey levels, on every fourth row and column."""
    total, tissue_total, count, tissue = 0, 0, 0, 0
    for image, whole in zip(images, masks):
        mask = whole[::4, ::4]
        redness = image[0, ::4, ::4].astype(np.int32) - image[2, ::4, ::4]
        total, tissue_total = total + int(redness.sum()), tissue_total + int(redness[mask].sum())
        count, tissue = count + mask.size, tissue + np.count_nonzero(mask)
    if tissue in (0, count):
        return 0.0, 0.0
    return tissue_total / tissue, (total - tissue_total) / (count - tissue)
