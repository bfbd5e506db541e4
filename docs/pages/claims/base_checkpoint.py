"""Equation (7) at a checkpoint of the base: a table of the rulings.

    python docs/make.py claims.base_checkpoint measure PULLING CUTTING   train the base of both clips to iteration 3000

The base has none of A, S and L, so that the value does not depend on the loss whose weight it is.
"""

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import msgspec

from endotsr.results.report.tables import markdown
from pages.store.program import CLIP, Program

CLIPS, RULES, WEIGHTS = ("pulling", "cutting"), ("co_sited", "half_pixel"), (0.0, 0.05, 0.1, 0.2)


def cells(clip: str, folder: Path) -> list[dict[str, Any]]:
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


def table(record: dict[str, Any]) -> str:
    """One row per clip and rule."""
    of = {(c["clip"], c["upsampling"], c["ssim_weight"]): c["lambda_lap"] for c in record["cells"]}
    rows = [[clip, f"`{rule}`", *(f"{of[clip, rule, w]:.3f}" for w in WEIGHTS)] for clip in CLIPS for rule in RULES]
    return markdown(("clip", "up-sampling", *(f"$w={w:g}$" for w in WEIGHTS)), rows)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Both clips."""
    found = [cell for clip in CLIPS for cell in cells(clip, getattr(options, clip))]
    return {"preset": "paper", "seed": 0, "model": "base: no A, S, L", "cells": found}


PROGRAM = Program(
    __name__, "specification/rulings.md", {"calibration": table}, "calibration_base.json", measured,
    dict.fromkeys(CLIPS, CLIP), room="base",
)  # fmt: skip
