"""The lamps: positions, light received by the tissue, specular highlights and shadows.

In: a view of the sheet. Out: `Lit` for each lamp, and the linear light of its highlights.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.views import SurfaceView, rotate, to_camera
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, camera_centre

GAIN = 0.95  # linear light of reflectance 1 at normal incidence and the scene's distance
WRAP = 0.15  # subsurface scattering softens the shading
BEAM = 3.0  # exponent of the fall-off away from the lamp's axis
INSTRUMENT_DEPTH = 0.7  # view-space z of the instruments, distances of the scene


class Lit(NamedTuple):
    """The light of one lamp at every pixel."""

    diffuse: FloatArray  # (H, W) linear light of reflectance 1
    received: FloatArray  # (H, W) the same without the cosine term
    half: FloatArray  # (3, H, W) unit vectors half-way between lamp and eye


class Blocker(NamedTuple):
    """The instruments of a frame as a flat screen that casts shadows."""

    cover: FloatArray  # (H, W) 0 .. 1, softened
    camera: Camera  # the screen covers its picture at z = INSTRUMENT_DEPTH x distance


def lit_by_endoscope(
    settings: SimulatorSettings, view: SurfaceView, camera: Camera, blocker: Blocker | None, eye: Camera | None = None
) -> Lit:
    """The lamp at the camera: n.l with scattering, (distance / r)^2 and its beam.

    eye      the camera of the view, if the lamp is elsewhere
    """
    towards, r = _towards(view, camera_centre(camera))
    axis = view.depth / r  # cosine of the angle to the optical axis
    received = GAIN * (settings.distance / r) ** 2 * axis**BEAM
    if blocker is not None:
        lamp = camera_centre(camera) + camera.rotation.T @ [settings.shadows.offset, 0.0, 0.0]
        received = received * shadow(settings, blocker, lamp, view)
    return Lit(_diffuse(view, towards, received), received, towards if eye is None else _half_way(view, towards, eye))


def lit_by_second(settings: SimulatorSettings, view: SurfaceView, blocker: Blocker | None, eye: Camera) -> Lit:
    """The second lamp, at a fixed position, without fall-off away from its axis."""
    part = settings.second_light
    lamp = np.array([part.right, part.down, 0.0])
    towards, r = _towards(view, lamp)
    received = part.strength * GAIN * (settings.distance / r) ** 2
    if blocker is not None:
        received = received * shadow(settings, blocker, lamp, view)
    return Lit(_diffuse(view, towards, received), received, _half_way(view, towards, eye))


def _towards(view: SurfaceView, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3, H, W) from the tissue to a world position (3,), and the distance (H, W)."""
    towards = place[:, None, None] - view.point
    r = np.sqrt((towards**2).sum(axis=0))
    return towards / r, r


def _diffuse(view: SurfaceView, towards: FloatArray, received: FloatArray) -> FloatArray:
    """The received light with the cosine term, softened by subsurface scattering."""
    return received * np.maximum((view.normal * towards).sum(axis=0) + WRAP, 0.0) / (1 + WRAP)


def bent_normal(normal: FloatArray, slopes: FloatArray) -> FloatArray:
    """Unit normals n' (3, H, W) of the wet surface: those of the sheet, tilted by slopes (2, H, W) of its relief."""
    bent = normal.copy()
    bent[0] += slopes[0]
    bent[1] += slopes[1]
    bent /= np.sqrt((bent**2).sum(axis=0))
    return bent


def mirrored(settings: SimulatorSettings, lit: Lit, bent: FloatArray) -> FloatArray:
    """The highlights of a lamp, (H, W): strength received (n'.half)^exponent, with n' from `bent_normal`."""
    mirror = np.maximum((bent * lit.half).sum(axis=0), 0.0) ** settings.highlights.exponent
    return settings.highlights.strength * lit.received * mirror


def shadow(settings: SimulatorSettings, blocker: Blocker, lamp: FloatArray, view: SurfaceView) -> FloatArray:
    """The shadow factor (H, W) of a lamp at world position (3,): 1 - strength where instruments block the light.

    The cover is sampled where the line from the lamp to the tissue crosses the plane of the instruments.
    """
    from endotsr.clips.opencv.flow import warp_bilinear

    camera = blocker.camera
    x, y, z = to_camera(camera, view.point)
    source = rotate(camera.rotation, lamp) + camera.translation
    plane = INSTRUMENT_DEPTH * settings.distance
    part = (plane - source[2]) / (z - source[2])
    u = camera.fx * (source[0] + part * (x - source[0])) / plane + camera.cx - 0.5
    v = camera.fy * (source[1] + part * (y - source[1])) / plane + camera.cy - 0.5
    u -= np.arange(camera.width)
    v -= np.arange(camera.height)[:, None]
    return 1 - settings.shadows.strength * warp_bilinear(blocker.cover, np.stack([u, v]))


def make_blocker(settings: SimulatorSettings, cover: FloatArray, camera: Camera) -> Blocker:
    """The screen for a coverage (H, W) in [0, 1], with softened edges."""
    from scipy.ndimage import gaussian_filter

    radius = settings.shadows.softness * settings.width
    return Blocker(gaussian_filter(cover, radius, mode="nearest") if radius > 0 else cover, camera)


def _half_way(view: SurfaceView, towards: FloatArray, eye: Camera) -> FloatArray:
    half = towards + _towards(view, camera_centre(eye))[0]
    return half / np.sqrt((half**2).sum(axis=0))
