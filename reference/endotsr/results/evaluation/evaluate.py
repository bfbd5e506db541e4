"""Metrics of renders and baselines on the frames, and the dictionary of metrics.json.

The input is a function from frame number to picture, so the same code evaluates the model, a baseline, and the pictures
of another program.

A metric without a finite value (LPIPS without weights, infinite PSNR of two equal pictures, tissue PSNR of an empty
mask, a render that is not finite) is None, never NaN, because the result is JSON. Means exclude and count such values.
A frame without tissue has no metrics.
"""

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import cast

import numba
import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.memory import keep_freed_memory
from endotsr.method.kernels.threads import parallel_calls
from endotsr.results.evaluation.baselines import BASELINES, unit_image
from endotsr.results.evaluation.coverage import TimesSeen, coverage, extrapolated, seen_metrics, times_seen
from endotsr.results.evaluation.lpips import InputRange, LpipsWeights, feature_maps, lpips_obstacle, map_distances
from endotsr.results.evaluation.metrics import image_metrics, mean_metrics
from endotsr.results.evaluation.records import (
    EvaluationRecord,
    FrameMetrics,
    FramesMeasured,
    FramesPart,
    LabelledFrames,
    Means,
)
from endotsr.results.evaluation.tissue_baselines import TISSUE_BASELINES

RenderFrame = Callable[[int], FloatArray]

FORMAT = 1  # of metrics.json; raised when a key changes its name or meaning
LPIPS_KEYS: dict[str, InputRange] = {"lpips": "zero_one", "lpips_symmetric": "minus_one_one"}  # protocol value first
EVERY_BASELINE = {**BASELINES, **TISSUE_BASELINES}
MODEL = ""  # key of the model among the methods
OWN = {  # key in metrics.json -> label of a prediction that is made of the renders of the model
    "recorded_texture": "This model with the recorded texture of the two neighbouring training frames",
    "cross_fade": "Blend of this model's own renders at the two neighbouring training times",
}
FEWEST_AT_A_TIME, BYTES_AT_A_TIME = 2, 3e8  # renders measured at a time, one per thread within this memory
PERCEIVED_BYTES = 140  # of LPIPS per pixel of a render: 44 MB at 640x512, 280 MB at 1920x1080
EVERY_TRAINING_FRAME = 6  # every sixth training frame is evaluated too


def evaluate_frames(
    sequence: Sequence,
    indices: Iterable[int],
    render_frame: RenderFrame,
    lpips_weights: LpipsWeights | None = None,
) -> FramesMeasured:
    """Metrics of `render_frame(i)` against frame i, for every i of `indices`.

    render_frame    frame number -> (3, H, W) display units; values outside [0, 1] are clipped by the metrics
    lpips_weights   None: LPIPS is None

    Raises   ValueError naming the frame if the shapes of render and frame differ
    """
    return evaluate_methods(sequence, indices, {MODEL: render_frame}, lpips_weights)[MODEL]


def evaluate_methods(
    sequence: Sequence,
    indices: Iterable[int],
    methods: Mapping[str, RenderFrame],
    lpips_weights: LpipsWeights | None = None,
    seen: TimesSeen | None = None,
) -> dict[str, FramesMeasured]:
    """`evaluate_frames` for several methods, which share the feature maps of the true frames.

    seen   from `times_seen`; adds `psnr_seen` and `psnr_seen_twice`

    Methods are rendered one after the other, and `renders_at_a_time` of them are measured at once.
    """
    keep_freed_memory()
    rows: dict[str, list[FrameMetrics]] = {name: [] for name in methods}
    bad = dict.fromkeys(methods, 0)
    for index in (int(i) for i in indices):
        truth = _Truth(sequence, index, lpips_weights, seen)
        about = {"frame": index, "name": str(sequence.names[index]), "time": float(sequence.times[index])}
        for name, found in truth.of_methods(methods):
            values = {key: _finite(value) for key, value in found.items()}
            if truth.mask.any():
                bad[name] += sum(values[key] is None and found[key] is not None for key in found)
            rows[name].append(cast(FrameMetrics, about | values))
    return {name: measured_rows(rows[name], bad[name]) for name in methods}


def measured_rows(rows: list[FrameMetrics], not_finite: int) -> FramesMeasured:
    """Frames with the means of their metrics; `not_finite` counts the values on tissue that are not finite."""
    keys = [key for key in (rows[0] if rows else {}) if key not in ("frame", "name", "time")]
    summary = mean_metrics([{key: row.get(key) for key in keys} for row in rows])
    excluded = {key: int(count) for key in keys if (count := summary[f"{key}_excluded"])}
    return {
        "mean": {key: summary[key] for key in keys}, "per_frame": rows, "excluded": excluded, "not_finite": not_finite,
    }  # fmt: skip


def held_out_means(evaluation: EvaluationRecord, measured: FramesMeasured) -> tuple[Means, Means]:
    """Means over the held-out frames between training frames, and over the extrapolated frames.

    measured   of the model, the cross-fade or a baseline
    returns    two dictionaries metric -> mean; the second is empty if no frame is extrapolated, or if all are, which
               the first then describes
    """
    outside = set((evaluation.get("frames") or {}).get("extrapolated") or ())
    rows = measured.get("per_frame") or []
    within, beyond = ([row for row in rows if (row["frame"] in outside) is which] for which in (False, True))
    if not within or not beyond:
        return measured.get("mean") or {}, {}
    return measured_rows(within, 0)["mean"], measured_rows(beyond, 0)["mean"]


def all_extrapolated(evaluation: EvaluationRecord) -> bool:
    """Whether there are held-out frames, but none between two training frames."""
    outside = set((evaluation.get("frames") or {}).get("extrapolated") or ())
    rows = (evaluation.get("held_out") or {}).get("per_frame") or []
    return bool(rows) and all(row["frame"] in outside for row in rows)


def left_out(evaluation: EvaluationRecord) -> list[str]:
    """Names of the held-out frames without a tissue PSNR, which the means exclude."""
    rows = (evaluation.get("held_out") or {}).get("per_frame") or []
    return [row["name"] for row in rows if "psnr_tissue" in row and row["psnr_tissue"] is None]


def training_sample(sequence: Sequence) -> list[int]:
    """Every sixth training frame, starting with the first."""
    return [int(i) for i in sequence.train_index[::EVERY_TRAINING_FRAME]]


def evaluate_model(
    sequence: Sequence,
    render_frame: RenderFrame,
    lpips_weights: LpipsWeights | None = None,
    training: Iterable[int] | None = None,
    own: Mapping[str, RenderFrame] | None = None,
) -> EvaluationRecord:
    """The content of metrics.json for the renders of a sequence.

    training   training frames to evaluate too, without LPIPS; default: `training_sample`
    own        key of `OWN` -> predictions that are made of the model's renders
    returns    {"format", "frames", "held_out", "training", "temporal_gap", "baselines", "lpips_reason",
               "not_finite"}, and the keys of `own`; `temporal_gap` is the training mean minus the held-out mean of each
               metric; `lpips_reason` is None if LPIPS was computed; `not_finite` does not count `own`
    """
    chosen = training_sample(sequence) if training is None else [int(i) for i in training]
    seen = times_seen(sequence)
    methods = {MODEL: render_frame} | {name: make(sequence) for name, (_, make) in EVERY_BASELINE.items()}
    methods |= own or {}
    held_out = evaluate_methods(sequence, sequence.test_index, methods, lpips_weights, seen)
    inside = evaluate_frames(sequence, chosen, render_frame)
    frames: FramesPart = {
        "total": len(sequence.images),
        "training": len(sequence.train_index),
        "held_out": [int(i) for i in sequence.test_index],
        "training_sample": chosen,
        "tissue_fraction": float(np.mean(sequence.masks)),
        "extrapolated": extrapolated(sequence, sequence.test_index),
        "coverage": None if seen is None else coverage(sequence, sequence.test_index, seen),
    }
    obstacle = lpips_obstacle(lpips_weights, *sequence.images.shape[2:])
    baselines: dict[str, LabelledFrames] = {
        name: {"label": label, **held_out[name]} for name, (label, _) in EVERY_BASELINE.items()
    }
    record = evaluation_record(frames, held_out[MODEL], inside, baselines, obstacle)
    return cast(EvaluationRecord, record | {key: {"label": OWN[key], **held_out[key]} for key in own or {}})


def evaluation_record(
    frames: FramesPart,
    held_out: FramesMeasured,
    training: FramesMeasured,
    baselines: dict[str, LabelledFrames],
    lpips_reason: str | None,
) -> EvaluationRecord:
    """The content of metrics.json from its measured parts; see `evaluate_model`."""
    return {
        "format": FORMAT,
        "frames": frames,
        "held_out": held_out,
        "training": training,
        "temporal_gap": difference(training["mean"], held_out["mean"]),
        "baselines": baselines,
        "lpips_reason": lpips_reason,
        "not_finite": sum(part["not_finite"] for part in (held_out, training, *baselines.values())),
    }


def renders_at_a_time(pixels: int) -> int:
    """Number of renders of this many pixels that are measured at once: one per thread, at least two, within 0.3 GB."""
    return max(FEWEST_AT_A_TIME, min(numba.get_num_threads(), int(BYTES_AT_A_TIME / (PERCEIVED_BYTES * pixels))))


class _Truth:
    """One true frame, against which several renders are measured; its feature maps (LPIPS) are computed once."""

    def __init__(self, sequence: Sequence, index: int, weights: LpipsWeights | None, seen: TimesSeen | None) -> None:
        self.index, self.mask = index, sequence.masks[index]
        self._image, self._seen = unit_image(sequence, index), seen
        usable = weights is not None and lpips_obstacle(weights, *self.mask.shape) is None and bool(self.mask.any())
        self._weights = weights if usable else None
        self._maps = {key: self._features(self._image, how) for key, how in LPIPS_KEYS.items()} if usable else {}

    def of_methods(self, methods: Mapping[str, RenderFrame]) -> Iterator[tuple[str, Means]]:
        """Name and metrics of each method; `renders_at_a_time` of them are measured at once.

        Renders with equal tissue are measured once, as those of both blends where no pixel is excluded.
        """
        names, count = list(methods), renders_at_a_time(self.mask.size)
        known: dict[bytes, Means] = {}
        for k in range(0, len(names), count):
            renders = [self._checked(methods[name](self.index)) for name in names[k : k + count]]
            digests = [self._digest(render) for render in renders]
            new = {digest: render for digest, render in zip(digests, renders) if digest not in known}
            known |= zip(new, parallel_calls(*(partial(self._metrics, render) for render in new.values())), strict=True)
            yield from ((name, known[digest]) for name, digest in zip(names[k : k + count], digests, strict=True))

    def _checked(self, render: FloatArray) -> FloatArray:
        """The render as an array. Raises ValueError unless it has the shape of the frame."""
        render = np.asarray(render)
        if render.shape != self._image.shape:
            raise ValueError(f"frame {self.index}: the render is {render.shape}, the frame {self._image.shape}")
        return render

    def _digest(self, render: FloatArray) -> bytes:
        """A digest of the tissue of a render, on which alone its metrics depend."""
        return hashlib.blake2b(np.where(self.mask, render, 0).tobytes(), person=render.dtype.str.encode()).digest()

    def _metrics(self, render: FloatArray) -> Means:
        """Every metric of a render; inf and nan as `image_metrics`."""
        found = image_metrics(render, self._image, self.mask) | self._distances(render)
        if self._seen is not None:
            found |= seen_metrics(render, self._image, self.mask, self._seen)
        return found

    def _distances(self, render: FloatArray) -> Means:
        """Both LPIPS values of a render, clipped; None without weights or tissue, or for a small picture."""
        if self._weights is None:
            return dict.fromkeys(LPIPS_KEYS)
        shown = np.clip(render, 0, 1)
        return {
            key: math.fsum(map_distances(self._features(shown, how), self._maps[key], self._weights))
            for key, how in LPIPS_KEYS.items()
        }

    def _features(self, image: FloatArray, how: InputRange) -> list[FloatArray]:
        """Feature maps of an image with excluded pixels 0."""
        assert self._weights is not None
        return feature_maps(np.where(self.mask, image, 0), self._weights, how)


def difference(inside: Means, outside: Means) -> Means:
    """Inside minus outside for each metric; None if one of them has no value."""
    pairs = {key: (value, outside.get(key)) for key, value in inside.items()}
    return {key: None if a is None or b is None else a - b for key, (a, b) in pairs.items()}


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
