"""The moving scene: raw Gaussians at time t with every component of the model applied, and its reverse pass.

    mu(t) = mu + psi_mu(t) + C phi(t)       q(t) = q + psi_q(t)       s(t) = s + psi_s(t)
    h_0(t) = h_0 + beta tanh(A phi_bar(t)) / Y00

A component with arrays None is not evaluated and has no gradient array. In: `Gaussians` and a time. Out: the `Scene`
for the rasteriser, or gradients by field name.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config, ModelConfig
from endotsr.method.equations.appearance import AppearanceSaved, appearance_forward, appearance_reverse
from endotsr.method.equations.deformation import DeformationSaved, deformation_forward
from endotsr.method.equations.dictionary import (
    AtomStatistics,
    atom_statistics,
    dictionary_forward,
    frequencies,
    normalised_atoms,
)
from endotsr.method.equations.exposure import ExposureSaved, exposure_forward, exposure_reverse
from endotsr.method.equations.matern import matern_weights
from endotsr.method.equations.motion import MotionSaved, motion_forward, motion_reverse
from endotsr.method.equations.pose import PoseSaved, pose_forward, pose_reverse
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.threads import parallel_calls
from endotsr.method.kernels.timer import NO_TIMER, Timer, timed
from endotsr.method.splatting.camera import Camera, CameraGrads
from endotsr.method.splatting.render import RenderGrads, RenderOut, Scene, check_scene, render_forward
from endotsr.method.splatting.settings import PRESETS, RasterSettings
from endotsr.training.scene.gaussians import LOG_SCALE_CHANNELS, POSITION_CHANNELS, QUATERNION_CHANNELS, Gaussians
from endotsr.training.scene.parameters import Exposure, FrameParameters, Pose, exposure_at, pose_at


class Spectral(NamedTuple):
    """Constants of the Fourier components, fixed by the configuration and the training times."""

    omega: FloatArray  # (F,) float64, cycles per sequence
    statistics: AtomStatistics  # mean and RMS of the atoms over the training times
    rho: FloatArray  # (F,) float64, Matern weights of the penalty, mean 1


class SceneSaved(NamedTuple):
    """Saved tuples of the evaluated components."""

    deformation: DeformationSaved | None
    appearance: AppearanceSaved | None
    motion: MotionSaved | None


class OffsetsAhead(NamedTuple):
    """Offsets of the FDM at a later time, computed with the update of its arrays.

    They are valid until the arrays of the FDM change: `training_step` drops them before its update, and `optimise`
    computes new ones unless density control follows.
    """

    t: float  # normalised time
    offsets: FloatArray  # (10, N)


class SceneGrads(NamedTuple):
    """Gradients with respect to the raw parameters; `d_offsets` is the input of the FDM's reverse pass."""

    by_field: dict[str, FloatArray]  # every field but the three of the FDM
    d_offsets: FloatArray | None  # (10, N)


def spectral_from(model: ModelConfig, train_times: NDArray[np.floating]) -> Spectral:
    """Frequencies, atom statistics over the TRAINING times only, and Matern weights.

    train_times  (n,) normalised times of the training frames
    returns      float64; rounded once, when combined with the coefficients
    """
    omega = frequencies(model.frequencies, model.frequency_min, model.frequency_max, np.float64)
    statistics = atom_statistics(np.asarray(train_times, np.float64), omega)
    return Spectral(omega, statistics, matern_weights(omega, model.correlation_length))


def raster_settings(config: Config) -> RasterSettings:
    """The rasteriser preset of a configuration, with its near plane and all individually set values."""
    raster = config.raster
    given = {name: getattr(raster, name) for name in ("alpha_cutoff", "transmittance_stop", "alpha_max")}
    own = {name: value for name, value in given.items() if value != "preset"}
    return PRESETS[raster.preset]._replace(near=raster.near, **own)


def scene_at(
    gaussians: Gaussians,
    spectral: Spectral,
    model: ModelConfig,
    t: float,
    ahead: OffsetsAhead | None = None,
    timer: Timer = NO_TIMER,
) -> tuple[Scene, SceneSaved]:
    """The Gaussians at time t (normalised; any value is allowed, [0, 1] is the sequence).

    ahead   of `optimise`, for these Gaussians; replaces the forward pass of the FDM at its own time
    timer   records the stages "FDM" and "Fourier"

    Edges: with zero coefficients, a component leaves the scene bitwise unchanged, except that -0 becomes 0.
    Raises: ValueError if `ahead` belongs to another number of Gaussians.
    """
    ((position, quaternion, log_scale), deformation), (translation, motion), (residual, appearance) = parallel_calls(
        timed(timer, "FDM", lambda: _deformed(gaussians, model, t, ahead)),
        timed(timer, "Fourier", lambda: _translation(gaussians, spectral, t)),
        timed(timer, "Fourier", lambda: _residual(gaussians, spectral, model, t)),
    )
    if translation is not None:
        position = position + translation
    scene = Scene(position, quaternion, log_scale, gaussians.opacity_logit, gaussians.harmonics, residual)
    return scene, SceneSaved(deformation, appearance, motion)


def _deformed(
    gaussians: Gaussians, model: ModelConfig, t: float, ahead: OffsetsAhead | None
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], DeformationSaved | None]:
    """Position, quaternion and log-scale with the offsets of the FDM, if there is one."""
    position, quaternion, log_scale = gaussians.position, gaussians.quaternion, gaussians.log_scale
    weight, centre, width = gaussians.fdm_weight, gaussians.fdm_centre, gaussians.fdm_width
    if weight is None:
        return (position, quaternion, log_scale), None
    assert centre is not None and width is not None
    if ahead is not None and ahead.offsets.shape[1] != weight.shape[2]:
        raise ValueError(f"ahead: offsets of {ahead.offsets.shape[1]} Gaussians, the scene has {weight.shape[2]}")
    if ahead is not None and ahead.t == t:
        offsets, saved = ahead.offsets, DeformationSaved(weight, centre, width, float(t), model.basis)
    else:
        offsets, saved = deformation_forward(weight, centre, width, t, model.basis)
    position = position + offsets[POSITION_CHANNELS]
    return (position, quaternion + offsets[QUATERNION_CHANNELS], log_scale + offsets[LOG_SCALE_CHANNELS]), saved


def _translation(gaussians: Gaussians, spectral: Spectral, t: float) -> tuple[FloatArray | None, MotionSaved | None]:
    """C phi(t), or None without component S."""
    coefficients = gaussians.motion_coefficients
    if coefficients is None:
        return None, None
    phi, _ = dictionary_forward(t, spectral.omega)
    return motion_forward(coefficients, phi.astype(coefficients.dtype))


def _residual(
    gaussians: Gaussians, spectral: Spectral, model: ModelConfig, t: float
) -> tuple[FloatArray | None, AppearanceSaved | None]:
    """The bounded colour residual, or None without component A."""
    coefficients = gaussians.appearance_coefficients
    if coefficients is None:
        return None, None
    phi_bar = normalised_atoms(t, spectral.omega, spectral.statistics)
    return appearance_forward(coefficients, phi_bar.astype(coefficients.dtype), model.beta)


def scene_reverse(grads: RenderGrads, saved: SceneSaved, *, coefficients: bool = True) -> SceneGrads:
    """Gradients with respect to the raw parameters, from the gradients of the deformed scene.

    coefficients   False omits the Fourier coefficients, for `coefficients_adam_step`
    """
    by_field = {name: getattr(grads, f"d_{name}") for name in ("position", "quaternion", "log_scale", "opacity_logit")}
    by_field["harmonics"] = grads.d_harmonics
    if saved.appearance is not None and coefficients:
        assert grads.d_residual is not None
        appearance = appearance_reverse(grads.d_residual, saved.appearance, atom_gradient=False)
        by_field["appearance_coefficients"] = appearance.d_appearance_coefficients
    if saved.motion is not None and coefficients:
        motion = motion_reverse(grads.d_position, saved.motion, atom_gradient=False)
        by_field["motion_coefficients"] = motion.d_motion_coefficients
    d_offsets = None
    if saved.deformation is not None:
        d_offsets = np.concatenate([grads.d_position, grads.d_quaternion, grads.d_log_scale])
    return SceneGrads(by_field, d_offsets)


def with_exposure(rendered: RenderOut, exposure: Exposure | None) -> tuple[RenderOut, ExposureSaved | None]:
    """The images with the exposure of their frame, equation (B13); unchanged without one."""
    if exposure is None:
        return rendered, None
    colour, saved = exposure_forward(rendered.colour, exposure.log_gain, exposure.bias)
    return rendered._replace(colour=colour), saved


def with_exposure_reverse(d_colour: FloatArray, saved: ExposureSaved | None) -> tuple[FloatArray, Exposure | None]:
    """Gradients of the rendered colours and of the exposure, from the gradients of the exposed colours."""
    if saved is None:
        return d_colour, None
    grads = exposure_reverse(d_colour, saved)
    return grads.d_colour, Exposure(grads.d_log_gain, grads.d_bias)


def with_pose_correction(camera: Camera, pose: Pose | None) -> tuple[Camera, PoseSaved | None]:
    """The camera with the correction of its pose, equation (B16); unchanged without one."""
    if pose is None:
        return camera, None
    rotation, translation, saved = pose_forward(camera.rotation, camera.translation, *pose)
    return camera._replace(rotation=rotation, translation=translation), saved


def with_pose_correction_reverse(d_camera: CameraGrads | None, saved: PoseSaved | None) -> Pose | None:
    """Gradients of the correction, from the gradients of the corrected pose."""
    if saved is None or d_camera is None:
        return None
    grads = pose_reverse(*d_camera, saved)
    return Pose(grads.d_rotation_vector, grads.d_offset)


def corrected_cameras(frames: FrameParameters | None, cameras: list[Camera], times: Iterable[float]) -> list[Camera]:
    """The cameras of frames with the model's corrections at their times; unchanged if the model has none."""
    return [camera_at(frames, camera, float(t)) for camera, t in zip(cameras, times, strict=True)]


def camera_at(frames: FrameParameters | None, camera: Camera, t: float) -> Camera:
    """A camera with the model's correction at time t; unchanged if the model has none."""
    return with_pose_correction(camera, pose_at(frames, t))[0]


def with_corrected_cameras(sequence: Sequence, frames: FrameParameters | None) -> Sequence:
    """The sequence with the model's corrections of its camera poses."""
    cameras = corrected_cameras(frames, sequence.cameras, sequence.times)
    same = all(one is other for one, other in zip(cameras, sequence.cameras, strict=True))
    return sequence if same else replace(sequence, cameras=cameras)


def without(gaussians: Gaussians, *, appearance: bool = True, spectral_motion: bool = True) -> Gaussians:
    """The same Gaussians without the named spectral components."""
    if not appearance:
        gaussians = gaussians._replace(appearance_coefficients=None)
    return gaussians if spectral_motion else gaussians._replace(motion_coefficients=None)


def render_at(
    gaussians: Gaussians,
    spectral: Spectral,
    config: Config,
    camera: Camera,
    t: float,
    *,
    frames: FrameParameters | None = None,
    background: FloatArray | None = None,
    appearance: bool = True,
    spectral_motion: bool = True,
) -> RenderOut:
    """Render the trained scene at any time in [0, 1] from any camera.

    frames                        frame parameters, whose exposure is interpolated linearly to t; None = no exposure
    appearance, spectral_motion   False omits the component, to show its contribution
    returns                       colour (3, H, W), depth (H, W), opacity (H, W)

    Raises: ValueError with array and index if the scene has a non-finite number.
    """
    chosen = without(gaussians, appearance=appearance, spectral_motion=spectral_motion)
    scene, _ = scene_at(chosen, spectral, config.model, t)
    check_scene(scene)
    degree = config.model.harmonics_degree  # coefficients of degrees that are not active yet are zero
    rendered, _ = render_forward(scene, camera, raster_settings(config), degree=degree, background=background)
    return with_exposure(rendered, exposure_at(frames, t))[0]
