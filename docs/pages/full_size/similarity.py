"""Train `sharp` with several weights of the similarity, over seeds and scenes: a table of the rulings.

    python docs/make.py full_size.similarity measure [CLIP ...] [--seeds 3] [--iterations 1500] [--jobs 2]

Scenes and trainings are those of `full_size.levers`.
"""

from functools import partial
from typing import Any

from pages.full_size.levers import OPTIONS, SHOWN, Rows, about, cell, trained
from pages.store.program import Program
from pages.store.tables import noted

THRESHOLD = {"density": {"gradient_threshold": 4e-4}}  # of all rows: a larger weight makes more Gaussians
FORMER = "0.2"  # the weight that the others are compared with
WEIGHTS: Rows = {
    **{weight: {"loss": {"ssim_weight": float(weight)}, **THRESHOLD} for weight in (FORMER, "0.5", "0.7", "0.9")},
    "0.7, `lambda_lap` 3": {"loss": {"ssim_weight": 0.7, "lambda_lap": 3.0}, **THRESHOLD},
}


def table(result: dict[str, Any]) -> str:
    """Paired differences from the former weight, with 95 % intervals: held-out PSNR and trajectory error."""
    columns = [
        (f"{name}, {words.rsplit(', ', 1)[1]}", scene, key, digits)
        for name, scene in result["scenes"].items()
        for key, words, digits in SHOWN
        if key in scene[FORMER][0]
    ]
    rows = [
        [label, *(cell(scene[label], scene[FORMER], key, digits) for _, scene, key, digits in columns)]
        for label in WEIGHTS
    ]
    threshold = THRESHOLD["density"]["gradient_threshold"]
    note = (
        "The first row is a level, the others are differences; the clip is read at half size, and "
        f"`gradient_threshold` is {threshold:.4f}; {about(result)}"
    )
    return noted(["$w$", *(column[0] for column in columns)], rows, note)


PROGRAM = Program(
    __name__, "specification/rulings.md", {"table": table}, "similarity.json", partial(trained, rows=WEIGHTS), OPTIONS
)
