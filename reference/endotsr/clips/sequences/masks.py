"""From mask files to tissue masks: thresholding, and the tissue fraction. The polarity is a setting or an option."""

from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.mask_values import MaskLevels, is_coded, levels_of, numbers_of, white_pixels
from endotsr.errors import InputError

LEAST_TISSUE_FRACTION = 0.05
ALLOW = "--sequence.allow-tissue-fraction (TOML: [sequence] allow_tissue_fraction = true)"


def threshold_masks(
    raw: list[NDArray],
    names: list[str],
    notes: list[str],
    out: NDArray[np.bool_] | None = None,
    levels: MaskLevels | None = None,
) -> NDArray[np.bool_]:
    """White pixels of the mask pictures of one set.

    raw      n pictures (H, W) of integers
    out      (n, H, W) array to fill and return; None = a new array
    levels   meaning of the numbers; None: by these pictures, as `mask_values.levels_of`
    returns  (n, H, W) bool, True = white: at least half-way from black to white

    `notes` receives the count of intermediate values. Raises InputError as `white_pixels`, for numbers of objects, or
    for a picture of another bit depth than most if white is 65535.
    """
    levels = levels or mask_levels(raw, names)
    result = np.empty((len(raw), *raw[0].shape), bool) if out is None else out
    soft = sum(white_pixels(picture, levels, names[i], result[i])[1] for i, picture in enumerate(raw))
    if soft:
        notes.append(f"{soft} mask pixels are between {levels.named}; values from {levels.least} count as white")
    return result


def mask_levels(raw: list[NDArray], names: list[str]) -> MaskLevels:
    """What the numbers in these pictures mean. Raises InputError as `levels_of`, or for mixed bit depths."""
    values: set[int] = set()
    for picture in raw:
        values |= numbers_of(picture)
    if max(values) > 255:
        _check_one_bit_depth(names, [picture.dtype for picture in raw])
    where = names[0] if len(names) == 1 else Path(names[0]).parent
    return levels_of(values, where, any(is_coded(Path(name)) for name in names))


def tissue_masks(
    raw: list[NDArray],
    names: list[str],
    excluded_value: str,
    notes: list[str] | None = None,
    out: NDArray[np.bool_] | None = None,
    levels: MaskLevels | None = None,
) -> NDArray[np.bool_]:
    """Tissue masks (n, H, W), True = tissue, from mask pictures as in `threshold_masks`.

    excluded_value   `white` or `black`: the value of excluded pixels
    """
    white = threshold_masks(raw, names, [] if notes is None else notes, out, levels)
    return np.logical_not(white, out=white) if excluded_value == "white" else white


def check_tissue_fraction(masks: NDArray[np.bool_], where: str, excluded_value: str, allow: bool) -> float:
    """The tissue fraction of all frames. Below 5 % and at exactly 100 % it is refused unless `allow`.

    Raises:  InputError naming the folder, the fraction, the likely cause and the overriding setting.
    """
    fraction = float(masks.mean())
    if allow or LEAST_TISSUE_FRACTION <= fraction < 1.0:
        return fraction
    cause = (
        f"the masks may have the other polarity (excluded_value is {excluded_value!r})"
        if fraction < LEAST_TISSUE_FRACTION
        else f"the masks exclude nothing: they may be empty or hold no {excluded_value} pixel"
    )
    raise InputError(f"{where}: {fraction:.1%} of the pixels count as tissue; {cause}; if this is right, set {ALLOW}")


def _check_one_bit_depth(names: list[str], types: list[np.dtype]) -> None:
    """Refuse mixed bit depths: white in 8 bits is almost black in 16 bits."""
    usual, frequency = Counter(types).most_common(1)[0]
    odd = next((i for i, kind in enumerate(types) if kind != usual), None)
    if odd is not None:
        raise InputError(
            f"{names[odd]}: {8 * types[odd].itemsize}-bit picture; {frequency} of the {len(types)} masks have"
            f" {8 * usual.itemsize} bits, {Path(names[types.index(usual)]).name} for one; use one bit depth"
        )
