"""The running clip of the book: one held-out frame at full size, its two neighbours, and the trained scene at its time.

The clip is simulated, 63 frames of 640x512; the scene is the preset `quick` after its whole training. The files beside
this module are written by `python docs/make.py book.running_scene RUN`.
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from endotsr.config import Config, config_from_dict
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import Scene
from endotsr.training.fitting.model import Spectral, spectral_from
from endotsr.training.scene.gaussians import Gaussians

FOLDER = Path(__file__).parent


class RunningClip(NamedTuple):
    """A frame, the scene that renders it, and some Gaussians with all their parameters."""

    image: NDArray[np.float64]  # (3, H, W) the held-out frame, [0, 1]
    before: NDArray[np.float64]  # (3, H, W) the training frame before it
    after: NDArray[np.float64]  # (3, H, W) the training frame after it
    mask: NDArray[np.bool_]  # (H, W) True is tissue
    depth: NDArray[np.float64]  # (H, W) prior depth, scene units
    camera: Camera
    time: float  # of the held-out frame, normalised
    train_times: NDArray[np.float64]  # (n,) of the training frames
    scene: Scene  # (N) all Gaussians in view at `time`, front to back, with the colours that the camera sees: degree 0
    gaussians: Gaussians  # (M) all parameters of the Gaussians around `pixel`
    spectral: Spectral  # of the Fourier components of `gaussians`
    config: Config  # the settings of the training
    pixel: tuple[
        int, int
    ]  # column and row of the largest error in the block of 16x16 pixels where the model is worst
    about: dict[str, Any]  # frame number, seed, iterations and date of the run


def picture(name: str) -> NDArray[np.float64]:
    """A stored frame, (3, H, W) in [0, 1]."""
    return np.asarray(Image.open(FOLDER / f"{name}.webp")).transpose(2, 0, 1) / 255


def load() -> RunningClip:
    """The running clip from its files; float32 parameters, as they were trained."""
    about = json.loads((FOLDER / "about.json").read_text(encoding="utf-8"))
    with np.load(FOLDER / "view.npz") as stored:
        view = dict(stored)
    with np.load(FOLDER / "gaussians.npz") as stored:
        gaussians = Gaussians(**stored)
    config = config_from_dict(about.pop("config"))
    scene = Scene(*(view[name] for name in Scene._fields[:5]))
    camera = Camera(
        view["rotation"], view["translation"], *map(float, view["pinhole"]), *about.pop("size")
    )
    return RunningClip(
        *map(picture, ("frame", "before", "after")),
        mask=view["mask"],
        depth=view["depth"].astype(np.float64),
        camera=camera,
        time=float(view["time"]),
        train_times=view["train_times"],
        scene=scene,
        gaussians=gaussians,
        spectral=spectral_from(config.model, view["train_times"]),
        config=config,
        pixel=tuple(about.pop("pixel")),
        about=about,
    )
