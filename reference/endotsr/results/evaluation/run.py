"""The evaluation of a trained run: metrics of its renders and of the baselines, as metrics.json.

In: a model, its training sequence, and run.json. Out: the dictionary of metrics.json (metrics of the frames, effect of
each component, pose correction, description of the run) and the renders of the held-out frames. Writes nothing.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import cast

import msgspec
import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, backproject, camera_centre, degrees_between, project
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.baselines import neighbours
from endotsr.results.evaluation.evaluate import evaluate_frames, evaluate_model
from endotsr.results.evaluation.lpips import LpipsWeights
from endotsr.results.evaluation.measures import measured
from endotsr.results.evaluation.recorded_texture import with_recorded_texture
from endotsr.results.evaluation.records import (
    EvaluationRecord,
    LabelledMeans,
    Means,
    MotionPart,
    PosePart,
    RunEvaluation,
    RunPart,
)
from endotsr.results.evaluation.trajectories import TruePositions, trajectory_error
from endotsr.training.fitting.model import render_at, with_corrected_cameras, without
from endotsr.training.runs.folder import RunFolder
from endotsr.training.runs.model import Model
from endotsr.training.runs.records import REPORTED, RunRecord
from endotsr.training.runs.sources import run_source, true_positions_of

COMPONENTS = {"appearance": "A, colour residual", "spectral_motion": "S, translation residual"}
KEPT = ("seed", "threads", "started", "finished", "seconds", "peak_memory_bytes", "lambda_lap", "versions", "machine")

RENDERS_KEPT = 32  # cached held-out renders; further frames are rendered again
NEIGHBOURS_KEPT = 4  # cached renders of training frames beside a held-out one, and of this one
POINTS = 8  # along each side of the picture: grid for the image motion of a camera

RenderFrame = Callable[[int], RenderOut]  # frame number -> render


def measure_folder(
    folder: RunFolder,
    model: Model,
    sequence: Sequence,
    source: str,
    *,
    weights: LpipsWeights | None = None,
    measures: tuple[str, ...] = (),
) -> tuple[RunEvaluation, RenderFrame]:
    """The metrics.json of a run, and the renders of `measure_model`.

    model     of the latest checkpoint of the run
    source    current location of the sequence; for a simulated one, the motion is measured too
    measures  names of `evaluation.measures.MEASURES`; results under `measures` in metrics.json
    """
    (_, simulator), record = run_source(folder), folder.record(*REPORTED)
    truth = true_positions_of(source, simulator, folder.config(), sequence)
    found, held_out = measure_model(model, sequence, weights, truth)
    metrics: RunEvaluation = {**found, "run": about_run(record, model)}
    if measures:
        metrics["measures"] = measured(measures, model, sequence, source)
    return metrics, held_out


def measure_model(
    model: Model,
    sequence: Sequence,
    weights: LpipsWeights | None = None,
    true_positions: TruePositions | None = None,
) -> tuple[EvaluationRecord, RenderFrame]:
    """The part of metrics.json that needs no run folder, and the function that renders held-out frames (cached).

    weights         None: LPIPS is None
    true_positions  of a simulated sequence, to measure the motion
    returns         the keys of `evaluate_model`, among them those of `OWN`: metrics of the renders with recorded
                    texture, and of the blend of the renders at the neighbouring training times; `trajectories`:
                    `TrajectoryError` and its `unit`, or None;
                    `pose_correction`: see `pose_change`; `components`: means with one residual removed
    """
    given, sequence = sequence, with_corrected_cameras(sequence, model.frames)

    def render(index: int, taken_out: str = "") -> RenderOut:
        shown = without(model.gaussians, **({taken_out: False} if taken_out else {}))
        camera, time = sequence.cameras[index], float(sequence.times[index])
        return render_at(shown, model.spectral, model.config, camera, time, frames=model.frames)

    def colour(index: int) -> FloatArray:
        return (held_out if index in sequence.test_index else render)(index).colour

    held_out: RenderFrame = lru_cache(RENDERS_KEPT)(render)
    near = lru_cache(NEIGHBOURS_KEPT)(colour)
    own = {
        "recorded_texture": lambda index: with_recorded_texture(sequence, index, near),
        "cross_fade": _cross_fade(sequence, near),
    }
    metrics = evaluate_model(sequence, colour, weights, own=own)
    motion = None if true_positions is None else trajectory_error(model, sequence, true_positions)
    metrics["trajectories"] = None if motion is None else cast(MotionPart, motion._asdict() | {"unit": sequence.unit})
    metrics["pose_correction"] = pose_change(given, sequence)
    metrics["components"] = _components(model, sequence, render, metrics["held_out"]["mean"])
    return metrics, held_out


def _cross_fade(sequence: Sequence, render: Callable[[int], FloatArray]) -> Callable[[int], FloatArray]:
    """The blend of the model's renders at the two neighbouring training times, by the number of a held-out frame.

    A model that is no better gains no accuracy from its motion between its training frames.
    """

    def blend(index: int) -> FloatArray:
        near = neighbours(sequence, index)
        before, after = render(near.before), render(near.after)
        return before + before.dtype.type(near.fraction) * (after - before)

    return blend


def _components(
    model: Model, sequence: Sequence, render: Callable[[int, str], RenderOut], full: Means
) -> list[LabelledMeans]:
    """Held-out means of the whole model, and with each of its spectral components removed."""
    rows = [cast(LabelledMeans, {"label": "the whole model", **full})]
    arrays = {
        "appearance": model.gaussians.appearance_coefficients,
        "spectral_motion": model.gaussians.motion_coefficients,
    }
    for name, label in COMPONENTS.items():
        if arrays[name] is not None:
            partial = evaluate_frames(sequence, sequence.test_index, lambda i, n=name: render(i, n).colour)
            rows.append(cast(LabelledMeans, {"label": f"rendered without {label}", **partial["mean"]}))
    return rows


def pose_change(given: Sequence, seen: Sequence) -> PosePart | None:
    """Mean pose correction (B16) over the training frames; None without correction.

    given, seen  the sequence with its given poses and with the corrected ones (`given` itself: no correction). A common
                 motion of all cameras counts too, although it changes no picture
    returns      `degrees` between the rotations, `scene_units` between the optical centres, `pixels` between the
                 projections of points at the median tissue depth, and the `unit` of the scene
    """
    if seen is given:
        return None
    rows = [_camera_change(given, int(i), seen.cameras[i]) for i in given.train_index]
    means = dict(zip(("degrees", "scene_units", "pixels"), np.mean(rows, axis=0).tolist(), strict=True))
    return cast(PosePart, means | {"unit": given.unit})


def _camera_change(sequence: Sequence, index: int, seen: Camera) -> tuple[float, float, float]:
    """Angle in degrees, distance in scene units, and mean displacement in pixels of one frame."""
    camera, depth = sequence.cameras[index], sequence.tissue_depth(index) or 1.0
    moved = float(np.linalg.norm(camera_centre(seen) - camera_centre(camera)))
    ends = (np.linspace(0, size - 1, POINTS) for size in (camera.height, camera.width))
    row, column = (a.ravel() for a in np.meshgrid(*ends, indexing="ij"))
    points = backproject(camera, column, row, np.full(row.size, depth))
    apart = np.subtract(project(seen, points)[:2], project(camera, points)[:2])
    return degrees_between(seen.rotation, camera.rotation), moved, float(np.hypot(*apart).mean())


def about_run(record: RunRecord, model: Model) -> RunPart:
    """The entry `run` of metrics.json, which makes the file self-contained."""
    about = {
        "iteration": model.iteration,
        "iterations_planned": model.config.training.iterations,
        "status": record.get("status"),
        "gaussians": model.gaussians.count,
    }
    kept = {key: record.get(key) for key in (*KEPT, "input")}
    return cast(RunPart, about | kept | {"settings": msgspec.to_builtins(model.config)})
