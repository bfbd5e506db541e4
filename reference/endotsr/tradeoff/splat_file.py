"""Gaussians from a splat file, and a camera that has them in view.

`.ply`  as trained splats are commonly stored: binary little-endian vertices with x y z, scale_0..2 (logarithms),
        rot_0..3 (w x y z), opacity (logit), f_dc_0..2 and, for higher degrees, f_rest_* (all of red, then green, blue)
`.npz`  arrays xyz (N, 3), log_scale (N, 3), quat_wxyz (N, 4), rgb (N, 3), opacity (N,) in [0, 1]
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.bench.trained import LARGEST_FILE, read_arrays
from endotsr.config import ModelConfig
from endotsr.errors import InputError
from endotsr.kernels.arrays import FloatArray
from endotsr.kernels.constants import Y00
from endotsr.scene.gaussians import Gaussians, arrays
from endotsr.splatting.camera import Camera
from endotsr.tradeoff.scenes import StudyScene
from endotsr.untrusted.files import read_bytes

SIDE = 320  # pixels of the picture
FOCAL = 1.2  # image widths
MARGIN = 1.1  # of the picture around the Gaussians
OPACITY_STEP = 1 / 255  # of 8-bit files: an opacity of 0 or 1 means half a step from it
PLY_TYPES = {"float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8", "uchar": "u1", "uint8": "u1",
             "char": "i1", "int8": "i1", "short": "<i2", "int16": "<i2", "ushort": "<u2", "uint16": "<u2",
             "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4"}  # fmt: skip


def splat_scene(path: Path, side: int = SIDE) -> StudyScene:
    """The Gaussians of a file in a square picture. Raises InputError naming file and reason."""
    path = Path(path)
    gaussians = read_splats(path)
    camera = facing_camera(gaussians.position, side)
    distance = float(camera.translation[2] + np.median(gaussians.position[2]))
    return StudyScene(
        path.stem.removesuffix("_splats"),
        f"{path.name}, {gaussians.count} trained Gaussians seen from the front",
        gaussians, None, ModelConfig(appearance=False, spectral_motion=False, deformation=False), 0.0, camera,
        near=0.01 * distance, noise=None,
    )  # fmt: skip


def read_splats(path: Path) -> Gaussians:
    """The Gaussians, float32; those with a number that is not finite are left out. Raises InputError."""
    readers = {".ply": _from_ply, ".npz": _from_npz}
    if path.suffix.lower() not in readers:
        raise InputError(f"{path}: not a splat file; allowed: a name that ends in {' or '.join(readers)}")
    try:
        found = readers[path.suffix.lower()](path)
    except KeyError as error:
        raise InputError(f"{path}: {error.args[0]} is missing; see `endotsr tradeoff --help`") from None
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    sound = np.all([np.isfinite(a).reshape(-1, a.shape[-1]).all(axis=0) for a in arrays(found).values()], axis=0)
    if not sound.any():
        raise InputError(f"{path}: no Gaussian with finite numbers")
    kept = {name: np.ascontiguousarray(a[..., sound], np.float32) for name, a in arrays(found).items()}
    return found._replace(**kept)


def _from_npz(path: Path) -> Gaussians:
    data = read_arrays(path)
    opacity = np.clip(data["opacity"].astype(np.float64), OPACITY_STEP / 2, 1 - OPACITY_STEP / 2)
    colour = (data["rgb"].astype(np.float64) - 0.5) / Y00
    return Gaussians(
        data["xyz"].T, data["quat_wxyz"].T, data["log_scale"].T, np.log(opacity / (1 - opacity)), colour.T[None]
    )


def _from_ply(path: Path) -> Gaussians:
    vertex = _ply_vertices(path)
    names = vertex.dtype.names or ()

    def columns(*wanted: str) -> FloatArray:
        return np.stack([vertex[name].astype(np.float64) for name in wanted])

    rest = [f"f_rest_{i}" for i in range(sum(name.startswith("f_rest_") for name in names))]
    bands = 1 + len(rest) // 3
    if bands not in (1, 4, 9, 16):
        raise ValueError(f"{len(rest)} f_rest columns; 0, 9, 24 or 45 expected")
    harmonics = np.empty((bands, 3, vertex.size))
    harmonics[0] = columns("f_dc_0", "f_dc_1", "f_dc_2")
    if rest:
        harmonics[1:] = columns(*rest).reshape(3, bands - 1, -1).transpose(1, 0, 2)
    return Gaussians(
        columns("x", "y", "z"), columns("rot_0", "rot_1", "rot_2", "rot_3"), columns("scale_0", "scale_1", "scale_2"),
        vertex["opacity"].astype(np.float64), harmonics,
    )  # fmt: skip


def _ply_vertices(path: Path) -> NDArray[np.void]:
    """The vertex element of a binary little-endian PLY file whose first element it is."""
    content = read_bytes(path, LARGEST_FILE)
    head, mark, body = content.partition(b"end_header\n")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    if not mark or lines[:1] != [["ply"]] or ["format", "binary_little_endian", "1.0"] not in lines:
        raise ValueError("not a binary little-endian PLY file")
    elements = [i for i, line in enumerate(lines) if line[:1] == ["element"]]
    if not elements or len(lines[elements[0]]) != 3 or lines[elements[0]][1] != "vertex":
        raise ValueError("the first element is not `vertex`")
    properties = [line for line in lines[elements[0] : (elements + [None])[1]] if line[:1] == ["property"]]
    if any(len(line) != 3 or line[1] not in PLY_TYPES for line in properties):
        raise ValueError("a vertex property is not a plain number")
    kind = np.dtype([(line[2], PLY_TYPES[line[1]]) for line in properties])
    count = int(lines[elements[0]][2])
    if count < 1 or count * kind.itemsize > len(body):
        raise ValueError(f"{count} vertices of {kind.itemsize} bytes announced, {len(body)} bytes found")
    return np.frombuffer(body, kind, count=count)


def facing_camera(position: FloatArray, side: int) -> Camera:
    """A camera along +z towards the middle of the positions, with all but a few per cent of them in the picture."""
    low, high = np.quantile(position.astype(np.float64), [0.02, 0.98], axis=1)
    reach = max(float((high - low)[:2].max()) / 2, 1e-6)
    distance = MARGIN * 2 * FOCAL * reach + float(high[2] - low[2]) / 2
    translation = -(low + high) / 2 + np.array([0, 0, distance])
    return Camera(np.eye(3), translation, FOCAL * side, FOCAL * side, side / 2, side / 2, side, side)
