"""The running clip of the book as a small extract of one run: python docs/make.py book.running_scene RUN

    endotsr simulate pulling --out CLIP
    endotsr train CLIP --preset quick --seed 0 --out RUN
    python docs/make.py book.running_scene RUN     to notebooks/running_clip

The frame is the held-out one at which the mean of the two neighbours has the largest error. The extract has this frame,
its neighbours, mask and depth, and all Gaussians in view at its time. All parameters are kept of the Gaussians whose
centres are near one pixel: the one with the largest error in the block of 16x16 pixels where the model is worst. Only a
run of a simulated clip is accepted.
"""

# pyright: reportTypedDictNotRequiredAccess=false

import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image

import endotsr
from endotsr.clips.effects.inspect import inspect_sequence
from endotsr.clips.effects.plan import apply_plan, make_plan
from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.method.splatting.render import RenderSaved, Scene, render_forward
from endotsr.results.evaluation.baselines import BASELINES, neighbours, unit_image
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.training.fitting.model import raster_settings, scene_at
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import now
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.untrusted.writing import replace_file
from pages.full_size.page import noise_of
from pages.store.commands import loaded
from pages.store.program import DOCS

FOLDER = DOCS.parent / "notebooks" / "running_clip"
BLOCK = 16  # pixels of the side of the block with the largest error
REACH = 24  # pixels around that pixel: Gaussians with centres in this square are stored with all parameters
Y00 = 0.5 / np.sqrt(np.pi)  # the harmonic of degree 0


def hardest_frame(sequence: Sequence) -> int:
    """The held-out frame at which the blend of the neighbours has the lowest PSNR over tissue."""
    blend = BASELINES["two_neighbours"][1](sequence)
    found = {
        k: psnr_tissue(blend(k), unit_image(sequence, k), sequence.masks[k]) for k in map(int, sequence.test_index)
    }
    return min(found, key=lambda k: found[k])


def seen(saved: RenderSaved) -> Scene:
    """The Gaussians in view, front to back, with their colours in this view as harmonics of degree 0."""
    order = saved.order
    p, q, s, o = (np.ascontiguousarray(array[..., order]) for array in saved.scene[:4])
    colours = saved.composite.records[:, 6:9].T
    return Scene(p, q, s, o, ((colours - 0.5) / Y00).astype(np.float32)[None])


def worst_pixel(error: NDArray[np.float64], tissue: NDArray[np.bool_]) -> tuple[int, int]:
    """Column and row of the largest error in the block, all of it tissue, with the largest mean error."""
    height, width = (size // BLOCK for size in error.shape)
    blocks = (height, BLOCK, width, BLOCK)
    mean = error[: height * BLOCK, : width * BLOCK].reshape(blocks).mean(axis=(1, 3))
    whole = tissue[: height * BLOCK, : width * BLOCK].reshape(blocks).all(axis=(1, 3))
    top, left = BLOCK * np.array(np.unravel_index(np.argmax(np.where(whole, mean, -1)), mean.shape))
    inside = error[top : top + BLOCK, left : left + BLOCK]
    row, column = np.unravel_index(np.argmax(inside), inside.shape)
    return int(left + column), int(top + row)


def near(gaussians: Gaussians, saved: RenderSaved, pixel: tuple[int, int]) -> dict[str, NDArray[np.float32]]:
    """All parameters of the visible Gaussians whose centres are in the square around a pixel."""
    distance = np.abs(saved.projected.mean2d - (np.array(pixel) + 0.5)[:, None]).max(axis=0)
    chosen = np.flatnonzero(saved.visible & (distance <= REACH))
    return {name: np.ascontiguousarray(array[..., chosen]) for name, array in arrays(gaussians).items()}


def inspected(run: endotsr.Run) -> dict[str, Any]:
    """Verdicts of the tests of the clip, its rates, the changes of the plan, and the effects that were simulated."""
    inspection = inspect_sequence(run.sequence)
    truth = Path(run.record["input"]["source"]) / "truth" / "truth.json"
    return {
        "verdicts": {name: verdict.kind for name, verdict in inspection.verdicts.items()},
        "cycles": [line.cycles for line in inspection.lines],
        "plan": apply_plan(make_plan(inspection, run.config), run.config)[1],
        "effects": loaded(truth)["effects"],
    }


def extract(run: endotsr.Run) -> tuple[dict[str, NDArray], dict[str, NDArray], dict[str, NDArray], dict[str, Any]]:
    """(view, gaussians, pictures, about) of a run."""
    sequence, model = run.sequence, run.model
    index = hardest_frame(sequence)
    camera, time, around = sequence.cameras[index], float(sequence.times[index]), neighbours(sequence, index)
    scene, _ = scene_at(model.gaussians, model.spectral, model.config.model, time)
    raster = raster_settings(model.config)
    rendered, saved = render_forward(scene, camera, raster, degree=model.config.model.harmonics_degree)
    reduced = seen(saved)
    again, _ = render_forward(reduced, camera, raster, degree=0)
    if np.abs(again.colour - rendered.colour).max() > 1 / 2550:
        raise InputError("the reduced scene does not render the frame of the run")
    error = np.square(rendered.colour - unit_image(sequence, index)).mean(axis=0, dtype=np.float64)
    pixel = worst_pixel(error, sequence.masks[index])
    view = dict(zip(Scene._fields, reduced[:5])) | {
        "mask": sequence.masks[index], "depth": sequence.depth[index],
        "rotation": camera.rotation, "translation": camera.translation,
        "pinhole": np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
        "time": np.float64(time), "train_times": sequence.times[sequence.train_index],
    }  # fmt: skip
    pictures = {"frame": index, "before": around.before, "after": around.after}
    about = {
        "frame": index, "size": [camera.width, camera.height], "pixel": pixel, "gaussians": model.gaussians.count,
        "growth": [entry["gaussians"] for entry in run.log[::100]],
        "seed": run.record["seed"], "iterations": run.record["iterations_done"], "date": now()[:10],
        "inspection": inspected(run),
        "config": {part: msgspec.to_builtins(getattr(model.config, part)) for part in ("model", "raster", "loss")},
    }  # fmt: skip
    return view, near(model.gaussians, saved, pixel), {n: sequence.images[k] for n, k in pictures.items()}, about


def main(words: list[str]) -> None:
    """The command."""
    if len(words) != 1:
        sys.exit(__doc__)
    try:
        run = endotsr.open_run(words[0])
        if not isinstance(run, endotsr.Run):
            raise InputError(f"{words[0]}: a recording in windows; use one run")
        noise_of(Path(run.record["input"]["source"]), run.config.sequence.scale)  # refuses a clip of a patient
        view, gaussians, pictures, about = extract(run)
    except InputError as error:
        sys.exit(f"error: {error}")
    for name, stored in (("view", view), ("gaussians", gaussians)):
        replace_file(FOLDER / f"{name}.npz", lambda path, stored=stored: _save(path, stored))
    for name, image in pictures.items():
        made = Image.fromarray(np.ascontiguousarray(image.transpose(1, 2, 0)))
        replace_file(FOLDER / f"{name}.webp", lambda path, made=made: made.save(path, "WEBP", lossless=True, method=6))
    write_json(FOLDER / "about.json", about)


def _save(path: Path, stored: dict[str, NDArray]) -> None:
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **stored)
