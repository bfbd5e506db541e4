"""The picture and the times of docs/guides/simulate.md.

    python docs/make.py recordings.simulate          the named scenes, one per row
    python docs/make.py recordings.simulate times    measure the time of a frame of each scene, and write the table

Time is processor time on one core, for a frame with its right picture and its truth, files included. It is the median
of `FRAMES` frames from the middle of the clip, where every effect of a scene has started.
"""

import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from endotsr.clips.opencv import write_png
from endotsr.clips.simulator.folder import write_sequence
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import SCENES, named_scene
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import dated
from pages.effects.parts import machine
from pages.store.marks import write_marked

DOCS = Path(__file__).parents[2]
PAGE, FILE, PICTURE = DOCS / "guides" / "simulate.md", DOCS / "results" / "simulate.json", "simulated_scenes.png"
SIZE = {"width": 120, "height": 96, "frames": 3}
FRAMES = 16


def row(name: str) -> np.ndarray:
    """The frames of a scene side by side, (H, W, 3)."""
    settings = msgspec.structs.replace(named_scene(name), **SIZE)
    frames = [frame.image.transpose(1, 2, 0) for frame in simulated_frames(make_scene(settings))]
    return np.concatenate(frames, axis=1)


def times() -> dict[str, Any]:
    """Seconds of processor time per frame of every named scene at full size, and the time before the first frame."""
    return {"frames": FRAMES, "scenes": {name: _seconds(name) for name in SCENES}}


def _seconds(name: str) -> dict[str, float]:
    settings = msgspec.structs.replace(named_scene(name), frames=FRAMES)
    stamps = [time.process_time()]
    with tempfile.TemporaryDirectory() as folder:
        write_sequence(Path(folder), settings, name, lambda: stamps.append(time.process_time()))
    steps = np.diff(stamps)
    return {"frame": statistics.median(steps[FRAMES // 2 :]), "start": float(steps[0])}


def table(result: dict[str, Any]) -> str:
    """Seconds per frame by scene."""
    rows = [(f"`{name}`", f"{x['frame']:.2f} s") for name, x in result["scenes"].items()]
    note = f"Processor time on one core, right picture, truth and files included ({machine(result)})."
    return f"{markdown(('Scene', 'A frame of 640x512'), rows)}\n\n{note}"


def main(words: list[str]) -> None:
    """The times with the word `times`, else the picture."""
    if words == ["times"]:
        measured = dated(times())
        write_json(FILE, measured)
        write_marked(PAGE, {"times": table(measured)}, "simulate")
    elif not words:
        write_png(DOCS / "results" / PICTURE, np.concatenate([row(name) for name in SCENES]))
    else:
        sys.exit(__doc__)
