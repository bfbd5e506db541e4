"""From mask files to tissue masks: which values are white, which polarity holds, and whether that can be true.

Polarity is stated in the configuration and never guessed, but a wrong statement is recognised. Evidence, measured on a
public sequence (63 frames, 34 % of the pixels without depth):

| masks folder | share without depth: tissue / excluded | redness R - B: tissue / excluded |
|---|---|---|
| `masks`, right polarity | 0.000 / 1.000 | 69 / 4 |
| `gt_masks`, right polarity | 0.093 / 1.000 | 66 / -3 |

With the wrong polarity each pair is swapped, while the tissue share (0.34 and 0.27) would still look plausible.
Instruments and borders are where stereo depth is missing, so depth decides when enough of it is missing; else the
colour does.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError

LEAST_TISSUE_SHARE = 0.05
MOST_SOFT_SHARE = 0.05  # of a frame: more pixels between black and white are no mask
LEAST_MISSING_SHARE = 0.01  # of all pixels: with less missing depth, depth says nothing about polarity
MISSING_MARGIN = 0.25  # measured differences are 0.9 and more
REDNESS_MARGIN = 20.0  # grey levels; measured differences are 65 and more


def threshold_masks(raw: list[NDArray], names: list[str], notes: list[str]) -> NDArray[np.bool_]:
    """White pixels of mask pictures.

    raw      n pictures (H, W) of integers; {0, 1} when no value of any picture exceeds 1, else {0, 255} (or {0, 65535})
    returns  (n, H, W) bool, True = white: at least half of full white

    In-between values are counted in `notes`. Raises InputError naming a picture with more than 5 % of them.
    """
    largest = max(int(picture.max()) for picture in raw)
    white = 1 if largest <= 1 else 255 if largest <= 255 else 65535
    soft_total = 0
    result = np.empty((len(raw), *raw[0].shape), bool)
    for i, picture in enumerate(raw):
        np.greater_equal(picture, (white + 1) // 2, out=result[i])
        soft = picture.size - np.count_nonzero(picture == 0) - np.count_nonzero(picture == white)
        soft_total += soft
        if soft > MOST_SOFT_SHARE * picture.size:
            raise InputError(
                f"{names[i]}: {soft / picture.size:.1%} of the pixels are neither 0 nor {white}: this is not a mask"
                " (another kind of picture in the mask folder, or masks written with different scales?)"
            )
    if soft_total:
        notes.append(
            f"{soft_total} mask pixels lie between 0 and {white}; values from {(white + 1) // 2} count as white"
        )
    return result


def check_tissue_share(masks: NDArray[np.bool_], where: str, excluded_value: str, allow: bool) -> float:
    """The tissue share of all frames, refused below 5 % and at exactly 100 % unless `allow`.

    Raises:  InputError naming the folder, the share, the likely cause and the setting that overrides.
    """
    share = float(masks.mean())
    if allow or LEAST_TISSUE_SHARE <= share < 1.0:
        return share
    cause = (
        f"the masks may have the other polarity (excluded_value is {excluded_value!r})"
        if share < LEAST_TISSUE_SHARE
        else f"the masks exclude nothing: they may be empty or hold no {excluded_value} pixel"
    )
    raise InputError(
        f"{where}: {share:.1%} of the pixels count as tissue; {cause}; set allow_mask_share if this is right"
    )


def check_polarity(
    masks: NDArray[np.bool_],
    depth: NDArray[np.floating],
    images: NDArray[np.uint8],
    where: str,
    excluded_value: str,
    allow: bool,
) -> str:
    """Refuse a polarity that the pictures contradict; otherwise a sentence on what supports it.

    masks    (n, H, W) True = tissue, as understood so far
    depth    (n, H, W) 0 = missing
    images   (n, 3, H, W) display RGB

    Wrong if (a) at least 1 % of all pixels lack depth and the share lacking it is larger by 0.25 on "tissue" than on
    excluded pixels; or (b) depth is no evidence (that difference lies within +-0.25) and excluded pixels are redder,
    in mean R - B, than "tissue" by 20 grey levels.
    """
    if masks.all() or not masks.any():
        return "polarity not checked: all pixels are on one side of the mask"
    missing = depth == 0
    on_tissue, on_excluded = float(missing[masks].mean()), float(missing[~masks].mean())
    other = "black" if excluded_value == "white" else "white"
    advice = f"the masks seem to have the other polarity: set excluded_value = {other!r} (or allow_mask_share to go on)"
    if missing.mean() >= LEAST_MISSING_SHARE and abs(on_tissue - on_excluded) > MISSING_MARGIN:
        found = f"depth is missing on {on_tissue:.1%} of the tissue and {on_excluded:.1%} of the excluded pixels"
        if on_tissue > on_excluded and not allow:
            raise InputError(f"{where}: with {excluded_value} = excluded, {found}; {advice}")
        return found
    tissue_redness, excluded_redness = _redness(images, masks)
    found = f"mean red minus blue is {tissue_redness:.0f} on tissue and {excluded_redness:.0f} on excluded pixels"
    if excluded_redness - tissue_redness > REDNESS_MARGIN and not allow:
        raise InputError(f"{where}: with {excluded_value} = excluded, {found}; {advice}")
    return found


def _redness(images: NDArray[np.uint8], masks: NDArray[np.bool_]) -> tuple[float, float]:
    """Mean of R - B over tissue and over excluded pixels, on every fourth row and column, grey levels."""
    sparse, mask = images[:, :, ::4, ::4].astype(np.int32), masks[:, ::4, ::4]
    redness = sparse[:, 0] - sparse[:, 2]
    if mask.all() or not mask.any():
        return 0.0, 0.0
    return float(redness[mask].mean()), float(redness[~mask].mean())
