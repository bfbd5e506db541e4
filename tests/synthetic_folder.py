"""A small EndoNeRF folder made from formulas, for tests that need files."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

FOCAL = 30.0


class Written(NamedTuple):
    """What was written, in memory conventions."""

    images: NDArray[np.uint8]  # (n, 3, H, W)
    tissue: NDArray[np.bool_]  # (n, H, W)
    depth: NDArray[np.uint16]  # (n, H, W), 0 = missing
    rows: NDArray[np.float64]  # (n, 17)


def write_synthetic_folder(
    folder: Path,
    *,
    frames: int = 5,
    width: int = 32,
    height: int = 24,
    name: Callable[[int, str], str] = lambda i, kind: f"frame-{i:06d}.{kind}.png",
    excluded: str = "white",
    mask_folder: str = "masks",
    white: int = 255,
    depth_behind_tool: bool = False,
    rows: NDArray[np.float64] | None = None,
    pose_file: str = "poses_bounds.npy",
) -> Written:
    """Reddish pictures, a grey tool that moves along the top, whole-millimetre depth of 40 to 60.

    Depth is missing behind the tool (unless `depth_behind_tool`) and on two columns at the left, which stay tissue.
    """
    rng = np.random.default_rng(5)
    tissue = np.ones((frames, height, width), bool)
    images = rng.integers(0, 40, (frames, 3, height, width)).astype(np.uint8)
    images[:, 0] += 160
    images[:, 1:] += 60
    depth = rng.integers(40, 61, (frames, height, width)).astype(np.uint16)
    for i in range(frames):
        tissue[i, : height // 2, 2 + i : width // 2 + i] = False
        images[i, :, ~tissue[i]] = 120
    if not depth_behind_tool:
        depth[~tissue] = 0
    depth[:, :, :2] = 0
    masks = np.where(tissue == (excluded == "black"), white, 0).astype(np.uint8)
    for kind, sub, pictures in (
        ("color", "images", images.transpose(0, 2, 3, 1)[..., ::-1]),
        ("mask", mask_folder, masks),
        ("depth", "depth", depth),
    ):
        (folder / sub).mkdir(parents=True)
        for i in range(frames):
            assert cv2.imwrite(str(folder / sub / name(i, kind)), pictures[i])
    if rows is None:
        rows = identity_rows(frames, width, height)
    np.save(folder / pose_file, rows)
    return Written(images, tissue, depth, rows)


def identity_rows(frames: int, width: int, height: int, focal: float = FOCAL) -> NDArray[np.float64]:
    """Pose rows of one resting camera."""
    matrix = np.column_stack([np.eye(3), np.zeros(3), [height, width, focal]])
    return np.tile(np.concatenate([matrix.ravel(), [0.0, 100.0]]), (frames, 1))
