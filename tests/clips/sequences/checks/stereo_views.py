"""Stereo clips whose views are of other moments or rows, made from one texture, for tests that need files."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.sequence_file import CameraEntry, SequenceFile, write_sequence_file

WIDTH, HEIGHT, FRAMES = 240, 192, 12
DISPARITY = 18.0  # pixels in the middle of a picture
NOISE = 1.5  # grey levels
Place = Callable[[int], float]  # frame -> pixels

_ROUGH = gaussian_filter(np.random.default_rng(5).uniform(0, 255, (HEIGHT + 80, WIDTH + 160, 3)), (1.6, 1.6, 0))
TEXTURE = (_ROUGH - _ROUGH.min()) / np.ptp(_ROUGH) * np.array([215, 130, 110]) + 30


def sway(i: int) -> float:
    """Rows that the scene has moved by frame i."""
    return 14.0 * np.sin(0.3 * i)


@cache
def view(across: float, down: float, turn: float = 0.0) -> np.ndarray:
    """The texture, moved and turned about the middle of the picture by radians; pixels nearer at the bottom."""
    column, row = np.meshgrid(np.arange(WIDTH) - WIDTH / 2, np.arange(HEIGHT) - HEIGHT / 2)
    x, y = np.cos(turn) * column - np.sin(turn) * row, np.sin(turn) * column + np.cos(turn) * row
    places = [y + HEIGHT / 2 + 40 + down, x * (1 + across / 4000) + WIDTH / 2 + 80 + across * (1 + y / 900)]
    return np.stack([map_coordinates(TEXTURE[:, :, k], places, order=1, mode="nearest") for k in range(3)], axis=2)


def noisy(picture: np.ndarray, seed: int) -> np.ndarray:
    found = picture + np.random.default_rng(seed).normal(0, NOISE, picture.shape)
    return np.clip(np.rint(found), 0, 255).astype(np.uint8)


def pairs(
    late: int = 0, rows: float = 0.0, turn: float = 0.0, moves: Place = sway, shown: Callable[[int], int] = lambda i: i
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Left and right pictures of every frame.

    late, rows, turn   frames, pixels and radians by which the right view differs
    moves              rows that the scene has moved by a frame
    shown              frame -> the frame that the right view shows
    """
    found = []
    for i in range(FRAMES):
        k = shown(i) - late
        left, right = view(i, moves(i)), view(k + DISPARITY, moves(k) - rows, turn)
        found.append((noisy(left, i), noisy(right, 100 + k)))
    return found


def stereo_clip(folder: Path, views: list[tuple[np.ndarray, np.ndarray]]) -> Path:
    """A folder in the common format with these pairs, without depth and masks."""
    for name in ("images", "images_right"):
        (folder / name).mkdir(parents=True)
    for i, pair in enumerate(views):
        for name, picture in zip(("images", "images_right"), pair):
            write_png(folder / name / f"{i:06d}.png", picture)
    camera = CameraEntry(width=WIDTH, height=HEIGHT, fx=300.0, fy=300.0, cx=120.0, cy=96.0, baseline=4.0)
    write_sequence_file(SequenceFile(format="endotsr-sequence-1", frames=len(views), camera=camera), folder)
    return folder
