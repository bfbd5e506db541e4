"""The picture of docs/guides/simulate.md, made by `python docs/pages/simulate.py`: the named scenes, one a row."""

from pathlib import Path

import msgspec
import numpy as np

from endotsr.opencv import write_png
from endotsr.simulator.frames import make_scene, simulated_frames
from endotsr.simulator.scenes import SCENES, named_scene

PICTURE = Path(__file__).parents[1] / "results" / "simulated_scenes.png"
SIZE = {"width": 120, "height": 96, "frames": 3}


def row(name: str) -> np.ndarray:
    """The frames of a scene side by side, (H, W, 3)."""
    settings = msgspec.structs.replace(named_scene(name), **SIZE)
    frames = [frame.image.transpose(1, 2, 0) for frame in simulated_frames(make_scene(settings))]
    return np.concatenate(frames, axis=1)


if __name__ == "__main__":
    write_png(PICTURE, np.concatenate([row(name) for name in SCENES]))
