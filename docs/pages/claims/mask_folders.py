"""Which mask folder the published metrics use: a table of the rulings.

    python docs/make.py claims.mask_folders measure PULLING CUTTING   both EndoNeRF clips

If both images are zeroed where a mask excludes, the squared error is averaged over all pixels instead of over the
tissue. The PSNR of the whole image is then -10 log10(fraction of tissue) above that of the tissue, whatever the model.
The paper prints one of the two in each of two tables.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from pathlib import Path

import numpy as np

from endotsr.results.report.tables import markdown
from pages.store.program import CLIP, Program
from pages.store.published import MEANS_ON_TISSUE, PUBLISHED

FOLDERS, WHITE = ("masks", "gt_masks"), 128
CLIPS = ("pulling", "cutting")


def offset(folder: Path) -> float:
    """Mean over the held-out frames of PSNR of the whole image minus PSNR of the tissue, dB."""
    from PIL import Image

    files = sorted(folder.glob("*.png"))
    held_out = files[1::8]
    excluded = [np.mean(np.asarray(Image.open(file).convert("L")) >= WHITE) for file in held_out]
    return float(np.mean([-10.0 * np.log10(1.0 - fraction) for fraction in excluded]))


def table(found: dict) -> str:
    """Predicted difference of both folders, and the published one."""
    stated = np.mean(np.array([PUBLISHED[clip]["psnr_full"] for clip in CLIPS], float)) - MEANS_ON_TISSUE["A+S+L"][0]
    rows = [
        [f"`{name}`", *(f"{found[name][clip]:.3f}" for clip in CLIPS), f"{np.mean(list(found[name].values())):.3f}"]
        for name in FOLDERS
    ]
    rows.append(["as published, mean of the whole image minus mean of the tissue", "-", "-", f"{stated:.2f}"])
    return markdown(("masks", *(f"{clip}, dB" for clip in CLIPS), "mean, dB"), rows)


def measured(options: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Both folders of both clips."""
    return {name: {clip: offset(getattr(options, clip) / name) for clip in CLIPS} for name in FOLDERS}


PROGRAM = Program(
    __name__, "specification/rulings.md", {"folders": table}, "mask_folders.json", measured,
    dict.fromkeys(CLIPS, CLIP), room="masks", stamped=False,
)  # fmt: skip
