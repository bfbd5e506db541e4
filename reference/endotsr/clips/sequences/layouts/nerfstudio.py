"""nerfstudio and instant-ngp: `transforms.json` with intrinsics, camera-to-world matrices and names of pictures.

Camera axes are OpenGL's, pixel edges are at integers, masks are black on excluded pixels, and depth files store
thousandths of the unknown unit of the matrices. `ply_file_path` names points of a reconstruction.
"""

from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.sequences.camera import ARBITRARY, CameraPose, Intrinsics, checked_intrinsics, pose_of
from endotsr.clips.sequences.checks.frames import gap_findings
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.files import time_order
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import depth_of, masks_of, pictures_from_files, size_of, stated_masks
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.files import read_bytes
from endotsr.untrusted.json import integer, listed, number, read_json
from endotsr.untrusted.names import relative_path
from endotsr.untrusted.yaml import matrix

FILE = "transforms.json"
LARGEST_FILE = 1 << 28  # bytes
DEPTH_STEP = 1e-3  # units of the matrices per step of the stored depth
INTRINSICS = ("fl_x", "fl_y", "cx", "cy")
MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")


def recognises(path: Path) -> bool:
    """Whether a path is such a file or its folder."""
    return path.name == FILE or (path / FILE).is_file()


def read_intrinsics(data: dict[str, Any], frame: dict[str, Any], size: tuple[int, int], where: str) -> Intrinsics:
    """The intrinsics of a frame, by default those of the file. Raises InputError."""
    found = data | frame
    if found.get("camera_model", MODELS[0]) not in MODELS or found.get("k4"):
        raise InputError(
            f"{where}: camera_model {found.get('camera_model')!r}; allowed: {', '.join(MODELS)}, without k4"
        )
    width, height = (integer(found.get(key, side), f"{where}: {key}", 1) for key, side in zip(("w", "h"), size))
    if "fl_x" not in found and "camera_angle_x" in found:
        angle = number(found["camera_angle_x"], f"{where}: camera_angle_x", 1e-3, 3.14)
        focal = width / 2 / np.tan(angle / 2)
        found = {"fl_x": focal, "fl_y": focal, "cx": width / 2, "cy": height / 2} | found
    fx, fy, cx, cy = (
        number(found.get(key, found.get("fl_x") if key == "fl_y" else None), f"{where}: {key}") for key in INTRINSICS
    )
    bent = tuple(number(found.get(key, 0.0), f"{where}: {key}") for key in ("k1", "k2", "p1", "p2", "k3"))
    return checked_intrinsics(Intrinsics(fx, fy, cx, cy, width, height, bent if any(bent) else ()), where)


def read_points(path: Path) -> FloatArray:
    """Points (n, 3) of an ASCII PLY file with first columns x y z. Raises InputError."""
    head, mark, body = read_bytes(path, LARGEST_FILE).decode("ascii", "replace").partition("end_header\n")
    if not mark or "format ascii" not in head:
        raise InputError(f"{path}: allowed: a PLY file in ASCII, as nerfstudio writes it")
    try:
        rows = np.array([line.split()[:3] for line in body.splitlines() if line.strip()], np.float64)
    except ValueError:
        rows = np.zeros((0, 0))
    if rows.ndim != 2 or rows.shape[1] != 3 or not np.isfinite(rows).all():
        raise InputError(f"{path}: allowed: lines of numbers that begin with x y z")
    return rows


def describe_nerfstudio(path: Path, options: SourceOptions) -> Clip:
    """The file as a clip. Raises InputError naming the frame and the key."""
    file = path if path.is_file() else path / FILE
    data, folder = read_json(file, LARGEST_FILE), file.parent
    entries = listed(data.get("frames"), f"{file}: frames")
    if not entries or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{file}: frames: allowed: at least one object with file_path and transform_matrix")
    files = [_named(folder, entry.get("file_path"), f"{file}: file_path") for entry in entries]
    files = [name for name in files if name is not None]
    if len(files) < len(entries):
        raise InputError(f"{file}: a frame has no file_path")
    order = time_order(files)
    files, entries = [files[i] for i in order], [entries[i] for i in order]
    masked, planes = ([_named(folder, entry.get(key), f"{file}: {key}") for entry in entries]
                      for key in ("mask_path", "depth_file_path"))  # fmt: skip
    width, height = size_of(files)
    lenses = {read_intrinsics(data, entry, (width, height), f"{file}: frame {i}") for i, entry in enumerate(entries)}
    if len(lenses) > 1:
        raise InputError(f"{file}: {len(lenses)} different cameras; allowed: one for all frames")
    masks = stated_masks(options, files, width, height)
    if masks is None and any(masked):
        masks = masks_of(masked, "black", width, height)
    points = _named(folder, data.get("ply_file_path"), f"{file}: ply_file_path")
    cloud = read_points(points) if points is not None and points.is_file() else None
    depth = depth_of(planes, DEPTH_STEP) if any(planes) else None
    return Clip(
        layout="nerfstudio",
        where=path,
        names=[name.stem for name in files],
        pictures=pictures_from_files(files, []),
        masks=masks,
        depth=depth,
        points=None if cloud is None or depth is not None else lambda i: cloud,
        unit=ARBITRARY,
        intrinsics=lenses.pop(),
        poses=[_pose(entry, f"{file}: frame {i}: transform_matrix") for i, entry in enumerate(entries)],
        rate=options.rate,
        notes=[f"{FILE}: {len(files)} frames, unit of lengths unknown"]
        + [found.line for found in gap_findings(files)]
        + ([] if cloud is None else [f"{len(cloud)} points: the file does not state their visibility"]),
    )


def _named(folder: Path, name: Any, where: str) -> Path | None:
    return None if name is None else folder / relative_path(str(name).removeprefix("./"), where)


def _pose(entry: dict[str, Any], where: str) -> CameraPose:
    stored = matrix(entry.get("transform_matrix"), where, (4, 4), (3, 4))
    return pose_of(stored[:3, :3], stored[:3, 3], "camera_to_world", "opengl", where)


LAYOUT = Layout(
    name="nerfstudio",
    about=f"a folder with {FILE} of nerfstudio",
    rank=3,
    recognises=recognises,
    describe=describe_nerfstudio,
    takes=("masks",),
)
