"""The table of README.md that compares `sharp` with interpolation.

The records are those of `full_size.record` and of `full_size.interpolation`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pages.store.commands import loaded
from pages.store.intervals import shown
from pages.store.program import RESULTS, Program
from pages.store.tables import noted

GAPS = {  # frames missing in a row: records of `sharp`, split of the interpolation
    1: ("pulling_sharp_seed?.json", "every eighth frame"),
    4: ("pulling_sharp_blocks4.json", "blocks of 4 frames"),
    8: ("pulling_sharp_blocks8.json", "blocks of 8 frames"),
    16: ("pulling_sharp_blocks16.json", "blocks of 16 frames"),
}
HEADS = ("Frames missing in a row", "Blend", "Flow", "Flow, tissue only", "`sharp`", "Seeds", "`sharp` - flow",
         "LPIPS of flow", "LPIPS of `sharp`")  # fmt: skip
FLOW, BLEND = "flow_interpolation", "two_neighbours"


def by_frame(runs: list[dict[str, Any]], of: str = "", metric: str = "psnr_tissue") -> NDArray[np.float64]:
    """A metric of every held-out frame, mean over the runs: of the model, or of a baseline."""
    rows = [(run["baselines"][of] if of else run["held_out"])["per_frame"] for run in runs]
    return np.array([[frame[metric] for frame in frames] for frames in rows]).mean(axis=0)


def row(gap: int) -> list[str]:
    """The cells of one length of the gap; the difference is paired by frame."""
    pattern, split = GAPS[gap]
    runs = [loaded(file) for file in sorted(RESULTS.glob(pattern))]
    splits = loaded(RESULTS / "interpolation.json")["clips"]["endonerf_pulling"]
    tissue = splits[split]["baselines"][f"{FLOW}_tissue"]["psnr_tissue"] if split in splits else None
    model, flow = by_frame(runs), by_frame(runs, FLOW)
    return [
        str(gap),
        f"{by_frame(runs, BLEND).mean():.2f}",
        f"{flow.mean():.2f}",
        "-" if tissue is None else f"{np.mean(tissue):.2f}",
        f"{model.mean():.2f}",
        str(len(runs)),
        shown([*(model - flow)], 2, "+"),
        f"{by_frame(runs, FLOW, 'lpips').mean():.4f}",
        f"{by_frame(runs, '', 'lpips').mean():.4f}",
    ]


def table() -> str:
    """One row for each length of the gap."""
    about = (
        "EndoNeRF pulling, 640x512, PSNR of the tissue in dB. ± is a 95 % interval over the held-out frames, as if "
        "they were independent. Flow and blend read every pixel of the neighbours, instruments included."
    )
    return noted(HEADS, [row(gap) for gap in GAPS], about)


PROGRAM = Program(__name__, "../README.md", {"table": table}, room="gaps")
