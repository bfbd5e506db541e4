"""Warm start: the initial state of a window, carried over from its neighbour at a shared frame.

The join is the shared training frame nearest the middle of the overlap. Its time is t* in the neighbour and u* in this
window. The neighbour's Gaussians, deformed to t*, become the canonical Gaussians of this window:

    mu = mu_n(t*) - C phi(u*)      q = q_n(t*)      s = s_n(t*)      h_0 = h_0,n + beta tanh(A_n phi_bar(t*)) / Y00

C is fitted to the tracks of the tissue at the Gaussians, as in (B15); it is 0 where the settings start without motion.
The FDM weights and A are 0. At the join both models render the same picture up to rounding, as far as no Gaussian is
dropped or added.

In: the neighbour's run folder and the sequence of this window. Out: a training state.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from endotsr.clips.flow.tracks import follow
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config, with_settings
from endotsr.errors import InputError
from endotsr.method.equations.dictionary import dictionary_forward
from endotsr.method.equations.motion import motion_forward
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.gather import gather_columns
from endotsr.method.splatting.camera import Camera, backproject, project
from endotsr.method.splatting.render import render_forward
from endotsr.training.fitting.model import Spectral, raster_settings, scene_at, spectral_from
from endotsr.training.fitting.schedules import residuals_active
from endotsr.training.fitting.state import fresh_state
from endotsr.training.runs.records import StartPart
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.training.scene.initialisation import activate_residuals, gaussians_at, gaussians_of, training_points
from endotsr.training.scene.parameters import FrameParameters, frame_parameters
from endotsr.training.scene.tracked_motion import with_tracked_motion

if TYPE_CHECKING:
    from endotsr.training.fitting.state import TrainingState
    from endotsr.training.runs.model import Model

COVERED = 0.5  # minimum opacity of a covered pixel; Gaussians are added at the others
MARGIN = 0.1  # fraction of the picture's sides; Gaussians farther outside every training frame are dropped
CARRIED = 0.8  # fraction of `density.maximum`: the most Gaussians carried; the rest is left for densification
CAMERA_TOLERANCE = 1e-3  # fraction of the median depth: largest difference of a shared frame's camera position


class CarriedStart(NamedTuple):
    """The warm start of a window; a `Beginning` of a job."""

    folder: str  # run folder of the neighbour
    shift: int  # frame i of this window is frame i + shift of the neighbour
    shared: int  # number of shared frames, the first of this window
    saved: int  # iterations saved compared with a cold start

    def about(self) -> StartPart:
        """The entry `start` of run.json."""
        return {"carried_from": Path(self.folder).name, "shared_frames": self.shared, "iterations_saved": self.saved}

    def state(self, sequence: Sequence, config: Config) -> "TrainingState":
        """The state. Raises InputError if the neighbour has no usable checkpoint or another world origin."""
        from endotsr.training.runs.folder import open_run
        from endotsr.training.runs.model import load_model

        folder = open_run(Path(self.folder))
        record = folder.sequence_record()
        _refuse_other_world(sequence, record.frame_cameras[self.shift], self.folder)
        weight = folder.record().get("lambda_lap")
        return carried_state(
            Neighbour(load_model(folder), record.times, self.shift, self.shared, weight), sequence, config
        )


class Neighbour(NamedTuple):
    """A trained neighbour; `shift` and `shared` as in `CarriedStart`."""

    model: "Model"
    times: list[float]  # of all its frames
    shift: int
    shared: int
    lambda_lap: float | None  # calibrated weight of equation (7), reused

    def join(self, sequence: Sequence) -> int:
        """Index of the join among the training frames of the window."""
        shared = sequence.train_index[sequence.train_index < self.shared]
        if not shared.size:
            raise InputError("windows: the overlap contains no training frame; use a larger --overlap")
        return int(np.abs(shared - (self.shared - 1) / 2).argmin())


def carried_state(neighbour: Neighbour, sequence: Sequence, config: Config) -> "TrainingState":
    """The state of a window before its first iteration.

    Gaussians outside every training frame are dropped. If more than 0.8 `density.maximum` remain, the least opaque are
    dropped too. At tissue pixels with rendered opacity below 0.5, points are drawn as at a cold start. Their number in
    the first training frame is proportional to the uncovered fraction, and all are bounded by `density.maximum`. Adam's
    moments are 0. Exposures and poses are the neighbour's, constant beyond its last frame.
    """
    rng, dtype = np.random.default_rng(config.training.seed), np.dtype(config.training.precision)
    place = neighbour.join(sequence)
    gaussians = _canonical(neighbour, int(sequence.train_index[place]), config, dtype)
    frames, weight = _frame_parameters(neighbour, sequence, config, dtype), neighbour.lambda_lap
    del neighbour  # frees its arrays before the moments of this window are allocated
    gaussians = _gathered(gaussians, _kept(gaussians, sequence, max(1, int(CARRIED * config.density.maximum))))
    spectral = spectral_from(config.model, sequence.times[sequence.train_index])
    if config.initialisation.motion != "none" and config.model.spectral_motion:
        gaussians = _with_motion(gaussians, sequence, place, spectral)
    fresh = _new_tissue(gaussians, sequence, spectral, config, rng, dtype)
    if fresh is not None:
        gaussians = _joined(gaussians, fresh)
    if residuals_active(1, config):
        model = config.model
        gaussians = activate_residuals(gaussians, model.frequencies, model.appearance, model.spectral_motion)
    weight = weight if config.loss.lambda_lap == "auto" else float(config.loss.lambda_lap)
    return fresh_state(gaussians, frames, rng, lambda_lap=weight)


def _refuse_other_world(sequence: Sequence, camera: Camera, folder: str) -> None:
    """Raises InputError if the camera of the window's first frame differs from the neighbour's."""
    depth = sequence.tissue_depth(0) or 1.0
    if np.abs(sequence.cameras[0].translation - camera.translation).max() > CAMERA_TOLERANCE * depth:
        raise InputError(f"{folder}: its world origin differs from the next window's; use windows that start cold"
                         " (--chain 1), or poses near the origin")  # fmt: skip


def _canonical(neighbour: Neighbour, frame: int, config: Config, dtype: Any) -> Gaussians:
    """The neighbour's Gaussians at the join, as static Gaussians."""
    model = neighbour.model
    scene, _ = scene_at(model.gaussians, model.spectral, model.config.model, neighbour.times[frame + neighbour.shift])
    harmonics = scene.harmonics.copy()
    if scene.residual is not None:
        harmonics[0] += scene.residual  # (21.4)
    start = gaussians_at(scene.position.astype(np.float64), np.zeros((3, model.gaussians.count)), config.model, dtype)
    return start._replace(
        position=np.ascontiguousarray(scene.position, dtype),
        quaternion=np.ascontiguousarray(scene.quaternion, dtype),
        log_scale=np.ascontiguousarray(scene.log_scale, dtype),
        opacity_logit=scene.opacity_logit.copy(),
        harmonics=harmonics,
    )


def _kept(gaussians: Gaussians, sequence: Sequence, most: int) -> BoolArray:
    """(N,) True for the `most` opaque Gaussians among those with a centre in or near some training frame."""
    seen = np.zeros(gaussians.count, bool)
    for camera in {id(c): c for c in (sequence.cameras[i] for i in sequence.train_index)}.values():
        u, v, depth = project(camera, gaussians.position)
        x, y = MARGIN * camera.width, MARGIN * camera.height
        inside = (u >= -x) & (u <= camera.width + x) & (v >= -y) & (v <= camera.height + y)
        seen |= (depth > 0) & inside
    if np.count_nonzero(seen) > most:
        places = np.flatnonzero(seen)
        faint = np.argsort(-gaussians.opacity_logit[places], kind="stable")[most:]
        seen[places[faint]] = False
    return seen


def _gathered(gaussians: Gaussians, kept: BoolArray) -> Gaussians:
    source = np.flatnonzero(kept)
    return gaussians._replace(**{k: gather_columns(a, source, source.size) for k, a in arrays(gaussians).items()})


def _with_motion(gaussians: Gaussians, sequence: Sequence, place: int, spectral: Spectral) -> Gaussians:
    """The Gaussians with motion coefficients fitted to the tissue tracks; the displacement at the join is 0."""
    frame = int(sequence.train_index[place])
    surface = _surface(gaussians.position.astype(np.float64), sequence, frame)
    tracks = follow(sequence, np.full(gaussians.count, place, np.intp), surface)
    position = tracks.position + (gaussians.position - surface)[None].astype(np.float32)
    times = sequence.times[sequence.train_index].astype(np.float64)
    moving = with_tracked_motion(gaussians, times, position, tracks.followed, spectral.omega, spectral.rho)  # (21.5)
    assert moving.motion_coefficients is not None
    phi = dictionary_forward(float(sequence.times[frame]), spectral.omega)[0].astype(gaussians.position.dtype)
    at_rest = gaussians.position - motion_forward(moving.motion_coefficients, phi)[0]  # (21.5), (21.6)
    return moving._replace(position=at_rest)


def _surface(position: FloatArray, sequence: Sequence, frame: int) -> FloatArray:
    """(3, N) tissue point at the projection of each Gaussian in a frame; the Gaussian's centre where there is none."""
    camera, mask, depth = sequence.cameras[frame], sequence.masks[frame], sequence.depth[frame]
    u, v, z = project(camera, position)
    with np.errstate(invalid="ignore"):
        column, row = (np.clip(np.nan_to_num(x), 0, side - 1).astype(np.intp) for x, side in
                       ((u, camera.width), (v, camera.height)))  # fmt: skip
        inside = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    found = np.where(inside & mask[row, column], depth[row, column], 0.0).astype(np.float64)
    lifted = backproject(camera, column.astype(np.float64), row.astype(np.float64), np.maximum(found, 1e-6))
    return np.where(found > 0, lifted, position)


def _new_tissue(
    gaussians: Gaussians,
    sequence: Sequence,
    spectral: Spectral,
    config: Config,
    rng: np.random.Generator,
    dtype: Any,
) -> Gaussians | None:
    """New Gaussians at tissue that the carried ones do not cover; None if all of it is covered."""
    missing = np.zeros_like(sequence.masks)
    for i in sequence.train_index:
        scene, _ = scene_at(gaussians, spectral, config.model, float(sequence.times[i]))
        rendered, _ = render_forward(scene, sequence.cameras[i], raster_settings(config), degree=0)
        missing[i] = sequence.masks[i] & (rendered.opacity < COVERED)
    fraction, room = missing[sequence.train_index].mean(), config.density.maximum - gaussians.count
    if not fraction or room < 1:
        return None
    wanted = config.initialisation
    first = min(max(1, round(wanted.first_frame_points * fraction)), room)
    others = min(wanted.other_frame_points, room - first)
    wanted = with_settings(wanted, first_frame_points=first, other_frame_points=others)
    try:
        points = training_points(replace(sequence, masks=missing), wanted, rng)
    except InputError:  # no depth where tissue is missing
        return None
    return gaussians_of(sequence, points, wanted, config.model, dtype)


def _joined(first: Gaussians, second: Gaussians) -> Gaussians:
    """The Gaussians of both sets, which have the same arrays."""
    other = arrays(second)
    return first._replace(**{k: np.concatenate([a, other[k]], axis=-1) for k, a in arrays(first).items()})


def _frame_parameters(neighbour: Neighbour, sequence: Sequence, config: Config, dtype: Any) -> FrameParameters | None:
    """Exposures and poses of the window's training frames, interpolated from the neighbour's."""
    found = frame_parameters(config.model, sequence.times[sequence.train_index], dtype)
    known = neighbour.model.frames
    if found is None or known is None:
        return found
    last = len(neighbour.times) - 1
    at = [neighbour.times[min(int(i) + neighbour.shift, last)] for i in sequence.train_index]
    carried = {
        name: np.array([np.interp(at, known.times, row) for row in array], dtype)
        for name, array in known._asdict().items()
        if name != "times" and array is not None
    }
    return found._replace(**carried)
