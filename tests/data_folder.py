"""Where the real sequences are, for tests that need them: ENDOTSR_DATA or ../shared/data beside the repository."""

import os
from pathlib import Path

import numpy as np
import pytest


def data_folder(name: str) -> Path:
    """The folder `name` of the real data, or a skip that says what is missing."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    root = Path(os.environ.get("ENDOTSR_DATA", beside))
    folder = root / name
    if not folder.exists():
        pytest.skip(f"real data not found: {folder} (set ENDOTSR_DATA)")
    return folder


def first_frames(clip: str, count: int, folder: Path) -> Path:
    """A folder with the first frames of an EndoNeRF clip and their right views, or a skip."""
    given = data_folder(clip)
    for part in ("images", "images_right", "masks", "depth"):
        (folder / part).mkdir(parents=True)
        for file in sorted((given / part).iterdir())[:count]:
            (folder / part / file.name).symlink_to(file)
    np.save(folder / "poses_bounds.npy", np.load(given / "poses_bounds.npy")[:count])
    return folder


def recorded_masks(clip: str, folder: str) -> list[np.ndarray]:
    """The masks of a folder of an EndoNeRF clip, (H, W) each, True = tissue, or a skip."""
    from endotsr.clips.opencv.png import read_png

    masks = [read_png(file) for file in sorted((data_folder(clip) / folder).iterdir())]
    return [(mask if mask.ndim == 2 else mask[..., 0]) < 128 for mask in masks]
