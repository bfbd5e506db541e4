"""Pictures with cameras and points in one file: `images/` and `cameras_points.npz`.

cameras_points.npz   w2c (n, 4, 4) world-to-camera, OpenCV axes; K (3, 3), OpenCV's convention; frame_ids (n,);
                     points (m, 3) and visible (m, n) of a reconstruction of unknown scale
mask.png             white = inside the field of view, one for all frames (optional)
"""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.camera import ARBITRARY, checked_rotation, intrinsics_of_matrix, rows_of_motion
from endotsr.clips.formats.files import frame_numbers, list_pictures
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import masks_of, pictures_from_files, replaced, size_of, stated_masks
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.arrays import read_npz
from endotsr.untrusted.names import counted

CAMERAS = "cameras_points.npz"
LARGEST_FILE = 1 << 31  # bytes, of the arrays together as well
KEYS = ("w2c", "K", "points", "visible", "frame_ids")


def recognises(path: Path) -> bool:
    """Whether a path is a folder with images/ and the file of cameras and points."""
    return (path / CAMERAS).is_file() and (path / "images").is_dir()


def read_cameras(path: Path, frames: list[Path]) -> dict[str, np.ndarray]:
    """The arrays of the file, checked against the frames. Raises InputError."""
    found = read_npz(path, KEYS, LARGEST_FILE)
    missing = [key for key in KEYS if key not in found]
    if missing:
        raise InputError(f"{path}: {', '.join(missing)} missing; use an npz with {', '.join(KEYS)}")
    n, m = len(frames), len(found["points"]) if found["points"].ndim else 0
    shapes = {"w2c": (n, 4, 4), "K": (3, 3), "points": (m, 3), "visible": (m, n), "frame_ids": (n,)}
    for key, shape in shapes.items():
        if found[key].shape != shape:
            raise InputError(f"{path}: {key} has shape {found[key].shape}; expected {shape} for {n} pictures")
        if found[key].dtype.kind not in "fiub" or not np.isfinite(found[key]).all():
            raise InputError(f"{path}: {key} holds values that are not finite numbers; use finite ones")
    numbers = frame_numbers(frames)
    if numbers is None or [number[-1] for number in numbers] != found["frame_ids"].tolist():
        raise InputError(
            f"{path}: frame_ids are not the numbers in the names of images/; use one for each picture, in their order"
        )
    return found


def describe_points(path: Path, options: SourceOptions) -> Clip:
    """The folder as a clip. Raises InputError."""
    frames = list_pictures(path / "images", PICTURE_ENDINGS)
    found = read_cameras(path / CAMERAS, frames)
    width, height = size_of(frames)
    where = path / CAMERAS
    poses: list[CameraPose | None] = [
        CameraPose(checked_rotation(turn, f"{where}: w2c: frame {i}"), shift)
        for i, matrix in enumerate(found["w2c"].astype(np.float64))
        for turn, shift in [rows_of_motion(matrix, f"{where}: w2c: frame {i}")]
    ]
    mask = path / "mask.png"
    inside = masks_of([mask] * len(frames), "black", width, height) if mask.is_file() else None
    masks = stated_masks(options, frames, width, height)
    notes = [replaced(mask.name, "masks")] if masks and inside else []
    visible, points = found["visible"].astype(bool), found["points"].astype(np.float64)
    return Clip(
        layout="points",
        where=path,
        names=[file.stem for file in frames],
        pictures=pictures_from_files(frames, []),
        masks=masks or inside,
        points=lambda i: points[visible[:, i]],
        unit=ARBITRARY,
        intrinsics=intrinsics_of_matrix(found["K"], width, height, where=where),
        poses=poses,
        rate=options.rate,
        notes=[
            f"{CAMERAS}: {counted(len(points), 'point')}, on average {visible.sum(axis=0).mean():.0f} in a frame",
            *notes,
        ],
    )


LAYOUT = Layout(
    name="points",
    about=f"a folder with images/ and {CAMERAS}",
    rank=2,
    recognises=recognises,
    describe=describe_points,
    takes=("masks",),
    reads=(
        "images",
        "cameras_points.npz",
        "mask.png",
    ),
)
