"""A simulated sequence with known geometry, motion and light: a `Sequence` and its ground truth.

In: `SimulatorSettings`. Out: frames, masks, prior depth, cameras, split, and the visible material point of every pixel.
Equal settings give bitwise equal sequences. This module does not depend on the model.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.splits import split_frames
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.surface import Surface, surface_point
from endotsr.clips.simulator.views import pixel_of

UNIT = "mm"


class SequenceTruth(NamedTuple):
    """Quantities that a real sequence lacks. Behind an instrument they describe the hidden tissue."""

    depth: NDArray[np.floating]  # (n, H, W)    view-space z of the tissue, mm
    material_coordinates: NDArray[np.floating]  # (n, 2, H, W) material point at the pixel centre, mm; NaN in a wound
    instrument: NDArray[np.bool_]  # (n, H, W)    pixels covered by an instrument, without margin
    surface: Surface


@dataclass(frozen=True, eq=False)
class SimulatedSequence:
    """A sequence and its ground truth."""

    sequence: Sequence
    truth: SequenceTruth
    settings: SimulatorSettings

    def surface_point(self, material: NDArray[np.floating], t: float) -> NDArray[np.floating]:
        """World position at normalised time t of material points: (2, ...) mm to (3, ...) mm."""
        return surface_point(self.truth.surface, material, t)

    def true_positions(self, source: int, target: int) -> NDArray[np.floating]:
        """World positions (3, H, W), mm, at frame `target` of the tissue in the pixels of frame `source`."""
        return self.surface_point(self.truth.material_coordinates[source], float(self.sequence.times[target]))

    def true_flow(self, source: int, target: int) -> NDArray[np.floating]:
        """Motion of the tissue from every pixel of frame `source` to frame `target`, (2, H, W) px, x first.

        NaN where frame `source` shows the wound of a slit.
        """
        camera = self.sequence.cameras[target]
        u, v, _ = pixel_of(camera, self.true_positions(source, target))
        return np.stack([u - (np.arange(camera.width) + 0.5), v - (np.arange(camera.height) + 0.5)[:, None]])


def simulate(settings: SimulatorSettings | None = None) -> SimulatedSequence:
    """Simulate a sequence. The default settings are 160x128 pixels and 24 frames of a static camera.

    Raises:  InputError if the settings fold the tissue over itself or the frames cannot be split.
    """
    settings = settings or SimulatorSettings()
    n, height, width = settings.frames, settings.height, settings.width
    train, test = split_frames(n, "blocks" if settings.block_length else "every_eighth", settings.block_length)
    scene = make_scene(settings)
    images = np.empty((n, 3, height, width), np.uint8)
    prior = np.empty((n, height, width), np.float32)
    depth = np.empty((n, height, width))
    material = np.empty((n, 2, height, width))
    covered = np.empty((n, height, width), bool)
    tissue = np.empty((n, height, width), bool)
    for i, frame in enumerate(simulated_frames(scene)):
        images[i], tissue[i], prior[i] = frame.image, frame.tissue, frame.prior
        depth[i], material[i], covered[i] = frame.depth, frame.material, frame.covered
    sequence = Sequence(
        images=images,
        masks=tissue,
        depth=prior,
        times=scene.times,
        cameras=scene.cameras,
        names=[f"simulated-{i:06d}" for i in range(n)],
        unit=UNIT,
        static_camera=not settings.camera_motion.on,
        train_index=train,
        test_index=test,
        notes=[f"simulated with seed {settings.seed}; tissue is {tissue.mean():.1%} of the pixels"],
    )
    return SimulatedSequence(sequence, SequenceTruth(depth, material, covered, scene.surface), settings)
