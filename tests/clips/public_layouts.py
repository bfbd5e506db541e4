"""Folders as the documentation of public data sets describes them, made from formulas."""

import io
import json
import tarfile
from pathlib import Path

import cv2
import numpy as np
from made_videos import picture, write

from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import write_png

WIDTH, HEIGHT, FRAMES = 128, 96, 4
K = np.array([[100.0, 0, 63.5], [0, 101.0, 47.5], [0, 0, 1]])  # of OpenCV: the middle of the picture
BASELINE = 5.0


def depth(i: int, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    return 40 + 20 * x / width + 5 * y / height + i


def poses() -> list[np.ndarray]:
    """World-to-camera, OpenCV axes: the camera moves to the right and turns a little."""
    found = []
    for i in range(FRAMES):
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(np.array([0.0, 0.01 * i, 0.02 * i]))[0]
        pose[:3, 3] = -2.0 * i, 0.3 * i, 0.0
        found.append(pose)
    return found


def hamlyn(folder: Path, names=("image01", "image02", "depth01"), columns: int = 4) -> None:
    for name in names:
        (folder / name).mkdir(parents=True)
    for i in range(FRAMES):
        write_jpeg(folder / names[0] / f"{i:010d}.jpg", picture(i))
        if len(names) > 2:
            write_jpeg(folder / names[1] / f"{i:010d}.jpg", picture(i))
        write_png(folder / names[-1] / f"{i:010d}.png", np.rint(depth(i)).astype(np.uint16))
    rows = np.column_stack([K, np.zeros(3)])[:, :columns]
    (folder / "intrinsics.txt").write_text("\n".join(" ".join(f"{v:.6f}" for v in row) for row in rows) + "\n")


def servct(folder: Path, cameras=(K,) * FRAMES) -> None:
    for name in ("Left_rectified", "Right_rectified", "Rectified_calibration", "Ground_truth_CT/DepthL"):
        (folder / name).mkdir(parents=True)
    for i in range(FRAMES):
        name = f"{i + 1:03d}"
        write_png(folder / "Left_rectified" / f"{name}.png", picture(i))
        write_png(folder / "Right_rectified" / f"{name}.png", picture(i))
        write_png(folder / "Ground_truth_CT/DepthL" / f"{name}.png", np.rint(depth(i) * 256).astype(np.uint16))
        left, right = np.column_stack([cameras[i], np.zeros(3)]), np.column_stack([cameras[i], np.zeros(3)])
        right[0, 3] = -cameras[i][0, 0] * BASELINE
        stored = {key: {"type_id": "opencv-matrix", "rows": 3, "cols": 4, "dt": "d", "data": matrix.ravel().tolist()}
                  for key, matrix in (("P1", left), ("P2", right))}  # fmt: skip
        (folder / "Rectified_calibration" / f"{name}.json").write_text(json.dumps(stored))


def stereo_yaml(path: Path, **matrices) -> None:
    """As cv2.FileStorage writes it."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in matrices.items():
        storage.write(name, value)
    storage.release()


def scared(folder: Path, archive: bool = True) -> None:
    (folder / "data").mkdir(parents=True)
    stacked = [np.vstack([picture(i), picture(i)]) for i in range(FRAMES)]
    write(folder / "data/rgb.mp4", stacked, options={"crf": "18"})
    nothing = np.zeros((1, 5))
    stereo_yaml(folder / "endoscope_calibration.yaml", M1=K, D1=nothing, M2=K, D2=nothing, R=np.eye(3),
                T=np.array([[-BASELINE], [0.0], [0.0]]))  # fmt: skip
    texts = {f"frame_data{i:06d}.json": json.dumps({"camera-pose": pose.tolist()}) for i, pose in enumerate(poses())}
    frame_data(folder, texts, archive)


def frame_data(folder: Path, texts: dict[str, str], archive: bool) -> None:
    """The files of the frames of SCARED, by name."""
    (folder / "data").mkdir(exist_ok=True)
    if archive:
        with tarfile.open(folder / "data/frame_data.tar.gz", "w:gz") as stored:
            for name, text in texts.items():
                entry = tarfile.TarInfo(name)
                entry.size = len(text)
                stored.addfile(entry, io.BytesIO(text.encode()))
    else:
        (folder / "data/frame_data").mkdir()
        for name, text in texts.items():
            (folder / "data/frame_data" / name).write_text(text)


def c3vd(folder: Path, frames: int = 2) -> None:
    folder.mkdir(parents=True)
    lines = []
    for i in range(frames):
        write_png(folder / f"{i}_color.png", picture(i, 1350, 1080))
        stored = np.rint(depth(i, 1350, 1080) * 65535 / 100).astype(np.uint16)
        stored[300:320] = 65535
        cv2.imwrite(str(folder / f"{i:04d}_depth.tiff"), stored)
        lines.append(",".join(f"{value:.9g}" for value in np.linalg.inv(poses()[i]).T.ravel()))
    (folder / "pose.txt").write_text("\n".join(lines) + "\n")


def nerfstudio(folder: Path, with_depth: bool = True, **changes) -> None:
    """Lengths of the matrices in metres, depth files in millimetres."""
    for name in ("images", "masks", "depth"):
        (folder / name).mkdir(parents=True)
    frames = []
    for i, pose in enumerate(poses()):
        write_png(folder / f"images/frame_{i:05d}.png", picture(i))
        mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
        mask[:, :40] = 0
        write_png(folder / f"masks/frame_{i:05d}.png", mask)
        write_png(folder / f"depth/frame_{i:05d}.png", np.rint(depth(i)).astype(np.uint16))
        matrix = np.linalg.inv(pose) @ np.diag([1.0, -1.0, -1.0, 1.0])
        matrix[:3, 3] /= 1000
        entry = {"file_path": f"./images/frame_{i:05d}.png", "mask_path": f"masks/frame_{i:05d}.png",
                 "transform_matrix": matrix.tolist()}  # fmt: skip
        frames.append(entry | ({"depth_file_path": f"depth/frame_{i:05d}.png"} if with_depth else {}))
    data = {"camera_model": "OPENCV", "fl_x": 100.0, "fl_y": 101.0, "cx": 64.0, "cy": 48.0, "w": WIDTH, "h": HEIGHT,
            "k1": 0.0, "frames": frames[::-1]}  # fmt: skip
    (folder / "transforms.json").write_text(json.dumps(data | changes))
