"""The picture and the times of docs/guides/simulate.md.

    python docs/make.py recordings.simulate            the picture of the named scenes, one per row, and the table
    python docs/make.py recordings.simulate measure    measure the time of a frame of each scene first

Time is processor time on one core, for a frame with its right picture and its truth, files included. It is the median
of `FRAMES` frames from the middle of the clip, where every effect of a scene has started.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from endotsr.clips.opencv.png import write_png
from endotsr.clips.simulator.folder import write_sequence
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import SCENES, named_scene
from pages.store.program import RESULTS, Program
from pages.store.tables import noted, where_with_cores

SIZE = {"width": 120, "height": 96, "frames": 3}
FRAMES = 16


def row(name: str) -> np.ndarray:
    """The frames of a scene side by side, (H, W, 3)."""
    frames = simulated_frames(make_scene(msgspec.structs.replace(named_scene(name), **SIZE)))
    return np.concatenate([frame.image.transpose(1, 2, 0) for frame in frames], axis=1)


def draw(result: dict[str, Any]) -> None:
    """The picture."""
    write_png(RESULTS / "simulated_scenes.png", np.concatenate([row(name) for name in SCENES]))


def times(options: argparse.Namespace) -> dict[str, Any]:
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
    note = f"Processor time on one core, right picture, truth and files included ({where_with_cores(result)})."
    return noted(("Scene", "A frame of 640x512"), rows, note)


PROGRAM = Program(__name__, "guides/simulate.md", {"times": table}, "simulate.json", times, draw=draw)
