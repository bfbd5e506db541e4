"""nerfstudio, instant-ngp and Blender: `transforms.json` or `transforms_train.json`.

The file holds intrinsics, camera-to-world matrices and names of pictures. Camera axes are OpenGL's, pixel edges are at
integers, masks are black on excluded pixels, and depth files store thousandths of the unit of the matrices before
`applied_scale`, which no field states. `FIELDS` lists all fields.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.formats.camera import (
    ARBITRARY,
    Intrinsics,
    checked_intrinsics,
    focal_length,
    pose_of,
    rows_of_motion,
    scene_factor,
    shared_intrinsics,
)
from endotsr.clips.formats.colmap_folders import unregistered
from endotsr.clips.formats.files import time_order
from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.formats.picture_fields import picture_notes
from endotsr.clips.formats.point_files import read_cloud
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.checks.frames import gap_findings
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import depth_of, masks_of, pictures_from_files, replaced, size_of, stated_masks
from endotsr.clips.sequences.times import usual_rate
from endotsr.clips.sequences.unread import folders_of, together
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.json import Keys, integer, listed, number, read_json
from endotsr.untrusted.names import choice, counted, relative_path, shown
from endotsr.untrusted.yaml import matrix

FILES = ("transforms.json", "transforms_train.json")
OTHERS = ("transforms_test.json", "transforms_val.json")
LARGEST_FILE = 1 << 28  # bytes
DEPTH_STEP = 1e-3  # units of the matrices per step of the stored depth
PATHS = ("file_path", "mask_path", "depth_file_path")
INTRINSICS = ("fl_x", "fl_y", "cx", "cy")
MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")
CAMERA = {
    "camera_model": f"camera model, {choice(MODELS)}",
    "fl_x fl_y cx cy": "focal lengths and principal point, pixels",
    "w h": "size of the pictures, pixels",
    "k1 k2 p1 p2 k3": "distortion in OpenCV's model",
    "camera_angle_x camera_angle_y": "field of view, radians, in place of fl_x and fl_y",
}
OTHER_CAMERA = {
    "k4 k5 k6": "a distortion of higher order is not supported: undistort the pictures first",
    "is_fisheye ftheta_* latlong equirectangular fisheye_crop_radius": "only pinhole cameras are supported: undistort"
    " the pictures first",
    "rolling_shutter": "a rolling shutter is not supported: export the matrices of a global shutter",
    "x_fov y_fov": "write the field of view as camera_angle_x, in radians",
}
SAME = "is part of the matrices already, and the unit of lengths is free"
FIELDS = Inventory(
    "transforms.json of nerfstudio, instant-ngp and Blender",
    used=CAMERA | {"frames": "one entry per picture", "ply_file_path": "points of a reconstruction, as prior depth",
                   "applied_scale": "lengths of the matrices over those of the depth files and points"},
    refused=OTHER_CAMERA
    | {"from_mitsuba": "these axes are not supported: convert the matrices to OpenGL's",
       "integer_depth_scale": "depth of instant-ngp is not read: write depth_file_path in thousandths of the unit",
       "n_extra_learnable_dims": "latent codes per picture are not supported"},
    harmless={
        "aabb aabb_scale render_aabb offset scale up": "the scene of another program has bounds; here it has none",
        "applied_transform orientation_override": SAME,
        "train_filenames val_filenames test_filenames": "the split is a setting here (sequence.split)",
        "white_transparent black_transparent sharpen is_hdr": "a setting of another program's pictures",
        "enable_depth_loading enable_ray_loading": "a switch of another program",
    },
    neutral={"from_mitsuba": (False,)},
)  # fmt: skip
FRAME_FIELDS = Inventory(
    "an entry of frames in transforms.json",
    used=CAMERA | {
        "file_path": "the picture; its ending may be missing",
        "transform_matrix": "camera-to-world, OpenGL axes",
        "mask_path": "mask, black = excluded",
        "depth_file_path": "depth in thousandths of the unit of the matrices before applied_scale",
        "time": "time of the picture; with --source-rate only its spacing counts",
    },
    refused=OTHER_CAMERA | {"depth_path": "depth of instant-ngp is not read: write it as depth_file_path"},
    harmless={
        "colmap_im_id camera_id": "a number of the reconstruction",
        "sharpness": "a measure of the picture, which changes no pixel",
        "rotation": "the step of Blender's turntable; transform_matrix contains it",
    },
)  # fmt: skip


def recognises(path: Path) -> bool:
    """Whether a path is such a file or its folder."""
    return path.name in FILES or any((path / name).is_file() for name in FILES)


def read_intrinsics(data: Keys, frame: Keys, size: tuple[int, int], where: str) -> Intrinsics:
    """The intrinsics of a frame, by default those of the file. Raises InputError."""
    found = data | frame
    if found.get("camera_model", MODELS[0]) not in MODELS:
        raise InputError(f"{where}: camera_model {found.get('camera_model')!r}; use {choice(MODELS)}")
    width, height = (integer(found.get(key, side), f"{where}: {key}", 1) for key, side in zip(("w", "h"), size))
    angles = {
        key: number(found[key], f"{where}: {key}", 1e-3, 3.14)
        for key in ("camera_angle_x", "camera_angle_y")
        if key in found
    }
    if "fl_x" not in found and "camera_angle_x" in angles:
        across = focal_length(angles["camera_angle_x"], width)
        down = focal_length(angles["camera_angle_y"], height) if "camera_angle_y" in angles else across
        found = {"fl_x": across, "fl_y": down, "cx": width / 2, "cy": height / 2} | found
    fx, fy, cx, cy = (
        number(found.get(key, found.get("fl_x") if key == "fl_y" else None), f"{where}: {key}") for key in INTRINSICS
    )
    bent = tuple(number(found.get(key, 0.0), f"{where}: {key}") for key in ("k1", "k2", "p1", "p2", "k3"))
    return checked_intrinsics(Intrinsics(fx, fy, cx, cy, width, height, bent if any(bent) else ()), where)


def describe_nerfstudio(path: Path, options: SourceOptions) -> Clip:
    """The file as a clip. Raises InputError naming the frame and the key."""
    file = path if path.is_file() else next((path / name for name in FILES if (path / name).is_file()), path / FILES[0])
    data, folder = read_json(file, LARGEST_FILE), file.parent
    entries, notes = _entries(data, file), FIELDS.noted(data, file)
    for entry in entries:
        notes += [note for note in FRAME_FIELDS.noted(entry, f"{file}: frames") if note not in notes]
    files = [_picture(folder, entry.get("file_path"), f"{file}: file_path") for entry in entries]
    order, times = time_order(files), _times(entries, options.rate, file, notes)
    if times is not None:
        order = np.argsort(times, kind="stable").tolist()
        times = times[order].astype(np.float64)
    files, entries = [files[i] for i in order], [entries[i] for i in order]
    width, height = size_of(files)
    cameras = [read_intrinsics(data, entry, (width, height), f"{file}: frame {i}") for i, entry in enumerate(entries)]
    masked, planes = ([_named(folder, entry.get(key), f"{file}: {key}") for entry in entries]
                      for key in ("mask_path", "depth_file_path"))  # fmt: skip
    masks = stated_masks(options, files, width, height)
    notes += [replaced("mask_path", "masks")] if masks and any(masked) else []
    unit = options.trajectory_unit or ARBITRARY
    factor, applied = scene_factor(unit), _applied_scale(data, file, notes)
    depth = depth_of(planes, DEPTH_STEP * factor * applied) if any(planes) else None
    cloud = None if depth is not None else _cloud(folder, data, file, notes)
    notes += _of_files(file, files)
    known = "unknown" if unit == ARBITRARY else unit
    return Clip(
        layout="nerfstudio",
        where=path,
        names=[name.stem for name in files],
        pictures=pictures_from_files(files, []),
        masks=masks or (masks_of(masked, "black", width, height) if any(masked) else None),
        depth=depth,
        points=None if cloud is None else lambda i: cloud * (factor * applied),
        unit=ARBITRARY if unit == ARBITRARY else "mm",
        intrinsics=shared_intrinsics(cameras, file, notes),
        poses=[_pose(entry, options, factor, f"{file}: frame {i}") for i, entry in enumerate(entries)],
        rate=options.rate or (None if times is None else usual_rate(times)),
        times=times,
        read_here=_places(entries, data),
        inside=_inside(file, files, masked, planes, _places(entries, data)),
        notes=[f"{file.name}: {counted(len(files), 'frame')}, unit of lengths {known}", *notes],
    )


def _of_files(file: Path, files: list[Path]) -> list[str]:
    """Notes on the pictures, on others beside them, and on further files of poses."""
    notes = picture_notes(files) + unregistered(files, f"listed in {file.name}")
    notes += [found.line for found in gap_findings(files)]
    if beside := [name for name in OTHERS if file.name == FILES[1] and (file.parent / name).is_file()]:
        notes.append(f"{file.name} is read; not read: {', '.join(beside)}")
    return notes


def _entries(data: Keys, file: Path) -> list[Keys]:
    """The entries of frames. Raises InputError."""
    entries = listed(data.get("frames"), f"{file}: frames")
    if not entries or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{file}: frames: use at least one object with file_path and transform_matrix")
    return entries


def _times(entries: list[Keys], rate: float | None, file: Path, notes: list[str]) -> FloatArray | None:
    """Seconds of the frames from the first one, in the order of the file; None unless every frame states a time.

    Raises:  InputError if two frames have one time.
    """
    if not all("time" in entry for entry in entries):
        if any("time" in entry for entry in entries):
            raise InputError(
                f"{file}: time: {sum('time' in e for e in entries)} of {len(entries)} frames have one; use all or none"
            )
        return None
    times = np.array([number(entry["time"], f"{file}: frame {i}: time") for i, entry in enumerate(entries)])
    if len(set(times.tolist())) < len(times):
        raise InputError(f"{file}: time: two frames have one time; use one camera")
    times = times - times.min()
    if rate and len(times) > 1:
        times *= (len(times) - 1) / rate / times.max()
    else:
        notes.append(f"time: read as seconds, {times.max():g} s in all; --source-rate states the mean rate instead")
    return times


def _cloud(folder: Path, data: Keys, file: Path, notes: list[str]) -> FloatArray | None:
    """The points (n, 3) that the file names, with a note; None without."""
    path = _named(folder, data.get("ply_file_path"), f"{file}: ply_file_path")
    if path is None:
        return None
    if not path.is_file():
        notes.append(f"ply_file_path: {path.name} is not there: no points")
        return None
    cloud, unused = read_cloud(path)
    notes += unused
    notes.append(f"{counted(len(cloud), 'point')}: the file does not state their visibility")
    return cloud


def _applied_scale(data: Keys, file: Path, notes: list[str]) -> float:
    """Lengths of the matrices over those of depth files and points, which nerfstudio multiplies by it; noted."""
    applied = number(data.get("applied_scale", 1.0), f"{file}: applied_scale", 1e-9, 1e9)
    if applied != 1.0:
        notes.append(f"applied_scale: depth files and points are multiplied by {applied:g}, as the matrices were")
    return applied


def _places(entries: list[Keys], data: Keys) -> tuple[str, ...]:
    """The first part of every path in the file."""
    names = [data.get("ply_file_path"), *(entry.get(key) for entry in entries for key in PATHS)]
    paths = {str(name).replace("\\", "/").removeprefix("./") for name in names if name is not None}
    return tuple({path.split("/")[0].lower() for path in paths} | {f"{path.lower()}.*" for path in paths})


def _inside(
    file: Path, pictures: list[Path], masks: list[Path | None], planes: list[Path | None], places: tuple[str, ...]
) -> dict[Path, tuple[str, ...]]:
    """The folders of the file and of all files that it names, see `unread`."""
    beside = {file.parent: (*LAYOUT.reads, *places)}
    return together(beside, folders_of([*pictures, *masks]), folders_of(planes, DEPTH_ENDINGS))


def _named(folder: Path, name: Any, where: str) -> Path | None:
    """The file of this name, which may be written with the separators of another system. Raises InputError."""
    if isinstance(name, str) and re.match(r"[/\\]|[A-Za-z]:", name):
        raise InputError(f"{where}: {shown(name)} is an absolute path; write it from the folder of the file")
    return None if name is None else folder / relative_path(str(name).replace("\\", "/").removeprefix("./"), where)


def _picture(folder: Path, name: Any, where: str) -> Path:
    """The file of a picture, whose ending may be missing. Raises InputError without a name."""
    path = _named(folder, name, where)
    if path is None:
        raise InputError(f"{where}: a frame has none; use the name of a picture in every entry")
    if path.suffix.lower() in PICTURE_ENDINGS:
        return path
    found = [path.with_name(path.name + ending) for ending in PICTURE_ENDINGS]
    return next((file for file in found if file.is_file()), path)


def _pose(entry: Keys, options: SourceOptions, factor: float, where: str) -> CameraPose:
    where += ": transform_matrix"
    turn, shift = rows_of_motion(matrix(entry.get("transform_matrix"), where, (4, 4), (3, 4)), where)
    return pose_of(turn, shift * factor, options.direction, options.axes or "opengl", where)


LAYOUT = Layout(
    name="nerfstudio",
    about=f"a folder with {FILES[0]} of nerfstudio",
    rank=3,
    recognises=recognises,
    describe=describe_nerfstudio,
    takes=("masks",),
    reads=("transforms*.json", "images_*", "masks_*", "depths_*", "colmap", "sparse", "*.db", "base_cam.json"),
)
