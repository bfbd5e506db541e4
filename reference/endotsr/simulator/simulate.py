"""A simulated sequence with known geometry, motion and light: the `Sequence` of a reader, and the truth.

In: `SimulatorSettings`. Out: frames, masks, depth prior, cameras, split, and per pixel the material point that is seen.
Equal settings give bitwise equal sequences. This module does not depend on the model.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.sequences.sequence import Sequence
from endotsr.sequences.splits import split_frames, time_stamps
from endotsr.simulator.instrument import Drawing, draw
from endotsr.simulator.settings import SimulatorSettings
from endotsr.simulator.shading import exposure_gain, shade, to_display
from endotsr.simulator.surface import Surface, View, make_surface, see, surface_point, to_camera
from endotsr.simulator.texture import Texture, make_texture
from endotsr.splatting.camera import Camera

UNIT = "mm"


class Truth(NamedTuple):
    """Quantities that a real sequence does not contain. Behind the instrument they are those of the hidden tissue."""

    depth: NDArray[np.floating]  # (n, H, W)    view-space z of the tissue, mm
    material_coordinates: NDArray[np.floating]  # (n, 2, H, W) material point at the pixel centre, mm
    instrument: NDArray[np.bool_]  # (n, H, W)    pixels the instrument covers, margin not included
    surface: Surface


@dataclass(frozen=True, eq=False)
class SimulatedSequence:
    """A sequence and the truth behind it."""

    sequence: Sequence
    truth: Truth
    settings: SimulatorSettings

    def surface_point(self, material: NDArray[np.floating], t: float) -> NDArray[np.floating]:
        """World position at normalised time t of material points: (2, ...) mm to (3, ...) mm."""
        return surface_point(self.truth.surface, material, t)

    def true_positions(self, source: int, target: int) -> NDArray[np.floating]:
        """World position (3, H, W), mm, at the time of frame `target` of what the pixels of frame `source` show."""
        return self.surface_point(self.truth.material_coordinates[source], float(self.sequence.times[target]))

    def true_flow(self, source: int, target: int) -> NDArray[np.floating]:
        """Motion in pixels (2, H, W), x first, of the tissue at every pixel of frame `source` to frame `target`."""
        camera = self.sequence.cameras[target]
        seen = to_camera(camera, self.true_positions(source, target))
        u = camera.fx * seen[0] / seen[2] + camera.cx - (np.arange(camera.width) + 0.5)
        v = camera.fy * seen[1] / seen[2] + camera.cy - (np.arange(camera.height) + 0.5)[:, None]
        return np.stack([u, v])


def simulate(settings: SimulatorSettings | None = None) -> SimulatedSequence:
    """Simulate a sequence; without settings the demonstration (160x128, 24 frames, all effects of a static camera).

    Raises:  InputError if the settings fold the tissue over itself or the frames cannot be split.
    """
    settings = settings or SimulatorSettings()
    n, height, width = settings.frames, settings.height, settings.width
    train, test = split_frames(n, "blocks" if settings.block_length else "every_eighth", settings.block_length)
    times = time_stamps(n)
    cameras = make_cameras(settings, times)
    surface, texture = make_surface(settings), make_texture(settings)
    images = np.empty((n, 3, height, width), np.uint8)
    prior = np.empty((n, height, width), np.float32)
    depth = np.empty((n, height, width))
    material = np.empty((n, 2, height, width))
    covered = np.zeros((n, height, width), bool)
    tissue = np.ones((n, height, width), bool)
    moves = bool(surface.motions) or settings.camera_motion.on
    view = None
    for i, t in enumerate(times):
        if view is None or moves:
            view = see(surface, cameras[i], t)
        tool = draw(settings, t) if settings.instrument.on else None
        images[i] = _picture(settings, texture, view, tool, cameras[i], i, t)
        depth[i], material[i] = view.depth, view.material
        if tool is not None:
            covered[i], tissue[i] = tool.coverage > 0, ~tool.excluded
        prior[i] = _depth_prior(settings, view.depth, tissue[i], i)
    sequence = Sequence(
        images=images,
        masks=tissue,
        depth=prior,
        times=times,
        cameras=cameras,
        names=[f"simulated-{i:06d}" for i in range(n)],
        unit=UNIT,
        static_camera=not settings.camera_motion.on,
        train_index=train,
        test_index=test,
        notes=[f"simulated with seed {settings.seed}; tissue fraction {tissue.mean():.4f}"],
    )
    return SimulatedSequence(sequence, Truth(depth, material, covered, surface), settings)


def make_cameras(settings: SimulatorSettings, times: NDArray[np.floating]) -> list[Camera]:
    """One camera a frame: at the origin, looking along z; with motion, it swings about the middle of the tissue."""
    focal = settings.focal * settings.width
    rest = Camera(
        np.eye(3), np.zeros(3), focal, focal, settings.width / 2, settings.height / 2, settings.width, settings.height
    )
    part = settings.camera_motion
    if not part.on:
        return [rest] * len(times)
    cameras = []
    for t in times:
        angle = 2 * np.pi * part.cycles * t
        centre = part.amplitude * np.array([np.sin(angle), 0.5 * (1 - np.cos(angle)), 0.0])
        rotation = _looking_at(np.array([0.0, 0.0, settings.distance]) - centre)
        cameras.append(rest._replace(rotation=rotation, translation=-rotation @ centre))
    return cameras


def _looking_at(forward: NDArray[np.floating]) -> NDArray[np.floating]:
    """World-to-camera rotation with z along `forward` and x horizontal."""
    z = forward / np.linalg.norm(forward)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _picture(
    settings: SimulatorSettings, texture: Texture, view: View, tool: Drawing | None, camera: Camera, i: int, t: float
) -> NDArray[np.uint8]:
    """The 8-bit frame (3, H, W): tissue, instrument over it, exposure, display curve, sensor noise."""
    light = shade(settings, texture, view, camera, t)
    if tool is not None:
        light = light * (1 - tool.coverage) + tool.light * tool.coverage
    if settings.exposure.on:
        light = light * exposure_gain(settings, t)[:, None, None]
    display = to_display(light)
    if settings.noise.on:
        rng = np.random.default_rng([settings.seed, 2, i])
        display = display + settings.noise.sigma * rng.standard_normal(display.shape)
    return np.floor(np.clip(display, 0.0, 1.0) * 255 + 0.5).astype(np.uint8)


def _depth_prior(
    settings: SimulatorSettings, depth: NDArray[np.floating], tissue: NDArray[np.bool_], i: int
) -> NDArray[np.float32]:
    """The prior depth of a reader: 0 on the instrument, and with errors if they are switched on."""
    prior = np.where(tissue, depth, 0.0)
    if settings.depth_errors.on:
        rng = np.random.default_rng([settings.seed, 3, i])
        noisy = depth + settings.depth_errors.sigma * rng.standard_normal(depth.shape)
        prior = np.where(tissue, np.maximum(noisy, 1.0), 0.0)
        prior[:, : round(settings.depth_errors.strip * settings.width)] = 0.0
    return prior.astype(np.float32)
