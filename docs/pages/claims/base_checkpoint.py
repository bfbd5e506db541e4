"""Equation (7) at a checkpoint of the base: docs/results/calibration_base.json, and a table of the rulings.

    python docs/make.py claims.base_checkpoint PULLING CUTTING   train the base of both clips to iteration 3000, write
    python docs/make.py claims.base_checkpoint                   write the table

The base has none of A, S and L, so that the value does not depend on the loss whose weight it is.
"""

import sys
from itertools import product
from pathlib import Path
from typing import Any

import msgspec

from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import now
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
PAGE, RECORD = DOCS / "specification" / "rulings.md", DOCS / "results" / "calibration_base.json"
CLIPS, RULES, WEIGHTS = ("pulling", "cutting"), ("co_sited", "half_pixel"), (0.0, 0.05, 0.1, 0.2)
Cells = list[dict[str, Any]]


def cells(clip: str, folder: Path) -> Cells:
    """lambda_lap for every rule and weight, at one checkpoint of the base of `paper` with seed 0."""
    import endotsr
    from endotsr.config import PAPER
    from endotsr.training.fitting.objective import calibrate_on
    from endotsr.training.fitting.state import new_training, training_constants
    from endotsr.training.fitting.trainer import training_step

    sequence, change = endotsr.load_sequence(str(folder)), msgspec.structs.replace
    model = change(PAPER.model, appearance=False, spectral_motion=False, laplacian=False)
    base = change(PAPER, model=model, loss=change(PAPER.loss, lambda_lap=0.0))
    constants, state = training_constants(sequence, base), new_training(sequence, base)
    while state.iteration < base.training.residual_activation:
        training_step(state, constants)
    found = []
    for rule, weight in product(RULES, WEIGHTS):
        config = change(base, loss=change(base.loss, ssim_weight=weight, upsampling=rule))
        value = calibrate_on(state.gaussians, constants.spectral, sequence, config, state.frames).lambda_lap
        found.append({"clip": clip, "ssim_weight": weight, "upsampling": rule, "lambda_lap": value})
    return found


def table(found: Cells) -> str:
    """One row per clip and rule."""
    of = {(c["clip"], c["upsampling"], c["ssim_weight"]): c["lambda_lap"] for c in found}
    rows = [[clip, f"`{rule}`", *(f"{of[clip, rule, w]:.3f}" for w in WEIGHTS)] for clip in CLIPS for rule in RULES]
    return markdown(("clip", "up-sampling", *(f"$w={w:g}$" for w in WEIGHTS)), rows)


def main(words: list[str]) -> None:
    """The command."""
    if len(words) == len(CLIPS):
        found = [cell for clip, folder in zip(CLIPS, words, strict=True) for cell in cells(clip, Path(folder))]
        about = {"date": now()[:10], "preset": "paper", "seed": 0, "model": "base: no A, S, L"}
        write_json(RECORD, about | {"cells": found})
    elif words:
        sys.exit(__doc__)
    found = read_json(RECORD, "python docs/make.py claims.base_checkpoint")["cells"]
    write_marked(PAGE, {"calibration": table(found)}, "base")
