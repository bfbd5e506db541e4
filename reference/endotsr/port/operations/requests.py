"""Conversion of requests, arrays and settings by name, to the structures of the package.

A setting with a leading underscore is not part of a case: `_compositor` selects one of the two compositors of the
reference, whose results must agree.
"""

from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config, InitialisationConfig, ModelConfig, config_from_dict, without_former_keys
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.fast import blocks as compositing_blocks
from endotsr.method.splatting.render import Compositor, Scene
from endotsr.method.splatting.settings import LegacyDeviations, RasterSettings
from endotsr.port.operations.operation import Inputs, Settings
from endotsr.training.fitting.model import Spectral, spectral_from
from endotsr.training.scene.gaussians import Gaussians
from endotsr.untrusted.names import choice

COMPOSITORS: tuple[Compositor, ...] = ("definition", "blocks")


def raster_of(settings: Settings) -> RasterSettings:
    """The rasteriser settings of a case."""
    fields = dict(settings["raster"])
    fields["deviations"] = LegacyDeviations(**fields["deviations"])
    return RasterSettings(**fields)


def raster_dict(raster: RasterSettings) -> dict:
    """The rasteriser settings as settings of a case."""
    return raster._asdict() | {"deviations": raster.deviations._asdict()}


def camera_of(inputs: Inputs, settings: Settings) -> Camera:
    """Pose from the inputs, lens from the settings."""
    return Camera(inputs["rotation_matrix"], inputs["translation"], **settings["camera"])


def compositor_of(settings: Settings) -> Compositor:
    """The compositor of a request; both give the same result up to rounding.

    `blocks` is used only if it supports these settings.
    Raises: ValueError for any other name.
    """
    asked = settings.get("_compositor", "definition")
    if asked not in COMPOSITORS:
        raise ValueError(f"_compositor: {asked!r} is not known; use {choice(COMPOSITORS)}")
    return "blocks" if asked == "blocks" and compositing_blocks.supports(raster_of(settings)) else "definition"


def scene_of(inputs: Inputs) -> Scene:
    """Deformed raw parameters of a request."""
    return Scene(*(inputs.get(name) for name in Scene._fields))  # type: ignore[arg-type]


def gaussians_of(inputs: Inputs) -> Gaussians:
    """Raw parameters of a request; a component with missing arrays is off."""
    return Gaussians(*(inputs.get(name) for name in Gaussians._fields))  # type: ignore[arg-type]


def model_of(settings: Settings) -> ModelConfig:
    """The model settings of a case."""
    return msgspec.convert(settings["model"], ModelConfig)


def spectral_of(inputs: Inputs, settings: Settings) -> Spectral:
    """Frequencies, statistics and weights of a request."""
    return spectral_from(model_of(settings), inputs["times"][inputs["train_index"]].astype(np.float64))


def config_of(settings: Settings, dtype: np.dtype) -> Config:
    """The complete configuration of a training case, in the precision of the request."""
    data: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(settings["config"]))
    data["training"]["precision"] = np.dtype(dtype).name
    return config_from_dict(data, "golden case")


def initialisation_of(settings: Settings) -> InitialisationConfig:
    """The settings of the initialisation of a case."""
    name = "initialisation"
    return msgspec.convert(without_former_keys({name: settings[name]}, "golden case")[name], InitialisationConfig)


def sequence_of(inputs: Inputs, lens: dict[str, float]) -> Sequence:
    """The frames of a request; without stamps, frame k of n is at k / n."""
    poses = zip(inputs["rotation_matrices"], inputs["translations"])
    count = len(inputs["images"])
    train = inputs["train_index"].astype(np.intp)
    return Sequence(
        images=inputs["images"].astype(np.uint8),
        masks=inputs["masks"],
        depth=inputs["prior_depths"].astype(np.float32),
        times=np.asarray(inputs.get("times", np.arange(count) / count), np.float64),
        cameras=[Camera(r.astype(np.float64), d.astype(np.float64), **lens) for r, d in poses],  # type: ignore[arg-type]
        names=[str(k) for k in range(count)],
        unit="scene unit",
        static_camera=False,
        train_index=train,
        test_index=np.setdiff1d(np.arange(count), train),
    )


class Tape:
    """A substitute for the random generator of a run: returns frames and split noise of the inputs, in order."""

    def __init__(self, frames: NDArray, noise: NDArray) -> None:
        self.frames, self.noise = list(map(int, frames)), noise
        self.bit_generator = self  # the trainer records the state of its generator before an iteration

    @property
    def state(self) -> dict[str, list[int]]:
        """The remaining frames."""
        return {"frames": list(self.frames)}

    def integers(self, high: int) -> int:
        """The next frame, as a position within the training frames."""
        frame = self.frames.pop(0)
        if not 0 <= frame < high:
            raise ValueError(f"frame {frame} of {high}")
        return frame

    def standard_normal(self, shape: tuple[int, int, int]) -> NDArray:
        """[child, axis, Gaussian]: the first columns of the noise."""
        return np.ascontiguousarray(self.noise[:, :, : shape[2]], np.float64)
