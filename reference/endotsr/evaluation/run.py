"""The evaluation of a trained run: its renders against every frame, beside the baselines, as metrics.json.

In: a model, the sequence that it was trained on, and run.json. Out: the dictionary of metrics.json (metrics of the
frames, components taken out, what the numbers belong to) and the renders of the held-out frames.
Writes nothing.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import cast

import msgspec

from endotsr.evaluation.baselines import neighbours
from endotsr.evaluation.evaluate import evaluate_frames, evaluate_model, labelled
from endotsr.evaluation.lpips import LpipsWeights
from endotsr.evaluation.measures import measured
from endotsr.evaluation.poses import pose_change
from endotsr.evaluation.records import (
    EvaluationRecord,
    LabelledFrames,
    LabelledMeans,
    Means,
    MotionPart,
    RunEvaluation,
    RunPart,
)
from endotsr.evaluation.trajectories import TruePositions, trajectory_error
from endotsr.fitting.model import render_at, with_corrected_cameras, without
from endotsr.kernels.arrays import FloatArray
from endotsr.runs.folder import RunFolder
from endotsr.runs.model import Model, load_model
from endotsr.runs.records import REPORTED, RunRecord
from endotsr.runs.sources import run_source, true_positions_of
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.render import RenderOut

COMPONENTS = {"appearance": "A, colour residual", "spectral_motion": "S, translation residual"}
CROSS_FADE = "Blend of this model's own renders at the two neighbouring training times"
KEPT = ("seed", "threads", "started", "finished", "seconds", "peak_memory_bytes", "lambda_lap", "versions", "machine")

RENDERS_KEPT = 32  # of the held-out frames: a clip with more of them has others rendered again, and no more memory

Render = Callable[..., RenderOut]


class Renders(Mapping[int, RenderOut]):
    """The renders of frames by number, made when they are asked for; the last `RENDERS_KEPT` are kept."""

    def __init__(self, render: Callable[[int], RenderOut], frames: tuple[int, ...]) -> None:
        self._frames, self._render = frames, lru_cache(RENDERS_KEPT)(render)

    def __getitem__(self, index: int) -> RenderOut:
        if index not in self:
            raise KeyError(index)
        return self._render(index)

    def __contains__(self, index: object) -> bool:
        return index in self._frames  # without a render

    def __iter__(self) -> Iterator[int]:
        return iter(self._frames)

    def __len__(self) -> int:
        return len(self._frames)


def measure_run(
    model: Model,
    sequence: Sequence,
    record: RunRecord,
    weights: LpipsWeights | None = None,
    true_positions: TruePositions | None = None,
) -> tuple[RunEvaluation, Mapping[int, RenderOut]]:
    """metrics.json of a run, and the renders of the held-out frames by frame number.

    record          run.json of the run
    weights         None: the LPIPS values are None
    true_positions  of a simulated sequence: the motion is measured too
    """
    found, held_out = measure_model(model, sequence, weights, true_positions)
    metrics = cast(RunEvaluation, found)
    metrics["run"] = about_run(record, model)
    return metrics, held_out


def measure_folder(
    folder: RunFolder,
    sequence: Sequence,
    source: str,
    *,
    weights: LpipsWeights | None = None,
    measures: tuple[str, ...] = (),
) -> tuple[Model, RunEvaluation, Mapping[int, RenderOut]]:
    """The model of the latest checkpoint of a run, and what `measure_run` returns for it.

    source    where the sequence is now
    measures  names of `evaluation.measures.MEASURES`: their results are `measures` in metrics.json
    """
    model, (_, simulator) = load_model(folder), run_source(folder)
    truth = true_positions_of(source, simulator, folder.config(), sequence)
    metrics, held_out = measure_run(model, sequence, folder.record(*REPORTED), weights, truth)
    if measures:
        metrics["measures"] = measured(measures, model, sequence, source)
    return model, metrics, held_out


def measure_model(
    model: Model,
    sequence: Sequence,
    weights: LpipsWeights | None = None,
    true_positions: TruePositions | None = None,
) -> tuple[EvaluationRecord, Mapping[int, RenderOut]]:
    """The part of metrics.json that needs no run folder, and the renders of the held-out frames.

    returns  the keys of `evaluate_model`; `cross_fade`, the metrics of the blend of the model's own renders at the
             neighbouring training times; `trajectories`, the fields of `TrajectoryError` and their `unit`, or None;
             `pose_correction`, that of `pose_change`;
             `components`, the means with one residual left out
    """

    given, sequence = sequence, with_corrected_cameras(sequence, model.frames)

    def render(index: int, taken_out: str = "") -> RenderOut:
        shown = without(model.gaussians, **({taken_out: False} if taken_out else {}))
        camera, time = sequence.cameras[index], float(sequence.times[index])
        return render_at(shown, model.spectral, model.config, camera, time, frames=model.frames)

    def colour(index: int) -> FloatArray:
        return (held_out[index] if index in held_out else render(index)).colour

    held_out = Renders(render, tuple(int(i) for i in sequence.test_index))
    metrics = evaluate_model(sequence, colour, weights)
    metrics["cross_fade"] = _cross_fade(sequence, colour, weights)
    motion = None if true_positions is None else trajectory_error(model, sequence, true_positions)
    metrics["trajectories"] = None if motion is None else cast(MotionPart, motion._asdict() | {"unit": sequence.unit})
    metrics["pose_correction"] = pose_change(given, sequence)
    metrics["components"] = _components(model, sequence, render, metrics["held_out"]["mean"])
    return metrics, held_out


def _cross_fade(
    sequence: Sequence, render: Callable[[int], FloatArray], weights: LpipsWeights | None
) -> LabelledFrames:
    """Held-out metrics of the blend of the model's own renders at the two neighbouring training times.

    A model that is no better than this has fitted its training frames, and its motion carries nothing between them.
    """

    def blend(index: int) -> FloatArray:
        near = neighbours(sequence, index)
        before, after = render(near.before), render(near.after)
        return before + before.dtype.type(near.fraction) * (after - before)

    return labelled(CROSS_FADE, evaluate_frames(sequence, sequence.test_index, blend, weights))


def _components(model: Model, sequence: Sequence, render: Render, full: Means) -> list[LabelledMeans]:
    """Held-out means with one spectral component taken out of the trained model, for those it has."""
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


def about_run(record: RunRecord, model: Model) -> RunPart:
    """What the numbers belong to: enough for metrics.json to stand alone."""
    about = {
        "iteration": model.iteration,
        "iterations_planned": model.config.training.iterations,
        "status": record.get("status"),
        "gaussians": model.gaussians.count,
    }
    kept = {key: record.get(key) for key in (*KEPT, "input")}
    return cast(RunPart, about | kept | {"settings": msgspec.to_builtins(model.config)})
