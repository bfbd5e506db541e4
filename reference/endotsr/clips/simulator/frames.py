"""The frames of a simulated scene, one at a time: pictures, mask, prior depth and ground truth.

In: `SimulatorSettings`. Out: a `SimulatedScene`, which yields one `SimulatedFrame` at a time: a long sequence needs the
memory of one frame. The effects follow the light path: tissue, motion blur, instruments, smoke, lens, gain, display
curve, sensor noise. An effect that is off is skipped, or is a
factor of exactly one.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.times import time_stamps
from endotsr.clips.simulator.cameras import make_cameras, open_span, shutter_times, vignette
from endotsr.clips.simulator.coarse import see_coarsely, views_during
from endotsr.clips.simulator.gain import camera_gain, to_display
from endotsr.clips.simulator.instrument import Drawing, draw
from endotsr.clips.simulator.lamps import INSTRUMENT_DEPTH, Blocker, make_blocker
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.shading import TissueLight, lit_by_all, shade
from endotsr.clips.simulator.smoke import with_smoke
from endotsr.clips.simulator.surface import Surface, make_surface
from endotsr.clips.simulator.texture import Texture, make_texture
from endotsr.clips.simulator.views import SurfaceView, see
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera

LEFT_NOISE, DEPTH_NOISE, RIGHT_NOISE = 2, 3, 7  # random streams; the scene uses 0, 1, 4 to 6 and 8


class SimulatedScene(NamedTuple):
    """The parts of a sequence."""

    settings: SimulatorSettings
    times: NDArray[np.float64]  # (n,) normalised
    cameras: list[Camera]  # n entries
    surface: Surface
    texture: Texture


class Eye(NamedTuple):
    """One of the two cameras of a frame, and its view."""

    view: SurfaceView
    camera: Camera
    right: bool


class SimulatedFrame(NamedTuple):
    """One frame and its truth."""

    image: NDArray[np.uint8]  # (3, H, W) display RGB
    image_right: NDArray[np.uint8] | None  # (3, H, W) of the right camera; None without stereo
    tissue: BoolArray  # (H, W) the mask: True = tissue
    prior: NDArray[np.float32]  # (H, W) prior depth, mm; 0 = none
    depth: FloatArray  # (H, W) true view-space z of the tissue, mm
    material: FloatArray  # (2, H, W) material point at the pixel centre, mm; NaN in the wound of a slit
    covered: BoolArray  # (H, W) pixels covered by an instrument, without margin
    excluded: BoolArray  # (H, W) the same with the margin
    highlight: FloatArray | None  # (H, W) linear light of the highlights on the tissue; None while they are off


def make_scene(settings: SimulatorSettings) -> SimulatedScene:
    """Surface, texture and cameras. Raises InputError for contradictory settings."""
    times = time_stamps(settings.frames)
    return SimulatedScene(
        settings, times, make_cameras(settings, times), make_surface(settings), make_texture(settings)
    )


def moves(scene: SimulatedScene) -> bool:
    """Whether the view changes over time."""
    return bool(scene.surface.motions) or scene.surface.slit is not None or scene.settings.camera_motion.on


def simulated_frames(scene: SimulatedScene) -> Iterator[SimulatedFrame]:
    """The frames in order. Raises InputError where the settings fold the tissue over itself."""
    settings = scene.settings
    right_cameras = make_cameras(settings, scene.times, right=True) if settings.stereo.on else []
    left = right = None
    for i, t in enumerate(scene.times):
        if left is None or moves(scene):
            left = Eye(see(scene.surface, scene.cameras[i], t), scene.cameras[i], False)
            if settings.stereo.on:
                right = Eye(see_coarsely(scene.surface, right_cameras[i], t), right_cameras[i], True)
        yield _frame(scene, left, right, i)


def _frame(scene: SimulatedScene, left: Eye, right: Eye | None, i: int) -> SimulatedFrame:
    settings, view, t = scene.settings, left.view, float(scene.times[i])
    tools = draw(settings, t)
    blocker = make_blocker(settings, tools.coverage, left.camera) if settings.shadows.on and tools is not None else None
    light, highlight = _light(scene, left, left.camera, tools, blocker, t)
    image = _picture(settings, light, LEFT_NOISE, i)
    image_right = None
    if right is not None:
        shift = -settings.focal * settings.stereo.baseline / (INSTRUMENT_DEPTH * settings.distance)
        light, _ = _light(scene, right, left.camera, draw(settings, t, shift), blocker, t)
        image_right = _picture(settings, light, RIGHT_NOISE, i)
    covered = np.zeros(view.depth.shape, bool) if tools is None else tools.coverage > 0
    excluded = covered if tools is None else tools.excluded | covered
    prior = _depth_prior(settings, view.depth, ~excluded, i)
    tissue = ~excluded & (prior > 0) if settings.stereo.on else ~excluded
    material = view.material if view.wound is None else np.where(view.wound, np.nan, view.material)
    return SimulatedFrame(image, image_right, tissue, prior, view.depth, material, covered, excluded, highlight)


def _light(
    scene: SimulatedScene, eye: Eye, lamp: Camera, tools: Drawing | None, blocker: Blocker | None, t: float
) -> tuple[FloatArray, FloatArray | None]:
    """Linear light (3, H, W) at the sensor, including gain, and the highlights on the tissue. The lamp is at `lamp`."""
    settings = scene.settings
    light, highlight = tissue_light(scene, eye, lamp, blocker, t)
    if tools is not None:
        light = light * (1 - tools.coverage) + tools.light * tools.coverage
    if settings.smoke.on:
        light = with_smoke(settings, light, t)
    if settings.vignetting.on:
        light = light * vignette(settings)
    gain = camera_gain(settings, t)
    return light if gain is None else light * gain[:, None, None], highlight


def tissue_light(scene: SimulatedScene, eye: Eye, lamp: Camera, blocker: Blocker | None, t: float) -> TissueLight:
    """The light of the tissue; with motion blur, its mean over the exposure.

    The tissue moves during an exposure. The lamps' light at a pixel is evaluated at mid-exposure.
    """
    settings, surface = scene.settings, scene.surface
    lamps = lit_by_all(settings, eye.view, lamp, blocker, eye.camera if eye.right else None)
    if open_span(settings) == 0.0 or not moves(scene):
        return shade(settings, scene.texture, eye.view, lamps, t)
    times = shutter_times(settings)
    cameras = make_cameras(settings, np.array([t + times[0], t, t + times[-1]]), eye.right)
    views = views_during(surface, cameras, eye.view, t, times)
    light = np.zeros((3, *eye.view.depth.shape))
    highlight = np.zeros(eye.view.depth.shape) if settings.highlights.on else None
    for view in views:
        one = shade(settings, scene.texture, view, lamps, t)
        light += one.light / len(times)
        if highlight is not None and one.highlight is not None:
            highlight += one.highlight / len(times)
    return TissueLight(light, highlight)


def _picture(settings: SimulatorSettings, light: FloatArray, stream: int, i: int) -> NDArray[np.uint8]:
    """The 8-bit frame (3, H, W): display curve, then sensor noise."""
    display = to_display(light)
    if settings.noise.on:
        rng = np.random.default_rng([settings.seed, stream, i])
        display = display + settings.noise.sigma * rng.standard_normal(display.shape)
    return np.floor(np.clip(display, 0.0, 1.0) * 255 + 0.5).astype(np.uint8)


def _depth_prior(settings: SimulatorSettings, depth: FloatArray, tissue: BoolArray, i: int) -> NDArray[np.float32]:
    """The prior depth: 0 on the instrument, and at the left where the picture of the right camera ends.

    With depth errors: noise, at least 1 mm, and 0 in a strip at the left. Rounding makes at least one step of a depth.
    """
    prior = np.where(tissue, depth, 0.0)
    if settings.depth_errors.on:
        rng = np.random.default_rng([settings.seed, DEPTH_NOISE, i])
        noisy = depth + settings.depth_errors.sigma * rng.standard_normal(depth.shape)
        prior = np.where(tissue, np.maximum(noisy, 1.0), 0.0)
        prior[:, : round(settings.depth_errors.strip * settings.width)] = 0.0
    if settings.stereo.on:
        column = np.arange(settings.width) + 0.5
        disparity = settings.focal * settings.width * settings.stereo.baseline / depth
        prior = np.where(column < disparity, 0.0, prior)
    if settings.depth_rounding.on:
        step = settings.depth_rounding.step
        prior = np.where(prior > 0, np.maximum(np.rint(prior / step), 1) * step, 0.0)
    return prior.astype(np.float32)
