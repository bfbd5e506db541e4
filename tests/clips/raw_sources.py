"""Recordings as other programs leave them, made by a script: StereoMIS, COLMAP, TUM, videos."""

import struct
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from endotsr.clips.opencv.png import write_png

WIDTH, HEIGHT = 64, 48
INI = """[StereoLeft]
res_x = 64
res_y = 48
fc_x = 60
fc_y = 61
cc_x = 31.0
cc_y = 24.5
{left}
[StereoRight]
res_x = 64
res_y = 48
fc_x = 62
fc_y = 60
cc_x = 33.0
cc_y = 23.0
{right}
{pose}
"""


def ini(left=(0.0,) * 8, right=(0.0,) * 8, rotation=None, translation=(-4.0, 0.0, 0.0)) -> str:
    """A calibration file."""
    rotation = np.eye(3) if rotation is None else rotation
    pose = [f"R_{k} = {v!r}" for k, v in enumerate(np.ravel(rotation).tolist())]
    pose += [f"T_{k} = {v!r}" for k, v in enumerate(translation)]
    coefficients = ["\n".join(f"kc_{k} = {v!r}" for k, v in enumerate(side)) for side in (left, right)]
    return INI.format(left=coefficients[0], right=coefficients[1], pose="\n".join(pose))


def scene_picture(i: int, shift: float = 0.0) -> NDArray[np.uint8]:
    """A smooth coloured picture that survives the compression of a video."""
    x, y = np.meshgrid(np.arange(WIDTH) + shift, np.arange(HEIGHT))
    red = 150 + 60 * np.sin(x / 7 + 0.3 * i) * np.cos(y / 9)
    return np.stack([red, 70 + 20 * np.cos(y / 8), np.full_like(red, 60.0)], axis=2).astype(np.uint8)


def write_video(path: Path, pictures: list[NDArray[np.uint8]], code: str = "FFV1", rate: float = 25.0) -> None:
    """A video; FFV1 in .avi or .mkv is lossless."""
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), rate, (width, height))  # pyright: ignore
    assert writer.isOpened()
    for picture in pictures:
        writer.write(np.ascontiguousarray(picture[:, :, ::-1]))
    writer.release()


def stereomis(folder: Path, frames: int = 6, code: str = "mp4v", calibration: str | None = None) -> None:
    """A StereoMIS folder: stacked video, ini, trajectory in metres, masks of the left picture at half size."""
    folder.mkdir(parents=True)
    stacked = [np.vstack([scene_picture(i), scene_picture(i, 5.0)]) for i in range(frames)]
    write_video(folder / "IFBS_part0001.mp4", stacked, code)
    (folder / "StereoCalibration.ini").write_text(calibration or ini())
    lines = [f"{i} {0.001 * i:.6f} 0 0 0 0 0 1" for i in range(frames)]
    (folder / "groundtruth.txt").write_text("\n".join(lines) + "\n")
    (folder / "masks").mkdir()
    for i in range(frames):
        mask = np.full((HEIGHT // 2, WIDTH // 2), 1, np.uint8)
        mask[:8, 4 : 10 + i] = 0
        write_png(folder / "masks" / f"{i:06d}l.png", mask)


def colmap(folder: Path, binary: bool, frames: int = 4) -> tuple[NDArray, list[tuple[NDArray, NDArray]]]:
    """A COLMAP model with pictures; returns the points (m, 3) and the poses (rotation, translation)."""
    rng = np.random.default_rng(2)
    points = rng.uniform([-3, -2, 8], [3, 2, 12], (40, 3))
    poses = []
    model = folder / "sparse" / "0"
    model.mkdir(parents=True)
    (folder / "images").mkdir()
    for i in range(frames):
        write_png(folder / "images" / f"frame{i:04d}.png", scene_picture(i))
        rotation = Rotation.from_euler("xyz", [0.02 * i, -0.03 * i, 0.01 * i])
        poses.append((rotation, np.array([0.1 * i, -0.05 * i, 0.02 * i])))
    write = _write_binary if binary else _write_text
    write(model, points, poses)
    return points, [(rotation.as_matrix(), translation) for rotation, translation in poses]


def _write_text(model: Path, points: NDArray, poses: list) -> None:
    (model / "cameras.txt").write_text("# a comment\n1 PINHOLE 64 48 60.0 61.0 30.0 25.0\n")
    lines = []
    for i, (rotation, translation) in enumerate(poses):
        x, y, z, w = rotation.as_quat().tolist()
        numbers = " ".join(repr(v) for v in (w, x, y, z, *translation.tolist()))
        lines.append(f"{i + 1} {numbers} 1 frame{i:04d}.png")
        lines.append(" ".join(f"1.5 2.5 {k}" for k in range(len(points))) + " 3.0 4.0 -1")
    (model / "images.txt").write_text("\n".join(lines) + "\n")
    rows = [f"{k} {' '.join(map(repr, p.tolist()))} 9 9 9 0.5 1 {k}" for k, p in enumerate(points)]
    (model / "points3D.txt").write_text("\n".join(rows) + "\n")


def _write_binary(model: Path, points: NDArray, poses: list) -> None:
    (model / "cameras.bin").write_bytes(struct.pack("<QiiQQ4d", 1, 1, 1, 64, 48, 60.0, 61.0, 30.0, 25.0))
    data = struct.pack("<Q", len(poses))
    for i, (rotation, translation) in enumerate(poses):
        x, y, z, w = rotation.as_quat()
        data += struct.pack("<i7di", i + 1, w, x, y, z, *translation, 1) + f"frame{i:04d}.png".encode() + b"\0"
        data += struct.pack("<Q", len(points) + 1)
        for k in (*range(len(points)), -1):
            data += struct.pack("<ddq", 1.5, 2.5, k)
    (model / "images.bin").write_bytes(data)
    data = struct.pack("<Q", len(points))
    for k, point in enumerate(points):
        data += struct.pack("<QdddBBBdQii", k, *point, 9, 9, 9, 0.5, 1, 1, k)
    (model / "points3D.bin").write_bytes(data)


def tum(folder: Path, frames: int = 5) -> None:
    """A TUM folder: timed pictures, depth in 5000 steps a metre, a trajectory at another rate."""
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    pictures, planes = ["# time file"], []
    for i in range(frames):
        write_png(folder / "rgb" / f"{i}.png", scene_picture(i))
        plane = np.full((HEIGHT, WIDTH), 300 + i, np.uint16)
        plane[0] = 200 + 5 * np.arange(WIDTH)  # a wall alone would be refused
        write_png(folder / "depth" / f"{i}.png", plane)
        pictures.append(f"{100 + i / 25:.6f} rgb/{i}.png")
        planes.append(f"{100.003 + i / 25:.6f} depth/{i}.png")
    (folder / "rgb.txt").write_text("\n".join(pictures))
    (folder / "depth.txt").write_text("\n".join(planes))
    lines = [f"{100 + k / 100:.4f} {0.002 * k:.6f} 0 0 0 0 0 1" for k in range(4 * frames)]
    (folder / "groundtruth.txt").write_text("\n".join(lines))
