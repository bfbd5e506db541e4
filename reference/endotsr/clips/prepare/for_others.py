"""Descriptions of a sequence for other programs: nerfstudio and readers of COLMAP models.

In: a folder in the common format, whose pictures all programs share. Out: `transforms.json` with `masks_kept/`
(nerfstudio ignores black pixels), or `sparse/0/` with cameras, images and points3D as text. The points sample the prior
depth of some frames, for programs that start from points. `layouts.nerfstudio` and `layouts.colmap` read both formats.
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import Intrinsics, camera_to_world
from endotsr.clips.formats.choices import Other
from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.clip import REST, Clip
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence_file import DEPTH, IMAGES
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.names import counted
from endotsr.untrusted.writing import replace_text

KEPT, MODEL = "masks_kept", "sparse/0"
POINTS, FRAMES_OF_POINTS = 2000, 16  # points per frame, or up to twice as many; frames with points
THOUSANDTHS = 1e3  # nerfstudio reads depth in thousandths of the unit of its matrices


class SeenPoint(NamedTuple):
    """A point of the prior depth, and its position in the picture."""

    position: FloatArray  # (3,) in the unit of the sequence
    colour: NDArray[np.uint8]  # (3,)
    frame: int
    pixel: FloatArray  # (2,)


def describe_for(folder: Path, others: tuple[Other, ...]) -> list[str]:
    """Write the descriptions. Returns a note on each. Raises InputError."""
    clip, notes = describe(folder), []
    for name in others:
        notes.append(_nerfstudio(folder, clip) if name == "nerfstudio" else _colmap(folder, clip))
    return notes


def _intrinsics_and_poses(clip: Clip) -> tuple[Intrinsics, list[CameraPose]]:
    assert clip.intrinsics is not None
    return clip.intrinsics, [pose or REST for pose in clip.poses or [REST] * clip.count]


def _nerfstudio(folder: Path, clip: Clip) -> str:
    intrinsics, poses = _intrinsics_and_poses(clip)
    step = THOUSANDTHS * clip.depth.scale if clip.depth else 1.0
    if clip.masks is not None:
        (folder / KEPT).mkdir()
    frames = []
    for i, pose in enumerate(poses):
        name = clip.names[i]
        rotation, centre = camera_to_world(pose, "opengl")
        entry = {"file_path": f"{IMAGES}/{_file(folder, IMAGES, name)}"}
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation, centre / step
        if clip.masks is not None:
            tissue = clip.masks(i)
            assert tissue is not None
            write_png(folder / KEPT / f"{name}.png", tissue * np.uint8(255))
            entry["mask_path"] = f"{KEPT}/{name}.png"
        if clip.depth:
            entry["depth_file_path"] = f"{DEPTH}/{_file(folder, DEPTH, name)}"
        frames.append(entry | {"transform_matrix": matrix.tolist()})
    about = {"camera_model": "OPENCV"} | dict(zip(("fl_x", "fl_y", "cx", "cy", "w", "h"), intrinsics))
    about |= dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
    replace_text(folder / "transforms.json", json.dumps(about | {"frames": frames}, indent=1) + "\n")
    unit = "of the unknown unit" if clip.arbitrary else "mm"
    return f"transforms.json: lengths in {step:g} {unit}; a step of the depth files is a thousandth of this"


def _file(folder: Path, part: str, stem: str) -> str:
    """The file name of a frame."""
    return next(file.name for file in (folder / part).iterdir() if file.stem == stem)


def _colmap(folder: Path, clip: Clip) -> str:
    from scipy.spatial.transform import Rotation

    intrinsics, poses = _intrinsics_and_poses(clip)
    points = _points(clip, intrinsics, poses)
    place = folder / MODEL
    place.mkdir(parents=True)
    numbers = " ".join(repr(float(value)) for value in intrinsics[:4])
    replace_text(place / "cameras.txt", f"1 PINHOLE {intrinsics.width} {intrinsics.height} {numbers}\n")
    lines, seen = [], {i: [(k, p) for k, p in enumerate(points, 1) if p.frame == i] for i in range(len(poses))}
    for i, (pose, name) in enumerate(zip(poses, clip.names)):
        x, y, z, w = Rotation.from_matrix(pose.rotation).as_quat()
        values = " ".join(repr(float(value)) for value in (w, x, y, z, *pose.translation))
        lines.append(f"{i + 1} {values} 1 {_file(folder, IMAGES, name)}")
        lines.append(" ".join(f"{p.pixel[0]:.1f} {p.pixel[1]:.1f} {k}" for k, p in seen[i]))
    replace_text(place / "images.txt", "\n".join(lines) + "\n")
    first = {i: {k: n for n, (k, _) in enumerate(found)} for i, found in seen.items()}
    rows = [
        f"{k} {' '.join(f'{float(v):.9g}' for v in p.position)} {' '.join(map(str, p.colour))} 0 {p.frame + 1}"
        f" {first[p.frame][k]}"
        for k, p in enumerate(points, 1)
    ]
    replace_text(place / "points3D.txt", "\n".join(rows) + "\n")
    return (
        f"{MODEL}: {counted(len(poses), 'image')}, {counted(len(points), 'point')} of the prior depth, in the unit of"
        " sequence.toml"
    )


def _points(clip: Clip, intrinsics: Intrinsics, poses: list[CameraPose]) -> list[SeenPoint]:
    """Some tissue pixels with depth of some frames."""
    if clip.depth is None:
        return []
    chosen = even_frames(clip.count, FRAMES_OF_POINTS)
    found: list[SeenPoint] = []
    for i, pair in zip(chosen, clip.pictures(chosen)):
        depth, tissue = clip.depth(i), clip.masks(i) if clip.masks else None
        assert depth is not None
        places = np.flatnonzero((depth > 0) & (True if tissue is None else tissue))
        rows, columns = np.unravel_index(places[:: max(1, len(places) // POINTS)], depth.shape)
        rotation, centre = camera_to_world(poses[i])
        for row, column in zip(rows.tolist(), columns.tolist()):
            z, u, v = float(depth[row, column]), column + 0.5, row + 0.5
            view = np.array([(u - intrinsics.cx) * z / intrinsics.fx, (v - intrinsics.cy) * z / intrinsics.fy, z])
            found.append(SeenPoint(rotation @ view + centre, pair.left[row, column], i, np.array([u, v])))
    return found
