"""The clip `sinus_endoscopy` as a `Sequence`: JPEG frames, one mask, poses, and sparse points instead of depth."""

from pathlib import Path

import numpy as np

from endotsr.clips.opencv import area_resize
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.splits import split_frames, time_stamps
from endotsr.method.splatting.camera import Camera

SHRINK = 3  # 1920x1080 to 640x360


def is_sinus(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return (folder / "cameras_points.npz").exists()


def read_sinus(folder: Path) -> Sequence:
    """All frames at 1/3 of the size; the depth of a frame is interpolated between its visible points."""
    from PIL import Image

    with np.load(folder / "cameras_points.npz") as stored:
        poses, k, points, visible = (stored[name] for name in ("w2c", "K", "points", "visible"))
    paths = sorted((folder / "images").iterdir())
    images = np.stack([_small(np.asarray(Image.open(path).convert("RGB"))) for path in paths])
    mask = (
        _small(np.repeat(np.asarray(Image.open(folder / "mask.png").convert("L"))[..., None], 3, axis=2))[..., 0] == 255
    )
    count, (height, width) = len(paths), mask.shape
    fx, fy, cx, cy = (float(x) / SHRINK for x in (k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5))
    cameras = [Camera(pose[:3, :3], pose[:3, 3], fx, fy, cx, cy, width, height) for pose in poses]
    depth = np.stack([_depth(camera, points[visible[:, i] > 0], mask) for i, camera in enumerate(cameras)])
    train, test = split_frames(count, "every_eighth", 8)
    return Sequence(
        images=np.ascontiguousarray(images.transpose(0, 3, 1, 2)),
        masks=np.broadcast_to(mask, (count, height, width)).copy(),
        depth=depth,
        times=time_stamps(count),
        cameras=cameras,
        names=[path.stem for path in paths],
        unit="units",
        static_camera=False,
        train_index=train,
        test_index=test,
    )


def _small(picture: np.ndarray) -> np.ndarray:
    return area_resize(picture, picture.shape[1] // SHRINK, picture.shape[0] // SHRINK)


def _depth(camera: Camera, points: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(H, W) float32; 0 outside the convex hull of the points."""
    from scipy.interpolate import griddata

    x, y, z = camera.rotation @ points.T + camera.translation[:, None]
    place = np.stack([camera.fy * y / z + camera.cy, camera.fx * x / z + camera.cx], axis=1) - 0.5
    rows, columns = np.indices(mask.shape)
    found = griddata(place, z, (rows, columns), method="linear", fill_value=0.0)
    return np.where(mask, found, 0.0).astype(np.float32)
