"""Points of a reconstruction from a PLY file, such as `sparse_pc.ply` of nerfstudio."""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.inventory import Inventory
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.ply import read_vertices

LARGEST_FILE = 1 << 28  # bytes
CLOUD = Inventory(
    "the vertices of a PLY file of points",
    used={"x y z": "position, in the unit and the world of the matrices"},
    harmless={
        "red green blue alpha r g b": "the scene takes its colours from the pictures",
        "nx ny nz": "the scene needs no surface normals",
        "confidence quality intensity error": "a measure of the point, which moves no point",
    },
)


def read_cloud(path: Path) -> tuple[FloatArray, list[str]]:
    """Points (n, 3), and notes on properties and elements that are not used.

    Raises:  InputError for a file without x, y and z, and for numbers that are not finite.
    """
    vertices, others = read_vertices(path, LARGEST_FILE)
    names = vertices.dtype.names or ()
    if lacking := [name for name in "xyz" if name not in names]:
        raise InputError(f"{path}: property {lacking[0]} is missing; use a PLY file with x, y and z")
    cloud = np.stack([vertices[name].astype(np.float64) for name in "xyz"], axis=1)
    if not np.isfinite(cloud).all():
        raise InputError(f"{path}: vertex {int(np.flatnonzero(~np.isfinite(cloud).all(axis=1))[0])} is not finite")
    notes = CLOUD.noted(names, path.name)
    if others:
        notes.append(f"{path.name}: not used: its {', '.join(others)}; points alone are read")
    return cloud, notes
