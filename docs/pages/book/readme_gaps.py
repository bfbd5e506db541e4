"""The tables that compare `sharp` with interpolation, by number of frames missing in a row.

The records are those of `full_size.record`, `full_size.interpolation` and `full_size.network`. A difference is paired
by frame. Where every eighth frame is missing, it has an interval over the frames. The frames of one block are too alike
for one, and blocks are few: the mean of each block is given instead.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pages.store.commands import loaded
from pages.store.intervals import blocks, paired
from pages.store.program import RESULTS, Program
from pages.store.tables import noted

Values = NDArray[np.float64]  # by held-out frame

GAPS = {  # frames missing in a row: records of `sharp`, split of the interpolation
    1: ("pulling_sharp_seed?.json", "every eighth frame"),
    4: ("pulling_sharp_blocks4_seed?.json", "blocks of 4 frames"),
    8: ("pulling_sharp_blocks8_seed?.json", "blocks of 8 frames"),
    16: ("pulling_sharp_blocks16_seed?.json", "blocks of 16 frames"),
}
FLOW, BLEND, COPY, RIFE = "flow_interpolation", "two_neighbours", "nearest_frame", "network"
TISSUE = f"{FLOW}_tissue"
NAMES = {COPY: "Copy", BLEND: "Blend", FLOW: "Flow", TISSUE: "Flow, tissue only", RIFE: "RIFE"}
MISSING = "Frames missing in a row"
LEVELS = (BLEND, FLOW, TISSUE, RIFE)  # columns of PSNR
AGAINST = (FLOW, TISSUE)  # columns of differences
CLIP = "endonerf_pulling"


def by_frame(runs: list[dict[str, Any]], of: str = "", metric: str = "psnr_tissue") -> Values:
    """A metric of every held-out frame, mean over the runs: of the model, of a baseline, or of another part by key."""
    rows = [(run["baselines"] | run)[of or "held_out"]["per_frame"] for run in runs]
    return np.array([[frame[metric] for frame in frames] for frames in rows]).mean(axis=0)


def runs_of(gap: int) -> list[dict[str, Any]]:
    """The recorded runs of `sharp` with this gap."""
    return [loaded(file) for file in sorted(RESULTS.glob(GAPS[gap][0]))]


def held_out_frames(runs: list[dict[str, Any]]) -> list[int]:
    """The held-out frames of runs with one split."""
    return [row["frame"] for row in runs[0]["held_out"]["per_frame"]]


def frames_of(gap: int) -> list[int]:
    """The held-out frames."""
    return held_out_frames(runs_of(gap))


def prediction(clip: str, split: str, name: str, metric: str, frames: list[int]) -> Values:
    """A metric of a prediction without a model of the clip, on these held-out frames."""
    part = loaded(RESULTS / ("network.json" if name == RIFE else "interpolation.json"))["clips"][clip][split]
    assert part["frames"] == frames, f"{name}, {clip}, {split}: the records hold different frames"
    return np.array(part["baselines"][name][metric])


def predicted(gap: int, name: str, metric: str = "psnr_tissue") -> Values:
    """`prediction` for a length of the gap on pulling."""
    return prediction(CLIP, GAPS[gap][1], name, metric, frames_of(gap))


def difference(gap: int, name: str, metric: str = "psnr_tissue") -> Values:
    """`sharp` minus a prediction: of every frame with a gap of 1, else of every block."""
    values = by_frame(runs_of(gap), metric=metric) - predicted(gap, name, metric)
    return np.array(blocks(values, frames_of(gap)))


def said(gap: int, name: str) -> str:
    """A difference: with an interval over single frames, or block by block."""
    return paired(by_frame(runs_of(gap)) - predicted(gap, name), frames_of(gap), 2)


def held_out(gap: int) -> str:
    """The number of frames or blocks."""
    return f"{difference(gap, FLOW).size} {'frames' if gap == 1 else 'blocks'}"


def row(gap: int) -> list[str]:
    """The PSNR of one length of the gap."""
    levels = [f"{predicted(gap, name).mean():.2f}" for name in LEVELS]
    model = f"{by_frame(runs_of(gap)).mean():.2f}"
    return [str(gap), held_out(gap), *levels, model, *(said(gap, name) for name in AGAINST)]


def row_of_lpips(gap: int) -> list[str]:
    """The LPIPS of one length of the gap."""
    without = [f"{predicted(gap, name, 'lpips').mean():.4f}" for name in NAMES]
    return [str(gap), *without, f"{by_frame(runs_of(gap), metric='lpips').mean():.4f}"]


def psnr() -> str:
    """PSNR, one row for each length of the gap."""
    heads = (MISSING, "Held out", *(NAMES[name] for name in LEVELS), "`sharp`",
             "`sharp` - flow", "`sharp` - flow, tissue only")  # fmt: skip
    seeds = ", ".join(f"{len(runs_of(gap))} with {gap}" for gap in GAPS)
    about = (
        "EndoNeRF pulling, 640x512, PSNR of the tissue in dB. A difference has a 95 % interval over the frames, or one "
        f"mean for each block. Seeds of `sharp` by frames missing: {seeds}. Flow, blend and RIFE read every pixel of "
        "the neighbours, instruments included; *tissue only* reads none that the masks exclude."
    )
    return noted(heads, [row(gap) for gap in GAPS], about)


def lpips() -> str:
    """LPIPS, one row for each length of the gap."""
    about = (
        "LPIPS with its input in [0, 1], mean over the held-out frames; clip, frames and seeds as in the table of PSNR."
    )
    return noted((f"{MISSING}, LPIPS", *NAMES.values(), "`sharp`"), [row_of_lpips(gap) for gap in GAPS], about)


PROGRAM = Program(__name__, ("../README.md", "interpolation.md"), {"psnr": psnr, "lpips": lpips}, room="gaps")
