"""The table that compares the presets with recorded texture with interpolation, with one frame missing.

The records are those of `full_size.record` and `full_size.network`. A difference is paired by frame and has a 95 %
interval over the frames; values of several seeds are averaged before.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pages.full_size import record
from pages.store.commands import loaded
from pages.store.intervals import shown
from pages.store.program import RESULTS, Program
from pages.store.tables import noted

Values = NDArray[np.float64]  # by held-out frame
CLIPS = {"pulling": "endonerf_pulling", "cutting": "endonerf_cutting"}
PRESETS = ("quick", "sharp")
AGAINST = {"two_neighbours": "blend", "flow_interpolation": "flow", "flow_interpolation_tissue": "flow, tissue only",
           "network": "RIFE"}  # fmt: skip
LABELS = AGAINST.values()
METRICS = {"psnr_tissue": 2, "lpips": 4}  # with digits
HEADS = {"psnr_tissue": "dB", "lpips": "LPIPS"}


def runs_of(clip: str, preset: str) -> list[dict[str, Any]]:
    """The recorded seeds of a preset whose evaluation has the row."""
    found = record.stored(clip).items()
    return [run for name, run in found if f"_{preset}_seed" in name and "recorded_texture" in run]


def by_frame(runs: list[dict[str, Any]], key: str, metric: str) -> Values:
    """A metric of every held-out frame, mean over the runs; key of the prediction in metrics.json."""
    return np.array([[row[metric] for row in run[key]["per_frame"]] for run in runs]).mean(axis=0)


def without_model(clip: str, name: str, metric: str) -> Values:
    """A metric of every held-out frame of a prediction without a model of the clip."""
    stored = loaded(RESULTS / ("network.json" if name == "network" else "interpolation.json"))
    return np.array(stored["clips"][CLIPS[clip]]["every eighth frame"]["baselines"][name][metric])


def difference(clip: str, preset: str, name: str, metric: str) -> Values:
    """The preset with recorded texture minus a prediction, by held-out frame."""
    return by_frame(runs_of(clip, preset), "recorded_texture", metric) - without_model(clip, name, metric)


def rows() -> list[list[str]]:
    """One row for every clip, preset and metric."""
    found = []
    for clip in CLIPS:
        for preset in PRESETS:
            runs = runs_of(clip, preset)
            for metric, digits in METRICS.items() if runs else ():
                levels = [by_frame(runs, key, metric).mean() for key in ("held_out", "recorded_texture")]
                against = [shown(difference(clip, preset, name, metric), digits, "+") for name in AGAINST]
                about = [f"{clip}, `{preset}`, {HEADS[metric]}", str(len(runs))]
                found.append([*about, *(f"{level:.{digits}f}" for level in levels), *against])
    return found


def table() -> str:
    """The table with its caption."""
    heads = ("One frame missing", "Seeds", "Render", "With recorded texture", *(f"- {name}" for name in LABELS))
    about = (
        "640x512, every eighth frame held out; dB is PSNR of the tissue, and a lower LPIPS is better. The last columns "
        "are differences of *with recorded texture*, paired by frame, with 95 % intervals over the frames. Blend, flow "
        "and RIFE read the instruments of the neighbours; the texture and *tissue only* read no excluded colour."
    )
    return noted(heads, rows(), about)


PROGRAM = Program(__name__, ("../README.md", "interpolation.md"), {"table": table}, room="texture")
