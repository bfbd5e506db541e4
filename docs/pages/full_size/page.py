"""Trainings of a simulated clip at full size, and predictions without a model: by frame, by pixel, in pictures.

    endotsr simulate pulling --out CLIP
    endotsr train CLIP --preset PRESET --out RUN [--sequence.split blocks --sequence.block-length 8]
    python docs/make.py full_size measure RUN ...    finished runs of the clip, to docs/results/full_size

A run is stored under its preset and its held-out frames, and replaces the previous one. The folder contains numbers and
small pictures, no model. Only runs of a simulated clip are accepted: pictures of patients are not stored.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

import endotsr
from endotsr.clips.flow.between import flows_between
from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.results.evaluation.baselines import BASELINES, RenderFrame, neighbours, unit_image
from endotsr.results.report.style import save
from endotsr.training.runs.machine import now
from endotsr.untrusted.writing import replace_file
from pages.full_size import text as full_size_text
from pages.full_size.against_flow import KINDS, kinds
from pages.full_size.pictures import curves_figure, maps_picture, sample_picture
from pages.full_size.text import PREDICTIONS
from pages.store.commands import loaded
from pages.store.program import RESULTS, RUNS, Program

FOLDER = RESULTS / "full_size"
MODEL = "model"
SHOWN = ("worst", "median", "best")


def of_run(folder: Path) -> tuple[str, dict[str, Any], dict[str, NDArray[np.uint8]]]:
    """Name, numbers and pictures {file stem: picture} of one finished run."""
    run = endotsr.open_run(folder)
    if not isinstance(run, endotsr.Run):
        raise InputError(f"{folder}: a recording in windows; use one run")
    sequence, settings = run.sequence, msgspec.to_builtins(run.config)
    sigma = noise_of(Path(run.record["input"]["source"]), settings["sequence"]["scale"])
    predict = predictions(run)
    squares = {name: np.zeros(sequence.masks.shape[1:]) for name in PREDICTIONS}
    frames: list[dict[str, Any]] = []
    regions: dict[str, dict[str, float]] = {name: dict.fromkeys(("pixels", *PREDICTIONS), 0.0) for name in KINDS}
    for index in map(int, sequence.test_index):
        truth, tissue = unit_image(sequence, index), sequence.masks[index]
        errors = {
            name: np.where(tissue, np.square(predict[name](index) - truth).mean(axis=0, dtype=np.float64), 0.0)
            for name in PREDICTIONS
        }
        frames.append(frame_numbers(sequence, index, errors))
        for name, mask in kinds(sequence, index).items():
            regions[name]["pixels"] += float(mask.sum())
            for key, error in errors.items():
                regions[name][key] += float(error[mask].sum())
        for key, error in errors.items():
            squares[key] += error
    shown, split = chosen(frames), full_size_text.split_name(settings["sequence"])
    name = f"{settings['preset']}_{split}"
    pictures = {f"{name}_{key}": sample_picture(sequence, index, predict) for key, index in shown.items()}
    seen = np.maximum(sequence.masks[sequence.test_index].sum(axis=0), 1)
    pictures[f"{name}_errors"] = maps_picture({key: np.sqrt(total / seen) for key, total in squares.items()})
    about = about_run(run) | {"preset": settings["preset"], "split": split, "noise": sigma, "shown": shown}
    return name, about | {"frames": frames, "regions": regions}, pictures


def predictions(run: endotsr.Run) -> dict[str, RenderFrame]:
    """Every prediction of a frame by its index, the render of the model clipped to [0, 1]."""
    sequence = run.sequence
    found = {name: BASELINES[name][1](sequence) for name in PREDICTIONS if name != MODEL}
    return found | {MODEL: lambda i: np.clip(run.render(float(sequence.times[i]), i).colour, 0, 1)}


def about_run(run: endotsr.Run) -> dict[str, Any]:
    """Length, size, machine and date of a run."""
    sequence = run.sequence
    kept = {key: run.record[key] for key in ("iterations_done", "seed", "threads", "machine")}
    size = {"width": sequence.width, "height": sequence.height, "frame_count": sequence.count}
    return kept | size | {"gaussians": run.log[-1]["gaussians"], "date": now()[:10]}


def noise_of(clip: Path, scale: float) -> float:
    """Standard deviation of noise and rounding of a frame, display units, from the truth of a simulated clip.

    Raises: InputError for a clip without truth (no picture of a patient may be stored), and for a reduced clip, whose
    noise is unknown.
    """
    truth = clip / "truth" / "light.npz"
    if not truth.is_file() or scale != 1:
        raise InputError(f"{clip}: not a simulated clip at full size; use the folder of `endotsr simulate`")
    with np.load(truth) as light:
        return float(np.hypot(light["noise_sigma"], 1 / (255 * np.sqrt(12))))


def frame_numbers(sequence: Sequence, index: int, errors: dict[str, NDArray[np.float64]]) -> dict[str, Any]:
    """Mean squared error over the tissue of every prediction, weight of the blend's noise, and motion.

    blend_noise   variance of the blend's noise relative to a frame: (1 - f)^2 + f^2, 1 with one neighbour
    motion_px     mean length of the flow between the neighbours over the tissue
    """
    near, tissue = neighbours(sequence, index), sequence.masks[index]
    flow = flows_between(sequence, near.before, near.after).forward if near.before != near.after else np.zeros((2, 1))
    moved = float(np.hypot(*flow)[tissue].mean()) if near.before != near.after else None
    numbers = {name: float(error[tissue].mean()) for name, error in errors.items()}
    weight = (1 - near.fraction) ** 2 + near.fraction**2
    return {"frame": index, "motion_px": moved, "blend_noise": weight, "squared_error": numbers}


def chosen(frames: list[dict[str, Any]]) -> dict[str, int]:
    """The held-out frames with the largest, the median and the smallest squared error of the model."""
    order = [row["frame"] for row in sorted(frames, key=lambda row: -row["squared_error"][MODEL])]
    return dict(zip(SHOWN, (order[0], order[len(order) // 2], order[-1]), strict=True))


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The numbers of all runs by name, those of the given runs new; their pictures are written beside the record."""
    stored = loaded(options.record) if options.record.exists() else {}
    for folder in options.runs:
        name, stored[name], pictures = of_run(folder)
        for stem, picture in pictures.items():
            content = full_size_text.encoded(picture)
            file = options.record.parent / f"{stem}.webp"
            replace_file(file, lambda path, content=content: path.write_bytes(content))
    return dict(sorted(stored.items()))


PROGRAM = Program(
    __name__, "full_size.md", full_size_text.fragments, "full_size/runs.json", measured, {"runs": RUNS},
    lambda runs: save(curves_figure(runs), FOLDER / "curves.svg"), stamped=False,
)  # fmt: skip
