"""Dark borders that count as tissue: black bars of a letterbox, and the outside of a round field of view.

In: what is found of the field of view while the frames of a clip pass by. Out: a finding with the size of the border.
"""

import math

import numpy as np

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.field_of_view import WORKING, FieldOfView
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray

LEAST = 0.02  # of the pixels
SMOOTHED = 1  # px at the working size of the field of view: most that its smoothing takes from a border
SAMPLED = 24  # frames of a loaded clip


def border_findings(view: FieldOfView, where: str) -> list[Finding]:
    """A warning, if at least 2 % of the pixels are a dark border that counts as tissue in some frame."""
    border = view.dark_border()
    if border is None:
        return []
    fraction = float((border & view.tissue).mean())
    if fraction < LEAST or border.all():
        return []
    what = f"{fraction:.1%} of the pixels are dark in every frame, from the edge inwards, and count as tissue"
    return [finding("dark-border", where, what + crop_without(border))]


def loaded_border_findings(sequence: Sequence, where: str) -> list[Finding]:
    """`border_findings` of a sequence in memory, of which a sample is looked at."""
    view = FieldOfView()
    for i in even_frames(sequence.count, SAMPLED):
        view.add(sequence.picture(i), sequence.masks[i])
    return border_findings(view, where)


def crop_without(border: BoolArray | None) -> str:
    """Which crop removes the whole rows and columns of a border (H, W), as the end of a sentence; or "".

    The smoothing of `brightness` makes a border narrower, so that the crop begins a little inside.
    """
    if border is None:
        return ""
    rows, columns = (np.flatnonzero(~border.all(axis=axis)) for axis in (1, 0))
    if not rows.size or rows.size * columns.size == border.size:
        return ""
    factor = max(border.shape) / WORKING
    inset = SMOOTHED if factor <= 1 else math.ceil((SMOOTHED + 1) * factor)  # a reduced pixel may be partly dark
    (x, right), (y, bottom) = (
        (int(part[0]) and int(part[0]) + inset, int(part[-1]) + 1 - inset * (part[-1] + 1 < size))
        for part, size in ((columns, border.shape[1]), (rows, border.shape[0]))
    )
    return f"; --crop {x} {y} {right - x} {bottom - y} keeps the rest"
