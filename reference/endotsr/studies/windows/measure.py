"""Held-out metrics of a windowed run and of the baselines, and flicker at the seams.

In: the scene of the windows and their sequences, one at a time. Out: the dictionary of metrics.json. Frame numbers are
those of the recording. Each frame is measured in the window with the larger weight; the baselines use the training
frames of that window.

Flicker compares three successive pictures on the tissue. Both neighbours are warped to the middle frame along the
optical flow of the *recorded* frames:

    d(t) = (I(t-1) - 2 I(t) + I(t+1)) / sqrt(6).

The root mean square of d over the tissue is reported for frames in an overlap (seams) and for all others (inside), for
the model and for the recorded frames. Unlike `evaluation.measures.flicker`, it also applies to a moving camera.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.baselines import unit_image
from endotsr.results.evaluation.evaluate import (
    EVERY_TRAINING_FRAME,
    FORMAT,
    evaluate_model,
    evaluation_record,
    measured_rows,
)
from endotsr.results.evaluation.lpips import LpipsWeights
from endotsr.results.evaluation.records import EvaluationRecord, FramesMeasured, FramesPart, LabelledFrames
from endotsr.studies.windows.evaluation import Flicker, LeftOutRow, Seams, WindowedEvaluation, WindowRow
from endotsr.studies.windows.make import window_cost
from endotsr.studies.windows.record import Window
from endotsr.studies.windows.scene import WindowedScene, WindowFrames

LEVELS = 255.0  # flicker is given in 8-bit grey levels
LEAST_PIXELS = 100  # tissue pixels common to the three frames; frames with fewer are skipped


def measure_windows(
    scene: WindowedScene, frames: WindowFrames, weights: LpipsWeights | None = None
) -> WindowedEvaluation:
    """The metrics of a windowed run; renders every frame.

    returns   the keys of `evaluate_model`, joined over the windows, with those of `WindowedEvaluation`
    """
    found, shown = [], _Covered()
    for k, window in enumerate(scene.plan.windows):
        shown.add(window, frames.of_window(k))
        found.append(_measured(scene, frames, k, weights))
    known = [entry for entry in found if entry is not None]
    joined = _joined(known, scene, shown.tissue) if known else cast(EvaluationRecord, {"format": FORMAT})
    rows: list[WindowRow] = [
        {
            "name": window.name,
            "first": window.first,
            "end": window.end,
            **window_cost(folder.path),
            "psnr_tissue": entry and entry["held_out"]["mean"].get("psnr_tissue"),
        }
        for window, folder, entry in zip(scene.plan.windows, scene.folders, found)
    ]
    gaps: list[LeftOutRow] = [{"first": g.first, "end": g.end, "reason": g.reason} for g in scene.plan.left_out]
    return {**joined, "windows": rows, "left_out": gaps, "seams": _seams(scene, frames), "arrays_sha256": shown.digests}


class _Covered:
    """The frames that the windows cover, each of them once: SHA-256 of pictures and masks, and the tissue."""

    def __init__(self) -> None:
        self._hashes = {name: hashlib.sha256() for name in ("images", "masks")}
        self._tissue: list[float] = []
        self._end = 0  # of the windows that were added

    def add(self, window: Window, sequence: Sequence) -> None:
        """Add the frames of a window that no earlier one shares with it."""
        for i in range(max(0, self._end - window.first), sequence.count):
            for name, found in self._hashes.items():
                found.update(getattr(sequence, name)[i].tobytes())  # as `runs.sources.digest` of the whole recording
            self._tissue.append(float(sequence.masks[i].mean()))
        self._end = window.end

    @property
    def tissue(self) -> float:
        """Fraction of the pixels."""
        return float(np.mean(self._tissue))

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of `images` and `masks`."""
        return {name: found.hexdigest() for name, found in self._hashes.items()}


def _measured(
    scene: WindowedScene, frames: WindowFrames, k: int, weights: LpipsWeights | None
) -> EvaluationRecord | None:
    """`evaluate_model` on the frames that window k owns (has the larger weight in); None if none is held out."""
    first, held_out = scene.plan.windows[k].first, {scene.frames[j] for j in scene.record.test_index}
    sequence = frames.of_window(k)
    own = [i for i in range(sequence.count) if scene.owner(first + i) == k]
    test = [i for i in own if first + i in held_out]
    if not test:
        return None
    sample = [i for i in own if i in set(sequence.train_index.tolist())][::EVERY_TRAINING_FRAME]
    shown = replace(sequence, test_index=np.array(test, np.intp))

    def colour(i: int) -> FloatArray:
        return _rendered(scene, first + i)

    metrics = evaluate_model(shown, colour, weights, sample)
    for part in (metrics["held_out"], metrics["training"], *metrics["baselines"].values()):
        for row in part["per_frame"]:
            row["frame"] += first
            row["time"] = row["frame"] / scene.plan.frames
    metrics["frames"]["held_out"] = [i + first for i in metrics["frames"]["held_out"]]
    metrics["frames"]["training_sample"] = [i + first for i in metrics["frames"]["training_sample"]]
    metrics["frames"]["extrapolated"] = [i + first for i in metrics["frames"].get("extrapolated", ())]
    for counted in metrics["frames"].get("coverage") or ():
        counted["frame"] += first
    return metrics


def _rendered(scene: WindowedScene, g: int) -> FloatArray:
    """The picture of frame g from its camera, (3, H, W)."""
    camera = scene.window(scene.owner(g)).cameras[g - scene.plan.windows[scene.owner(g)].first]
    return scene.render(g / scene.plan.frames, camera).colour


def _joined(parts: list[EvaluationRecord], scene: WindowedScene, tissue: float) -> EvaluationRecord:
    """The metrics of all windows as one sequence: concatenated rows, means over all rows, and every frame once."""

    def joined_rows(found: list[FramesMeasured]) -> FramesMeasured:
        rows = [row for part in found for row in part["per_frame"]]
        return measured_rows(rows, sum(part["not_finite"] for part in found))

    frames: FramesPart = {
        "total": len(scene.frames),
        "training": len(scene.record.train_index),
        "held_out": [i for part in parts for i in part["frames"]["held_out"]],
        "training_sample": [i for part in parts for i in part["frames"]["training_sample"]],
        "tissue_fraction": tissue,
        "extrapolated": [i for part in parts for i in part["frames"].get("extrapolated", ())],
        "coverage": [row for part in parts for row in part["frames"].get("coverage") or ()] or None,
    }
    held_out, training = (joined_rows([part[name] for part in parts]) for name in ("held_out", "training"))
    baselines: dict[str, LabelledFrames] = {
        name: {"label": row["label"], **joined_rows([part["baselines"][name] for part in parts])}
        for name, row in parts[0]["baselines"].items()
    }
    return evaluation_record(frames, held_out, training, baselines, parts[0]["lpips_reason"])


def _seams(scene: WindowedScene, frames: WindowFrames) -> Seams:
    """Flicker at seams and inside; None where there is no frame."""
    squares: dict[str, dict[bool, list[float]]] = {name: {True: [], False: []} for name in ("model", "recorded")}
    for at_seam, model, recorded in _flickers(scene, frames):
        squares["model"][at_seam].append(model)
        squares["recorded"][at_seam].append(recorded)
    return {
        "seam_frames": len(squares["model"][True]),
        "inside_frames": len(squares["model"][False]),
        "model": _levels(squares["model"]),
        "recorded": _levels(squares["recorded"]),
    }


def _levels(found: dict[bool, list[float]]) -> Flicker:
    seams, inside = (float(np.sqrt(np.mean(v)) * LEVELS) if v else None for v in (found[True], found[False]))
    return {"seams": seams, "inside": inside, "ratio": seams / inside if seams and inside else None}


def _flickers(scene: WindowedScene, frames: WindowFrames) -> Iterator[tuple[bool, float, float]]:
    """Per frame with two neighbours: whether one of the three is in an overlap; mean d^2 of model and recording."""
    for k, window in enumerate(scene.plan.windows):
        last = window.end == scene.plan.frames or k + 1 == len(scene.plan.windows) or not scene.plan.shared(k + 1)
        sequence = frames.of_window(k)
        shown: dict[int, FloatArray] = {}
        for i in range(1, sequence.count - 1):
            g = window.first + i
            if not last and g >= scene.plan.windows[k + 1].first + 1:
                break  # the next window contains this frame and both neighbours
            for j in (i - 1, i, i + 1):
                if j not in shown:
                    shown[j] = np.clip(_rendered(scene, window.first + j), 0, 1)
            shown.pop(i - 2, None)
            seam = any(len(scene.parts(window.first + j)) > 1 for j in (i - 1, i, i + 1))
            if (squares := _squares(sequence, i, shown)) is not None:
                yield seam, *squares


def _squares(sequence: Sequence, i: int, shown: dict[int, FloatArray]) -> tuple[float, float] | None:
    """Mean d^2 over the tissue at frame i, of renders and of recorded frames; None with too little tissue."""
    from endotsr.clips.opencv.flow import dense_flow, warp_bilinear

    seen, sums = sequence.masks[i].copy(), [-2.0 * shown[i].astype(np.float64), -2.0 * unit_image(sequence, i)]
    for j in (i - 1, i + 1):
        flow = dense_flow(sequence.images[i], sequence.images[j])
        seen &= warp_bilinear(sequence.masks[j].astype(np.float32), flow) > 0.999
        for k, picture in enumerate((shown[j], unit_image(sequence, j))):
            sums[k] = sums[k] + warp_bilinear(picture, flow)
    if np.count_nonzero(seen) < LEAST_PIXELS:
        return None
    model, recorded = (float(np.square(total[:, seen]).mean() / 6.0) for total in sums)
    return model, recorded
