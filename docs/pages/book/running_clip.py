"""The running clip of the book: every seed of the preset `quick` on the simulated clip at full size, by held-out frame.

    endotsr simulate pulling --out CLIP
    endotsr train CLIP --preset quick --seed SEED --out RUN      once for each seed
    python docs/make.py book.running_clip measure RUN ...        the table is in chapter 14

The record has numbers alone.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import endotsr
from endotsr.errors import InputError
from endotsr.results.evaluation.baselines import unit_image
from endotsr.results.evaluation.metrics import psnr_tissue
from pages.full_size.page import noise_of, predictions
from pages.full_size.text import LABELS, PREDICTIONS
from pages.store.program import RUNS, Program
from pages.store.tables import noted


def of_run(folder: Path) -> dict[str, Any]:
    """PSNR over tissue of every held-out frame, dB, for the model and every prediction without one."""
    run = endotsr.open_run(folder)
    if not isinstance(run, endotsr.Run):
        raise InputError(f"{folder}: a recording in windows; use one run")
    sequence = run.sequence
    noise_of(Path(run.record["input"]["source"]), run.config.sequence.scale)  # refuses a clip of a patient
    predict, frames = predictions(run), [int(k) for k in sequence.test_index]
    found = {
        name: [float(psnr_tissue(make(k), unit_image(sequence, k), sequence.masks[k])) for k in frames]
        for name, make in predict.items()
    }
    kept = {key: run.record[key] for key in ("seed", "iterations_done", "threads", "machine")}
    size = {"width": sequence.width, "height": sequence.height, "frame_count": sequence.count}
    return (
        kept | size | {"gaussians": [entry["gaussians"] for entry in run.log[::100]], "frames": frames, "psnr": found}
    )


def means(record: dict[str, Any]) -> dict[str, NDArray]:
    """Mean over the held-out frames of every prediction, dB, one number for each seed."""
    return {
        name: np.array([np.mean(run["psnr"][name]) for run in record["runs"]]) for name in record["runs"][0]["psnr"]
    }


def table(record: dict[str, Any]) -> str:
    """Mean of every prediction, its range over the seeds, and its distance from the blend in every seed."""
    found, rows = means(record), []
    for name in PREDICTIONS:
        values, above = found[name], found[name] - found["two_neighbours"]
        spread = f"{values.min():.2f} to {values.max():.2f}" if np.ptp(values) > 0 else "-"
        margin = f"{above.min():+.2f}" + (f" to {above.max():+.2f}" if np.ptp(above) > 0 else "")
        rows.append([LABELS[name], f"{values.mean():.2f}", spread, "-" if name == "two_neighbours" else margin])
    run = record["runs"][0]
    about = f"{run['iterations_done']} iterations, {run['gaussians'][-1]} Gaussians; {run['machine']['processor']}"
    heads = ("Prediction", "dB", f"{len(record['runs'])} seeds", "above the blend, dB")
    return noted(heads, rows, f"Preset `{record['preset']}`, {about}, {record['date'][:10]}.")


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """All runs by their seeds."""
    return {"preset": "quick", "runs": sorted(map(of_run, options.runs), key=lambda run: run["seed"])}


PROGRAM = Program(
    __name__, "../notebooks/14_full_sequence.py", {"table": table}, "running_clip.json", measured, {"runs": RUNS}
)
