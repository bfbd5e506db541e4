"""Additional measurements, computed on request because each renders many views.

depth        rendered depth of the held-out frames, compared with the prior and with predictions without a model
flicker      temporal noise of static tissue, compared with the recorded frames
right_view   renders for the right camera, compared with the real right pictures and the warped left ones

In: a model, its sequence, and the source of the sequence. Out: plain values for metrics.json under the name of the
measurement; {"reason": ...} if the sequence does not allow it.

Flicker at a pixel is the second difference of its colour over three successive frames,

    d(t) = (I(t-1) - 2 I(t) + I(t+1)) / sqrt(6).

If the noise is independent from frame to frame, d has the standard deviation of the noise. A linear change of the light
cancels. A static pixel is tissue in every frame, with small optical flow between successive frames. Frames without
tissue are left out. The recorded frames flicker at least by the noise of the camera; a value above theirs means that
the model itself flickers.
"""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.baselines import unit_image
from endotsr.results.evaluation.depth import held_out_depth
from endotsr.results.evaluation.records import Measured, MeasureRow
from endotsr.results.evaluation.right_view import right_view
from endotsr.training.fitting.model import render_at, with_corrected_cameras
from endotsr.training.runs.model import Model
from endotsr.untrusted.names import choice

STATIC = 0.5  # px between successive frames: largest median flow of a static pixel
STATIC_HIGH = 1.0  # px: largest 90th percentile of the flow
LEAST_PIXELS = 100  # with fewer static pixels nothing is reported
LEVELS = 255.0  # results are given in 8-bit grey levels

LENGTH = "length"
VALUES = {  # of a row: how it is called, and its unit; the values of "%" are stored as fractions
    "mean_absolute": ("mean error", LENGTH),
    "root_mean_square": ("RMS error", LENGTH),
    "relative": ("relative error", "%"),
    "covered": ("covered", "%"),
    "all_frames": ("all frames", "grey levels"),
    "held_out": ("held-out frames", "grey levels"),
    "held_out_psnr": ("held-out PSNR", "dB"),
    "held_out_ssim": ("held-out SSIM", ""),
    "training_psnr": ("training PSNR", "dB"),
    "training_ssim": ("training SSIM", ""),
}

RenderView = Callable[[int, Camera], RenderOut]  # frame number (for the time) and camera -> render

MEASURES: dict[str, Callable[[Model, Sequence, str, RenderView], Measured]] = {
    "depth": lambda model, sequence, source, render: held_out_depth(sequence, render),
    "flicker": lambda model, sequence, source, render: flicker(sequence, render),
    "right_view": lambda model, sequence, source, render: right_view(sequence, source, model.config.sequence, render),
}


def check_measures(names: Iterable[str], what: str = "measure") -> None:
    """Raises InputError for an unknown name; the message begins with `what`."""
    for name in names:
        if name not in MEASURES:
            raise InputError(f"{what} {name!r} is not allowed; use {choice(MEASURES)}")


def measured(names: Iterable[str], model: Model, sequence: Sequence, source: str) -> dict[str, Measured]:
    """The named measurements of a model.

    source   folder of the sequence, or `simulated`
    Raises:  InputError for an unknown name and for an unreadable right picture.
    """
    names = list(names)
    check_measures(names)
    seen = with_corrected_cameras(sequence, model.frames)

    def render(index: int, camera: Camera) -> RenderOut:
        time = float(seen.times[index])
        return render_at(model.gaussians, model.spectral, model.config, camera, time, frames=model.frames)

    return {name: MEASURES[name](model, seen, source, render) for name in names}


class ShownValue(NamedTuple):
    """A value of a row as a reader sees it."""

    head: str
    number: float
    unit: str

    @property
    def title(self) -> str:
        """Head of a column, with the unit."""
        return f"{self.head}, {self.unit}" if self.unit else self.head


def shown_values(entry: Measured, row: MeasureRow) -> list[ShownValue]:
    """The finite values of a row, in its order. Lengths have the unit of the measurement."""
    found = []
    for key, value in row.items():
        if isinstance(value, float) and math.isfinite(value):
            head, unit = VALUES.get(key, (key.replace("_", " "), ""))
            unit = entry.get("unit", "scene units") if unit == LENGTH else unit
            found.append(ShownValue(head, 100 * value if unit == "%" else value, unit))
    return found


def measure_lines(found: dict[str, Measured]) -> list[str]:
    """The measurements as lines of text."""
    lines = []
    for name, entry in found.items():
        if "reason" in entry:
            lines.append(f"{name}: not measured: {entry['reason']}")
            continue
        for row in entry.get("rows", ()):
            values = (f"{shown.head} {shown.number:.4g} {shown.unit}".rstrip() for shown in shown_values(entry, row))
            lines.append(f"{name}: {row['label']}: {', '.join(values)}")
        if left_out := entry.get("left_out"):
            lines.append(f"{name}: without tissue and left out: {', '.join(left_out)}")
    return lines


def flicker(sequence: Sequence, render: RenderView) -> Measured:
    """Root mean square of d over the static pixels and all inner frames, or the held-out ones; grey levels.

    render   frame number and camera -> render; called once per frame that shows tissue
    returns  {"pixels", "rows": [{"label", "all_frames", "held_out"}]} for the model and the recorded frames, or
             {"reason"}. `held_out` uses d(t) at held-out t only: it is large if the model jumps between training and
             held-out times. Frames without tissue are named by `left_out`, and no d(t) reads them
    """
    if not sequence.static_camera:
        return {"reason": "the camera moves: pixels do not show the same tissue in all frames"}
    shown = _with_tissue(sequence)
    if not (shown[:-2] & shown[1:-1] & shown[2:]).any():
        return {"reason": "no three successive frames show tissue"}
    static = static_pixels(sequence)
    if np.count_nonzero(static) < LEAST_PIXELS:
        return {"reason": f"{np.count_nonzero(static)} static pixels; needed: {LEAST_PIXELS}"}

    def rendered(index: int) -> FloatArray:
        return np.clip(render(index, sequence.cameras[index]).colour, 0, 1)

    frames = {"this model": rendered, "the recorded frames": lambda index: unit_image(sequence, index)}
    rows = [_row(label, sequence, static, frame) for label, frame in frames.items()]
    found: Measured = {"pixels": int(np.count_nonzero(static)), "rows": rows}
    return found if shown.all() else {**found, "left_out": [sequence.names[i] for i in np.flatnonzero(~shown)]}


def _row(label: str, sequence: Sequence, static: BoolArray, frame: Callable[[int], FloatArray]) -> MeasureRow:
    squares: dict[int, float] = {}  # of the frames between two others that show tissue
    last: list[FloatArray] = []  # at most three frames at a time: a long clip does not fit in memory
    for i, shown in enumerate(_with_tissue(sequence)):
        if not shown:
            last = []
            continue
        last = [*last[-2:], frame(i)[:, static].astype(np.float64)]
        if len(last) == 3:
            squares[i - 1] = float(np.square(last[0] - 2 * last[1] + last[2]).mean() / 6)
    held_out = [squares[int(i)] for i in sequence.test_index if int(i) in squares]
    inside = float(np.sqrt(np.mean(held_out)) * LEVELS) if held_out else None
    return {"label": label, "all_frames": float(np.sqrt(np.mean(list(squares.values()))) * LEVELS), "held_out": inside}


def _with_tissue(sequence: Sequence) -> BoolArray:
    """(n,) bool: the frames that show tissue."""
    return np.asarray(sequence.masks.any(axis=(1, 2)))


def static_pixels(sequence: Sequence) -> BoolArray:
    """(H, W) bool: tissue in every frame that shows any, with small optical flow between successive ones of them."""
    from endotsr.clips.opencv.flow import dense_flow

    shown = _with_tissue(sequence)
    pairs = np.flatnonzero(shown[:-1] & shown[1:])
    lengths = np.stack([np.hypot(*dense_flow(sequence.images[i], sequence.images[i + 1])) for i in pairs])
    middle, high = np.quantile(lengths, (0.5, 0.9), axis=0)
    return sequence.masks[shown].all(axis=0) & (middle <= STATIC) & (high <= STATIC_HIGH)
