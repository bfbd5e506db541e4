"""The table that compares the presets with recorded texture with interpolation, with one frame missing.

The records are those of `full_size.record` and `full_size.network`. A difference is paired by frame and has a 95 %
interval over the frames; values of several seeds are averaged before.
"""

from typing import Any

from pages.book.readme_gaps import BLEND, FLOW, RIFE, TISSUE, Values, by_frame, held_out_frames, prediction
from pages.full_size import record
from pages.full_size.record import EVERY_EIGHTH
from pages.store.intervals import shown
from pages.store.program import Program
from pages.store.tables import noted

TEXTURE = "recorded_texture"
CLIPS = {"pulling": "endonerf_pulling", "cutting": "endonerf_cutting"}
PRESETS = ("quick", "sharp")
AGAINST = {BLEND: "blend", FLOW: "flow", TISSUE: "flow, tissue only", RIFE: "RIFE"}
METRICS = {"psnr_tissue": 2, "lpips": 4}  # with digits
HEADS = {"psnr_tissue": "dB", "lpips": "LPIPS"}


def runs_of(clip: str, preset: str) -> list[dict[str, Any]]:
    """The recorded seeds of a preset whose evaluation has the row."""
    found = record.stored(clip).items()
    return [run for name, run in found if f"_{preset}_seed" in name and TEXTURE in run]


def difference(clip: str, preset: str, name: str, metric: str) -> Values:
    """The preset with recorded texture minus a prediction, by held-out frame."""
    runs = runs_of(clip, preset)
    without = prediction(CLIPS[clip], EVERY_EIGHTH, name, metric, held_out_frames(runs))
    return by_frame(runs, TEXTURE, metric) - without


def rows() -> list[list[str]]:
    """One row for every clip, preset and metric."""
    found = []
    for clip in CLIPS:
        for preset in PRESETS:
            runs = runs_of(clip, preset)
            for metric, digits in METRICS.items() if runs else ():
                levels = [by_frame(runs, of, metric).mean() for of in ("", TEXTURE)]
                against = [shown(difference(clip, preset, name, metric), digits, "+") for name in AGAINST]
                about = [f"{clip}, `{preset}`, {HEADS[metric]}", str(len(runs))]
                found.append([*about, *(f"{level:.{digits}f}" for level in levels), *against])
    return found


def table() -> str:
    """The table with its caption."""
    heads = ("One frame missing", "Seeds", "Render", "With recorded texture",
             *(f"- {name}" for name in AGAINST.values()))  # fmt: skip
    about = (
        "640x512, every eighth frame held out; dB is PSNR of the tissue, and a lower LPIPS is better. The last columns "
        "are differences of *with recorded texture*, paired by frame, with 95 % intervals over the frames. Blend, flow "
        "and RIFE read the instruments of the neighbours; the texture and *tissue only* read no excluded colour."
    )
    return noted(heads, rows(), about)


PROGRAM = Program(__name__, ("../README.md", "interpolation.md"), {"table": table}, room="texture")
