"""3-D Gaussian splatting files (.ply): written for one time of a scene, and read.

Binary little-endian vertices with the properties of the original program, which other viewers expect: x y z, nx ny nz
(zero), f_dc_0..2, f_rest_* (all of red, then green, then blue), opacity (logit), scale_0..2 (logarithms), rot_0..3
(w x y z), all float32. The basis of the harmonics is the package's; `placement` defines the axes. Files are untrusted
input: reading drops Gaussians with numbers that are not finite.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.inventory import Inventory
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.render import Scene
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.untrusted.ply import read_vertices
from endotsr.untrusted.writing import replace_file

TYPE_NAMES = {np.dtype("<f4"): "float", np.dtype("u1"): "uchar"}
LARGEST_FILE = 1 << 33  # bytes
REST = (0, 9, 24, 45)  # number of f_rest columns for degree 0 to 3
LEAST_NORM = 1e-12  # lower bound for the norm of a quaternion
MOVES = "the Gaussians of this file move or change, and one picture of them needs a time: export one time of the scene"
GAUSSIAN = Inventory(
    "the vertices of a 3-D Gaussian splatting file",
    used={
        "x y z": "centre",
        "f_dc_0 f_dc_1 f_dc_2 f_rest_*": "coefficients of the spherical harmonics; 0, 9, 24 or 45 of f_rest",
        "opacity": "logit",
        "scale_0 scale_1 scale_2": "logarithms of the standard deviations",
        "rot_0 rot_1 rot_2 rot_3": "quaternion w x y z",
        "filter_3D": "standard deviation of the filter of Mip-Splatting, added in quadrature",
    },
    refused={
        "motion_* trbf_* t scale_t rot_r_* omega_* velocity_* vel_* accel_* deform*": MOVES,
        "f_t_* feature_t_* f_fourier_*": MOVES,
    },
    harmless={"nx ny nz": "Gaussians have no normals", "red green blue": "the colour is that of f_dc"},
)


def gaussian_vertices(scene: Scene) -> NDArray[np.void]:
    """The vertices of a scene at one time; the colour residual is added to the coefficient of degree 0.

    scene     raw parameters of N Gaussians, from `scene_at`
    returns   (N,) records with the properties of the module docstring and normalised quaternions
    """
    harmonics = scene.harmonics if scene.residual is None else scene.harmonics.copy()
    if scene.residual is not None:
        harmonics[0] += scene.residual
    norm = np.maximum(np.linalg.norm(scene.quaternion, axis=0), LEAST_NORM)
    columns = dict(zip("xyz", scene.position))
    columns |= {name: np.zeros_like(scene.opacity_logit) for name in ("nx", "ny", "nz")}
    columns |= {f"f_dc_{k}": row for k, row in enumerate(harmonics[0])}
    rest = harmonics[1:].transpose(1, 0, 2).reshape(-1, scene.opacity_logit.size)
    columns |= {f"f_rest_{k}": row for k, row in enumerate(rest)}
    columns["opacity"] = scene.opacity_logit
    columns |= {f"scale_{k}": row for k, row in enumerate(scene.log_scale)}
    columns |= {f"rot_{k}": row for k, row in enumerate(scene.quaternion / norm)}
    return _records({name: np.asarray(column, "<f4") for name, column in columns.items()})


def point_vertices(scene: Scene, least_opacity: float) -> NDArray[np.void]:
    """The centres of the Gaussians with at least this opacity, with their degree-0 colour as 8-bit RGB."""
    opacity = 1 / (1 + np.exp(-scene.opacity_logit.astype(np.float64)))
    base = scene.harmonics[0] if scene.residual is None else scene.harmonics[0] + scene.residual
    chosen = opacity >= least_opacity
    levels = np.rint(np.clip(0.5 + Y00 * base[:, chosen], 0, 1) * 255).astype("u1")
    position = scene.position[:, chosen].astype("<f4")
    return _records(dict(zip("xyz", position)) | dict(zip(("red", "green", "blue"), levels)))


def _records(columns: dict[str, NDArray]) -> NDArray[np.void]:
    count = next(iter(columns.values())).size
    records = np.empty(count, [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        records[name] = column
    return records


def mesh_vertices(position: FloatArray, colours: NDArray[np.uint8]) -> NDArray[np.void]:
    """The vertices of a mesh: position (V, 3) and colour (V, 3)."""
    return _records(dict(zip("xyz", position.T.astype("<f4"))) | dict(zip(("red", "green", "blue"), colours.T)))


def write_ply(
    path: Path, vertices: NDArray[np.void], comments: Sequence[str] = (), faces: NDArray[np.int32] | None = None
) -> None:
    """Write vertices and optional triangles (F, 3) atomically.

    comments   lines; white space becomes a space, a character beyond ASCII a question mark
    """
    names = vertices.dtype.names or ()
    head = ["ply", "format binary_little_endian 1.0", *(f"comment {' '.join(line.split())}" for line in comments)]
    head += [f"element vertex {vertices.size}"]
    head += [f"property {TYPE_NAMES[vertices.dtype[name]]} {name}" for name in names]
    body = vertices.tobytes()
    if faces is not None:
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        triangles = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
        triangles["count"], triangles["corners"] = 3, faces
        body += triangles.tobytes()
    text = "\n".join([*head, "end_header", ""]).encode("ascii", "replace")
    replace_file(path, lambda temporary: temporary.write_bytes(text + body))


def read_gaussians(path: Path) -> Gaussians:
    """The Gaussians of a file, float32, without those with a number that is not finite.

    A property `filter_3D` of Mip-Splatting widens the Gaussians, as its program does before it renders them.

    Raises: InputError naming file and reason.
    """
    return read_gaussians_noted(path)[0]


def read_gaussians_noted(path: Path) -> tuple[Gaussians, list[str]]:
    """As `read_gaussians`, and notes on properties that are not used."""
    vertices, others = read_vertices(path, LARGEST_FILE)
    names = vertices.dtype.names or ()
    notes = GAUSSIAN.noted(names, path.name)
    if others:
        notes.append(f"{path.name}: not used: its {', '.join(others)}")
    if "scale_1" in names and "scale_2" not in names:
        raise InputError(f"{path}: property scale_2 is missing: flat Gaussians, as 2-D Gaussian splatting writes them;"
                         " use a 3-D Gaussian splatting file")  # fmt: skip
    try:
        found = _gaussians(vertices)
    except KeyError as error:
        raise InputError(f"{path}: property {error.args[0]} is missing; use a 3-D Gaussian splatting file") from None
    except ValueError as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    if "filter_3D" in names:
        found = _filtered(found, vertices["filter_3D"].astype(np.float64))
    return sound(found, path), notes


def _filtered(found: Gaussians, width: FloatArray) -> Gaussians:
    """The Gaussians convolved with one of standard deviation `width` (N,); the opacity keeps its integral.

    s' = sqrt(s^2 + w^2)        o' = o prod(s) / prod(s')
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # `sound` leaves out what is not finite
        wide = 0.5 * np.logaddexp(2 * found.log_scale, 2 * np.log(np.abs(width)))
        shrunk = (found.log_scale - wide).sum(axis=0)  # logarithm of the ratio of the opacities
        opacity = shrunk - np.logaddexp(0, -found.opacity_logit)  # logarithm: an opacity near 1 has no room in float64
        logit = np.where(shrunk == 0, found.opacity_logit, opacity - np.log(-np.expm1(opacity)))
    return found._replace(log_scale=wide, opacity_logit=logit)


def sound(found: Gaussians, path: Path) -> Gaussians:
    """The Gaussians with finite numbers only, float32. Raises InputError if there are none."""
    with np.errstate(over="ignore"):  # a float64 beyond the range of float32 becomes infinite, and is left out
        single = {name: a.astype(np.float32) for name, a in arrays(found).items()}
    keep = np.all([np.isfinite(a).reshape(-1, a.shape[-1]).all(axis=0) for a in single.values()], axis=0)
    if not keep.any():
        raise InputError(f"{path}: no Gaussian with finite numbers")
    return found._replace(**{name: np.ascontiguousarray(a[..., keep]) for name, a in single.items()})


def _gaussians(vertex: NDArray[np.void]) -> Gaussians:
    names = vertex.dtype.names or ()

    def columns(*wanted: str) -> FloatArray:
        for name in wanted:
            if name not in names:
                raise KeyError(name)
        return np.stack([vertex[name].astype(np.float64) for name in wanted])

    rest = [f"f_rest_{i}" for i in range(sum(name.startswith("f_rest_") for name in names))]
    if len(rest) not in REST:
        raise ValueError(f"{len(rest)} f_rest columns; 0, 9, 24 or 45 expected")
    coefficients = 1 + len(rest) // 3
    harmonics = np.empty((coefficients, 3, vertex.size))
    harmonics[0] = columns("f_dc_0", "f_dc_1", "f_dc_2")
    if rest:
        harmonics[1:] = columns(*rest).reshape(3, coefficients - 1, -1).transpose(1, 0, 2)
    return Gaussians(
        columns("x", "y", "z"), columns("rot_0", "rot_1", "rot_2", "rot_3"), columns("scale_0", "scale_1", "scale_2"),
        columns("opacity")[0], harmonics,
    )  # fmt: skip
