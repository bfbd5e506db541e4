"""Measurements beside the held-out pictures, each made only when it is asked for, since each renders many views.

depth        rendered depth of the held-out frames against the prior, beside predictions without a model
flicker      change of resting tissue from frame to frame, beside that of the recorded frames
right_view   the view of a right camera against the real right picture, beside the moved left picture

In: a model, its sequence, and the source of the sequence. Out: plain values for metrics.json, under the name of the
measurement. One that the sequence does not allow is {"reason": ...}.
"""

from collections.abc import Callable, Iterable
from typing import Any

from endotsr.errors import InputError
from endotsr.evaluation.depth import held_out_depth
from endotsr.evaluation.flicker import flicker
from endotsr.evaluation.right_view import right_view
from endotsr.fitting.model import render_at, with_corrected_cameras
from endotsr.runs.model import Model
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.camera import Camera
from endotsr.splatting.render import RenderOut

RenderView = Callable[[int, Camera], RenderOut]  # frame, whose time it is, and camera

MEASURES: dict[str, Callable[[Model, Sequence, str, RenderView], dict[str, Any]]] = {
    "depth": lambda model, sequence, source, render: held_out_depth(sequence, render),
    "flicker": lambda model, sequence, source, render: flicker(sequence, render),
    "right_view": lambda model, sequence, source, render: right_view(sequence, source, model.config.sequence, render),
}


def check_measures(names: Iterable[str], what: str = "measure") -> None:
    """Raises InputError for a name that is not in MEASURES; the message begins with `what`."""
    for name in names:
        if name not in MEASURES:
            raise InputError(f"{what} {name!r} is not allowed; allowed: {', '.join(MEASURES)}")


def measured(names: Iterable[str], model: Model, sequence: Sequence, source: str) -> dict[str, dict[str, Any]]:
    """The named measurements of a model.

    source   folder of the sequence, or `simulated`
    Raises:  InputError for a name that is not in MEASURES, and for a right picture that cannot be read.
    """
    names = list(names)
    check_measures(names)
    seen = with_corrected_cameras(sequence, model.frames)

    def render(index: int, camera: Camera) -> RenderOut:
        time = float(seen.times[index])
        return render_at(model.gaussians, model.spectral, model.config, camera, time, frames=model.frames)

    return {name: MEASURES[name](model, seen, source, render) for name in names}


def measure_lines(found: dict[str, dict[str, Any]]) -> list[str]:
    """The measurements as lines of text for the terminal."""
    lines = []
    for name, entry in found.items():
        if "reason" in entry:
            lines.append(f"{name}: not measured: {entry['reason']}")
            continue
        for row in entry["rows"]:
            values = ", ".join(f"{key} {value:.4g}" for key, value in row.items() if isinstance(value, float))
            lines.append(f"{name}: {row['label']}: {values}")
    return lines
