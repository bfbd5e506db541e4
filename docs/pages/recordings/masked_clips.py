"""Pictures of clips with their true masks, and the quality of found masks against them."""

from pathlib import Path

import numpy as np

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.clip import Picture
from endotsr.clips.simulator.frames import SimulatedFrame, make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene
from endotsr.config import with_settings
from endotsr.method.kernels.arrays import BoolArray

SIZE = {"width": 640, "height": 512, "frames": 60}  # of the clips of docs/guides/masks.md
MARGIN = 2


def scene_frames(name: str, **size: int) -> list[SimulatedFrame]:
    """Frames of a named scene; a moving camera gets an instrument."""
    changes = {"instrument": {"on": True}} if name == "moving-camera" else {}
    return list(simulated_frames(make_scene(with_settings(named_scene(name), **size, **changes))))


def pictures_of(frames: list[SimulatedFrame]) -> list[Picture]:
    """Pictures (H, W, 3)."""
    return [frame.image.transpose(1, 2, 0) for frame in frames]


def simulated(name: str, **size: int) -> tuple[list[Picture], list[BoolArray]]:
    """Pictures and exact masks of a scene, margin included."""
    frames = scene_frames(name, **size)
    return pictures_of(frames), [frame.excluded for frame in frames]


def real(folder: Path) -> tuple[list[Picture], list[BoolArray]]:
    """Pictures and `gt_masks` of a folder in the layout of EndoNeRF."""
    pictures, masks = (
        [read_png(file) for file in sorted((folder / name).iterdir())] for name in ("images", "gt_masks")
    )
    return pictures, [(plane if plane.ndim == 2 else plane[..., 0]) > 127 for plane in masks]


def quality(thin: list[BoolArray], wide: list[BoolArray], truth: list[BoolArray]) -> dict[str, float]:
    """Mean and least intersection over union without a margin; recall and lost tissue of all pixels with one."""
    overlaps = [np.count_nonzero(a & t) / max(np.count_nonzero(a | t), 1) for a, t in zip(thin, truth) if t.any()]
    instrument = sum(np.count_nonzero(t) for t in truth)
    found = sum(np.count_nonzero(a & t) for a, t in zip(wide, truth))
    lost = sum(np.count_nonzero(a & ~t) for a, t in zip(wide, truth))
    tissue = sum(t.size for t in truth) - instrument
    return {"iou": float(np.mean(overlaps)), "least_iou": min(overlaps), "recall": found / instrument,
            "lost": lost / tissue}  # fmt: skip
