"""Small helpers of compiled rooms that chapters import, in plain NumPy, for chapters that run in their page.

This file runs in the browser. `table.py` says which name of which module each of them replaces.
"""

from collections import namedtuple

import numpy as np

from endotsr.definition.dictionary import atom_statistics, normalised_atoms
from endotsr.definition.projection import Camera
from endotsr.definition.settings import LegacyDeviations, RasterSettings
from endotsr.definition.simulate import simulate

AtomReport = namedtuple("AtomReport", "rank condition dead weak")  # the last two by name, "sin(2 pi 16 t)"
Frame = namedtuple("Frame", "image mask")
Simulated = namedtuple("Simulated", "sequence")
WEAK_RMS = 0.05  # an atom of a smaller RMS is weak


def report_atoms(times, omega):
    """Rank and condition of the normalised dictionary over the stamps, and its dead and weak atoms."""
    statistics = atom_statistics(times, omega)
    atoms = np.array([normalised_atoms(t, omega, statistics) for t in np.unique(times)])
    singular = np.linalg.svd(atoms, compute_uv=False)
    rank = int((singular > singular[0] * max(atoms.shape) * np.finfo(float).eps).sum())
    names = np.array([f"{wave}(2 pi {f:.4g} t)" for wave in ("sin", "cos") for f in omega])
    weak = ~statistics.dead & (statistics.rms < WEAK_RMS)
    condition = float(singular[0] / singular[rank - 1]) if rank else 0.0
    return AtomReport(rank, condition, names[statistics.dead].tolist(), names[weak].tolist())


def sections(data, where=""):
    """Settings by name from nested dictionaries, in the place of `endotsr.config.config_from_dict`."""
    found = {name: sections(value) if isinstance(value, dict) else value for name, value in data.items()}
    return namedtuple("Section", found)(**found)


def raster_of(settings):
    """Settings of the rasteriser by name, as `endotsr.port.stages.requests.raster_of`."""
    fields = dict(settings["raster"])
    return RasterSettings(**fields | {"deviations": LegacyDeviations(**fields["deviations"])})


def raster_dict(raster):
    """The reverse of `raster_of`."""
    return raster._asdict() | {"deviations": raster.deviations._asdict()}


def camera_of(inputs, settings):
    """Pose from the inputs, lens from the settings."""
    return Camera(inputs["rotation_matrix"], inputs["translation"], **settings["camera"])


class SmallScene:
    """The simulated scene of the definition, in the place of a sequence of the simulator."""

    def __init__(self, scene):
        self.scene = scene

    def frame(self, k, dtype):
        """Picture in [0, 1] and mask of a frame."""
        return Frame(self.scene.images[k].astype(dtype) / 255, self.scene.masks[k])


def simulated(size):
    """The small scene of the definition with the size of the settings."""
    return Simulated(SmallScene(simulate(**size)))
