"""Small helpers of compiled rooms that chapters import, in plain NumPy, for chapters that run in their page.

This file runs in the browser. `table.py` says which name of which module each of them replaces.
"""

from collections import namedtuple

import numpy as np

from endotsr.definition import projection
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
    """Settings of the rasteriser by name, as `endotsr.port.operations.requests.raster_of`."""
    fields = dict(settings["raster"])
    return RasterSettings(**fields | {"deviations": LegacyDeviations(**fields["deviations"])})


def raster_dict(raster):
    """The reverse of `raster_of`."""
    return raster._asdict() | {"deviations": raster.deviations._asdict()}


def camera_of(inputs, settings):
    """Pose from the inputs, lens from the settings."""
    return Camera(inputs["rotation_matrix"], inputs["translation"], **settings["camera"])


def projection_forward(position, shape, camera, settings):
    """Equation (B3) in the precision of the position, with the determinant as a sum of nonnegative terms."""
    out, saved = projection.projection_forward(position, shape, camera, settings)
    point = np.where(out.visible, camera.rotation @ position + camera.translation[:, None], 1)
    j = projection.jacobian(point, camera, settings)[0]
    m = np.einsum("ijn,jk,kln->iln", j, camera.rotation, shape.rotation.astype(float)) * shape.scale
    minors = np.cross(m[0], m[1], axis=0)
    eps = settings.low_pass
    determinant = eps**2 + eps * (m**2).sum(axis=(0, 1)) + (minors**2).sum(axis=0)
    out = out._replace(determinant=np.where(out.visible, determinant, 0))
    return out._replace(**{name: part.astype(position.dtype) for name, part in zip(out._fields[:4], out)}), saved


def projection_reverse(d_mean2d, d_covariance2d, d_depth, saved, pose_gradient=True):
    """Reverse of (B3); the definition always returns the gradient with respect to the pose."""
    return projection.projection_reverse(d_mean2d, d_covariance2d, d_depth, saved)


def projection_reverse_footprint(d_mean2d, d_footprint, d_depth, saved):
    """Reverse of (B3) from the gradients (3, N) with respect to A = c / det, m = b / c and r = 1 / c."""
    out, _ = projection_forward(*saved[:4])
    _, b, c = np.where(out.visible, out.covariance2d, 1)
    g_a, g_m, g_r = np.where(out.visible, d_footprint, 0)
    slope, inverse = b / c, 1 / c
    by_a = (c / np.where(out.visible, out.determinant, 1)) ** 2 * g_a
    d_c = -by_a * slope**2 - slope * inverse * g_m - inverse**2 * g_r
    d_covariance2d = np.array([-by_a, 2 * by_a * slope + inverse * g_m, d_c])
    return projection.projection_reverse(d_mean2d, d_covariance2d, d_depth, saved)


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
