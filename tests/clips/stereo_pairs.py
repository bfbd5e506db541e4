"""A pair of a slanted, textured plane with a known depth, and a folder with one."""

from pathlib import Path

import numpy as np
from common_folder import FRAMES, written
from scipy.ndimage import gaussian_filter, map_coordinates

from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.sequence_file import CameraEntry, SequenceFile, write_sequence_file

LENS = Intrinsics(300.0, 310.0, 80.0, 60.0, 160, 120)
BASELINE = 4.0
PLANE = (22.0, -0.02, 0.03)  # disparity = a + b column + c row: a slanted plane


def texture(column, row, seed=0):
    """A picture without repeats, sampled anywhere."""
    noise = gaussian_filter(np.random.default_rng(seed).uniform(0, 255, (160, 260, 3)), (1.2, 1.2, 0))
    noise = (noise - noise.min()) / np.ptp(noise) * 255
    places = [np.asarray(row) + 20, np.asarray(column) + 50]
    planes = [map_coordinates(noise[:, :, k], places, order=3, mode="nearest") for k in range(3)]
    return np.clip(np.rint(np.stack(planes, axis=2)), 0, 255).astype(np.uint8)


def slanted_pair(seed=0):
    """Left and right pictures of a slanted plane, and its true disparity in the left one."""
    column, row = np.meshgrid(np.arange(160.0), np.arange(120.0))
    a, b, c = PLANE
    there = (column + a + c * row) / (1 - b)  # the left column that the right column shows
    return texture(column, row, seed), texture(there, row, seed), a + b * column + c * row


def stereo_folder(folder: Path) -> None:
    """The slanted plane as a sequence of pairs."""
    written(folder, depth=False, masks=False, right=True)
    for i, (left, right, _) in enumerate(slanted_pair(i) for i in range(FRAMES)):
        write_png(folder / "images" / f"{i:06d}.png", left)
        write_png(folder / "images_right" / f"{i:06d}.png", right)
    fx, fy, cx, cy, width, height, _ = LENS
    camera = CameraEntry(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy, baseline=BASELINE)
    write_sequence_file(SequenceFile(format="endotsr-sequence-1", frames=FRAMES, camera=camera), folder)
