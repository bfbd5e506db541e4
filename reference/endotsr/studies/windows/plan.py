"""Window plan: stretches between faults and cuts, each divided into overlapping windows.

In: the surveyed frames, the requested length, and the split. Out: windows, and the left-out frames with reasons.

A stretch is divided into m windows. Frame i has the window density d_i = max(1 / (MOST_WINDOW - o), motion_i / PATH),
where o is the overlap, or 1 / (n - o) for a given length of n frames. A window then spans at most about `MOST_WINDOW`
frames, and its motion adds up to about `PATH` of the picture's width. m is the sum of the densities rounded up. Window
k begins where the running sum of the densities reaches k / m of the total, so windows are shorter where the tissue
moves more.

Windows begin at multiples of the split's period, counted from the start of the stretch. A frame in two windows is
therefore held out in both (ruling in the specification).
"""

from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np

from endotsr.clips.sequences.splits import LEAST_BLOCK_PERIOD, split_frames
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.studies.windows.record import LeftOut, Window
from endotsr.studies.windows.survey import SurveyedFrame

LEAST_WINDOW = 16  # frames
MOST_WINDOW = 96  # frames: maximum window length when the length follows from the motion
PATH = 0.1  # summed median flow per window, fraction of the picture's width; EndoNeRF pulling: 0.09 in 63 frames
LEAST_TISSUE = 0.01  # a frame with a smaller tissue fraction counts as empty
EMPTY_RUN = 8  # runs of at least this many empty frames are left out


class Wanted(NamedTuple):
    """The user's options."""

    frames: int | None = None  # window length; None = from the motion
    overlap: int = 8  # minimum number of frames shared by neighbours
    chain: int = 1  # length of a chain; every window but its first starts warm


class Stretch(NamedTuple):
    """Consecutive frames without a fault or cut."""

    first: int
    end: int
    begins: str  # why it begins there, as text


def check_wanted(wanted: Wanted, split: SequenceConfig) -> None:
    """Raises InputError for an invalid length, overlap or chain, and for the split `end`."""
    least = wanted.overlap + _least_stride(wanted, split_period(split))
    if wanted.chain < 1:
        raise InputError(f"train: --chain {wanted.chain} is not allowed; use an integer >= 1")
    if wanted.overlap < 2:
        raise InputError(f"train: --overlap {wanted.overlap} is not allowed; use an integer >= 2")
    if wanted.frames is not None and wanted.frames < least:
        raise InputError(
            f"train: --windows {wanted.frames} is not allowed; use auto, or at least {least} frames with an"
            f" overlap of {wanted.overlap} (no frame may be in three windows)"
        )


def _least_stride(wanted: Wanted, period: int) -> int:
    """Minimum frames between the starts of two windows: a window overlaps only its neighbours, and not entirely."""
    return max(LEAST_WINDOW, wanted.overlap + period)


def split_period(split: SequenceConfig) -> int:
    """Period of the split, frames. Raises InputError for the split `end`, which has none."""
    if split.split == "end":
        raise InputError("train: --windows with the split end: every window would hold out its end; use others")
    periods = {"every_eighth": 8, "every_second": 2, "blocks": max(LEAST_BLOCK_PERIOD, 2 * split.block_length)}
    return periods[split.split]


def planned_windows(
    frames: list[SurveyedFrame], wanted: Wanted, split: SequenceConfig
) -> tuple[list[Window], list[LeftOut]]:
    """Windows and left-out frames, both ascending; no window if no stretch is usable.

    Edges:  reasons to leave frames out: a fault, at least eight successive frames without tissue, a stretch with too
            few frames for the split.
    """
    check_wanted(wanted, split)
    stretches, left_out = stretches_of(frames)
    windows: list[Window] = []
    for stretch in stretches:
        if reason := _too_short(stretch, split):
            left_out.append(LeftOut(first=stretch.first, end=stretch.end, reason=reason))
            continue
        windows += _windows_of(stretch, frames, wanted, split, len(windows))
    return windows, sorted(left_out, key=lambda gap: gap.first)


def stretches_of(frames: list[SurveyedFrame]) -> tuple[list[Stretch], list[LeftOut]]:
    """Stretches between faults, cuts and runs of empty frames, and the frames left out."""
    reasons = _reasons(frames)
    stretches, left_out, begins = [], [], "the recording begins"
    bounds = [0, *(i for i in range(1, len(frames)) if frames[i].cut or reasons[i] != reasons[i - 1]), len(frames)]
    for first, end in pairwise(bounds):
        if reasons[first]:
            left_out.append(LeftOut(first=first, end=end, reason=reasons[first]))
            begins = f"after frame {end - 1}, which is left out"
            continue
        stretches.append(Stretch(first, end, f"cut: {frames[first].cut}" if frames[first].cut else begins))
    return stretches, left_out


def _reasons(frames: list[SurveyedFrame]) -> list[str]:
    """Why each frame is left out; "" if it is used."""
    reasons = [frame.fault for frame in frames]
    empty = [not frame.fault and frame.tissue < LEAST_TISSUE for frame in frames]
    for without_tissue, places in groupby(range(len(frames)), empty.__getitem__):
        run = list(places)
        if without_tissue and len(run) >= EMPTY_RUN:
            reasons[run[0] : run[-1] + 1] = [f"tissue on less than {LEAST_TISSUE:.0%} of the pixels"] * len(run)
    return reasons


def _too_short(stretch: Stretch, split: SequenceConfig) -> str:
    """Why a stretch is too short for a window, as text; "" if it is not."""
    count = stretch.end - stretch.first
    if count < LEAST_WINDOW:
        return f"{count} frames between cuts or faults; a window has at least {LEAST_WINDOW}"
    try:
        split_frames(count, split.split, split.block_length)
    except InputError as error:
        return str(error)
    return ""


def _windows_of(
    stretch: Stretch, frames: list[SurveyedFrame], wanted: Wanted, split: SequenceConfig, named: int
) -> list[Window]:
    """The windows of a stretch; `named` is the number of windows before it."""
    period = split_period(split)
    length, least = stretch.end - stretch.first, _least_stride(wanted, period)
    sums = np.concatenate([[0.0], np.cumsum(_densities(stretch, frames, wanted))])
    count = max(1, int(np.ceil(sums[-1] - 1e-9)))
    starts = [0]
    for begin in np.searchsorted(sums, sums[-1] * np.arange(1, count) / count) // period * period:
        last = Stretch(stretch.first + int(begin), stretch.end, "")  # the window, if no other begins after it
        if starts[-1] + least <= begin <= length - wanted.overlap - LEAST_WINDOW // 2 and not _too_short(last, split):
            starts.append(int(begin))
    ends = [*(start + wanted.overlap for start in starts[1:]), length]
    return [
        Window(
            name=f"{named + k:03d}",
            first=stretch.first + start,
            end=stretch.first + end,
            start="warm" if k % wanted.chain else "cold",
            begins=f"shares {ends[k - 1] - start} frames" if k and ends[k - 1] > start else "" if k else stretch.begins,
        )
        for k, (start, end) in enumerate(zip(starts, ends))
    ]


def _densities(stretch: Stretch, frames: list[SurveyedFrame], wanted: Wanted) -> list[float]:
    """Windows per frame, for all frames of a stretch but the last `overlap` ones; at least one frame."""
    count = stretch.end - stretch.first - wanted.overlap
    if wanted.frames is not None:
        return [1.0 / (wanted.frames - wanted.overlap)] * max(count, 1)
    return [max(1.0 / (MOST_WINDOW - wanted.overlap), frame.motion / PATH) for frame in
            frames[stretch.first : stretch.first + max(count, 1)]]  # fmt: skip
