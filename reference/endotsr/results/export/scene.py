"""A scene to render, opened from a run folder, a slim model, or a 3DGS ply file.

The scene of a ply file is static; its camera looks along z at the Gaussians.
"""

from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from pathlib import Path

import numpy as np

from endotsr.clips.sequences.record import SequenceRecord, nearest_frame, recorded
from endotsr.config import PAPER, ModelConfig, with_settings
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut, Scene
from endotsr.results.export.model import load_slim_model
from endotsr.results.export.placement import HERE, Placement, placement_of
from endotsr.results.export.ply import read_gaussians_noted
from endotsr.training.fitting.model import corrected_cameras, render_at, scene_at, spectral_from, without
from endotsr.training.runs.files import OF_A_RUN
from endotsr.training.runs.folder import RunFolder, open_run
from endotsr.training.runs.model import Model, load_model
from endotsr.training.runs.no_run import why_no_run
from endotsr.training.scene.gaussians import Gaussians
from endotsr.untrusted.names import choice

FOCAL = 1.2  # focal length of the facing camera, picture widths
MARGIN = 1.1  # width of its picture relative to the extent of the Gaussians
SIDE = 512  # side of its picture, pixels
NEAR = 0.01  # near plane relative to the distance of the camera
STILL = ModelConfig(appearance=False, spectral_motion=False, deformation=False)
COMPONENTS = ("appearance", "spectral_motion")


@dataclass(frozen=True)
class MovingScene:
    """The record of a sequence (sequence.json) and its model; the model of a run folder is loaded on first use."""

    record: SequenceRecord
    loaded: Model | None = None
    folder: RunFolder | None = None
    one_time: bool = False  # from a ply file, whose coordinates are kept
    notes: tuple[str, ...] = ()  # on parts of the file that are not used

    @cached_property
    def model(self) -> Model:
        """The model. Raises: InputError if the run has no usable checkpoint."""
        if self.loaded is not None:
            return self.loaded
        assert self.folder is not None
        return load_model(self.folder)

    @cached_property
    def cameras(self) -> list[Camera]:
        """The cameras of the frames, with the model's pose correction."""
        return corrected_cameras(self.model.frames, self.record.frame_cameras, self.record.times)

    @property
    def placement(self) -> Placement:
        """The transformation from training to export coordinates; the coordinates of a ply file are kept."""
        return HERE if self.one_time else placement_of(self.cameras[0])

    def render(self, time: float, camera: Camera, taken_out: tuple[str, ...] = ()) -> RenderOut:
        """Render at a time in [0, 1]; `taken_out` names spectral components to leave out."""
        model = self.model
        gaussians = self._kept(taken_out)
        return render_at(gaussians, model.spectral, model.config, camera, time, frames=model.frames)

    def picture(self, time: float, camera: Camera | int | None, taken_out: tuple[str, ...]) -> RenderOut:
        """As `render`, with checked arguments. `camera` can also be a frame number, or None for the nearest frame.

        Raises: InputError for a time, frame or component that does not exist.
        """
        if not 0.0 <= time <= 1.0:
            raise InputError(f"render: time = {time!r} is not allowed; use a number in [0, 1]")
        for name in taken_out:
            if name not in COMPONENTS:
                raise InputError(f"render: without = {name!r} is not allowed; use {choice(COMPONENTS)}")
        if not isinstance(camera, Camera):
            frame, last = nearest_frame(self.record.times, time) if camera is None else camera, self.record.count - 1
            if not isinstance(frame, Integral) or not 0 <= int(frame) <= last:
                allowed = f"a Camera, or a frame from 0 to {last}"
                raise InputError(f"render: camera = {camera!r} is not allowed; use {allowed}")
            camera = self.cameras[int(frame)]
        return self.render(float(time), camera, taken_out)

    def at(self, time: float, taken_out: tuple[str, ...] = ()) -> Scene:
        """The deformed Gaussians at a time, without the exposure of a frame."""
        model = self.model
        return scene_at(self._kept(taken_out), model.spectral, model.config.model, time)[0]

    def _kept(self, taken_out: tuple[str, ...]) -> Gaussians:
        appearance, motion = (name not in taken_out for name in COMPONENTS)
        return without(self.model.gaussians, appearance=appearance, spectral_motion=motion)


def open_scene(path: Path) -> MovingScene:
    """A scene to render. Raises: InputError if `path` has none, or if a file is damaged."""
    path = Path(path)
    if path.suffix.lower() == ".ply" and not path.is_dir():
        return _from_ply(path)
    if path.suffix.lower() == ".npz" and path.name not in OF_A_RUN and not path.is_dir():
        slim = load_slim_model(path)
        return MovingScene(slim.record, slim.model)
    if path.is_file():
        raise InputError(
            f"{path}: {why_no_run(path)}; a scene is a run folder, a slim model (.npz) or a 3DGS file (.ply)"
        )
    folder = open_run(path)
    return MovingScene(folder.sequence_record(), folder=folder)


def _from_ply(path: Path) -> MovingScene:
    gaussians, notes = read_gaussians_noted(path)
    camera = facing_camera(gaussians.position, SIDE)
    distance = float(camera.translation[2] + np.median(gaussians.position[2]))
    model = with_settings(STILL, harmonics_degree=round(len(gaussians.harmonics) ** 0.5) - 1)
    config = with_settings(PAPER, model=model, raster={"near": NEAR * distance})
    record = SequenceRecord(
        unit="scene units", largest_depth=2 * distance, static_camera=True, names=[path.stem], times=[0.0],
        train_index=[0], test_index=[0], cameras=recorded([camera]),
    )  # fmt: skip
    return MovingScene(
        record, Model(gaussians, spectral_from(model, np.zeros(1)), config, 0), one_time=True, notes=tuple(notes)
    )


def facing_camera(position: FloatArray, side: int) -> Camera:
    """A camera looking along +z at the positions.

    Those between the quantiles 0.02 and 0.98 of every axis are in the picture.
    """
    low, high = np.quantile(position.astype(np.float64), [0.02, 0.98], axis=1)
    reach = max(float((high - low)[:2].max()) / 2, 1e-6)
    distance = MARGIN * 2 * FOCAL * reach + float(high[2] - low[2]) / 2
    translation = -(low + high) / 2 + np.array([0, 0, distance])
    return Camera(np.eye(3), translation, FOCAL * side, FOCAL * side, side / 2, side / 2, side, side)
