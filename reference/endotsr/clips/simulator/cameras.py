"""The cameras of a simulated sequence: poses, shutter and vignetting."""

import numpy as np

from endotsr.clips.simulator.hand import hand_path, hand_rotations
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera

FOLLOWED = np.array([0.5, 0.5, 1.0])  # of the shift of a hand that its turn makes up for; the rest moves the picture


def make_cameras(settings: SimulatorSettings, times: FloatArray, right: bool = False) -> list[Camera]:
    """One camera per frame: at the origin, looking along z, or on the path of the camera motion.

    right    the second camera of a rectified pair: the same axes, offset to the right by the baseline
    """
    focal = settings.focal * settings.width
    rest = Camera(
        np.eye(3), np.zeros(3), focal, focal, settings.width / 2, settings.height / 2, settings.width, settings.height
    )
    if right:
        aside = np.array([settings.stereo.baseline, 0.0, 0.0])
        return [camera._replace(translation=camera.translation - aside) for camera in make_cameras(settings, times)]
    if not settings.camera_motion.on:
        return [rest] * len(times)
    centres, cameras = camera_centres(settings, times), []
    rotations = _rotations(settings, times, centres)
    for centre, rotation in zip(centres, rotations):
        cameras.append(rest._replace(rotation=rotation, translation=-rotation @ centre))
    return cameras


def camera_centres(settings: SimulatorSettings, times: FloatArray) -> FloatArray:
    """Camera centres, (n, 3) mm: the origin, or the path of the camera motion."""
    part = settings.camera_motion
    if part.on and part.path == "hand":
        return hand_path(settings, times)
    angle = 2 * np.pi * part.cycles * np.asarray(times, float)
    path = np.stack([np.sin(angle), 0.5 * (1 - np.cos(angle)), np.zeros_like(angle)], axis=1)
    return part.amplitude * path if part.on else np.zeros((len(path), 3))


def _rotations(settings: SimulatorSettings, times: FloatArray, centres: FloatArray) -> FloatArray:
    """World-to-camera rotations, (n, 3, 3). An orbit keeps (0, 0, distance) in the centre, a hand does not."""
    middle = np.array([0.0, 0.0, settings.distance])
    if settings.camera_motion.path == "hand":
        return hand_rotations(settings, times) @ np.array([_looking_at(middle - FOLLOWED * c) for c in centres])
    return np.array([_looking_at(middle - c) for c in centres])


def _looking_at(forward: FloatArray) -> FloatArray:
    """World-to-camera rotation with z along `forward` and x horizontal."""
    z = forward / np.linalg.norm(forward)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def open_span(settings: SimulatorSettings) -> float:
    """Exposure time, in normalised time; 0 without motion blur."""
    part = settings.motion_blur
    return part.shutter / settings.frames if part.on else 0.0


def shutter_times(settings: SimulatorSettings) -> FloatArray:
    """The averaged times: midpoints of equal parts of the exposure, relative to the time of the frame."""
    samples = settings.motion_blur.samples
    return open_span(settings) * ((np.arange(samples) + 0.5) / samples - 0.5)


def vignette(settings: SimulatorSettings) -> FloatArray:
    """The light factor of every pixel, (H, W): 1 - amplitude (r / r_corner)^2, with r from the image centre."""
    x = (np.arange(settings.width) + 0.5) / settings.width - 0.5
    y = ((np.arange(settings.height) + 0.5) / settings.height - 0.5) * settings.height / settings.width
    corner = 0.25 * (1 + (settings.height / settings.width) ** 2)
    return 1 - settings.vignetting.amplitude * (x**2 + y[:, None] ** 2) / corner
