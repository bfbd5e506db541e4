"""A small folder in the common format, made from formulas, for tests that need files."""

from pathlib import Path

import numpy as np

from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.sequence_file import CameraEntry, DepthEntry, MaskEntry, PoseEntry, SequenceFile
from endotsr.clips.sequences.sequence_file import write_sequence_file as write_file

WIDTH, HEIGHT, FRAMES = 32, 24, 5


def written(folder: Path, *, masks=True, depth=True, right=False, poses=None, **changes) -> SequenceFile:
    """Reddish pictures with a grey tool, depth of 40 to 60 mm stored in steps of 0.01; returns the file written."""
    rng = np.random.default_rng(3)
    for name in ("images", *("images_right",) * right, *("masks",) * masks, *("depth",) * depth):
        (folder / name).mkdir(parents=True)
    for i in range(FRAMES):
        picture = rng.integers(0, 40, (HEIGHT, WIDTH, 3)).astype(np.uint8) + np.array([160, 60, 60], np.uint8)
        tool = np.zeros((HEIGHT, WIDTH), bool)
        tool[: HEIGHT // 2, 2 + i : WIDTH // 2 + i] = True
        picture[tool] = 120
        write_png(folder / "images" / f"{i:06d}.png", picture)
        if right:
            write_png(folder / "images_right" / f"{i:06d}.png", picture)
        if masks:
            write_png(folder / "masks" / f"{i:06d}.png", np.where(tool, 255, 0).astype(np.uint8))
        if depth:
            plane = np.where(tool, 0, rng.integers(4000, 6000, (HEIGHT, WIDTH))).astype(np.uint16)
            write_png(folder / "depth" / f"{i:06d}.png", plane)
    found = SequenceFile(
        **{
            "format": "endotsr-sequence-1",
            "frames": FRAMES,
            "camera": CameraEntry(width=WIDTH, height=HEIGHT, fx=30.0, fy=33.0, cx=15.0, cy=13.0, baseline=4.0),
            "masks": MaskEntry() if masks else None,
            "depth": DepthEntry(scale=0.01) if depth else None,
            "poses": PoseEntry(matrices=poses) if poses is not None else None,
        }
        | changes
    )
    write_file(found, folder)
    return found


def moving(offset=(0.0, 0.0, 0.0), step=2.0) -> list[list[float]]:
    """World-to-camera rows of a camera that moves to the right, its centre starting at `offset`."""
    return [
        [1.0, 0.0, 0.0, -(offset[0] + step * i), 0.0, 1.0, 0.0, -offset[1], 0.0, 0.0, 1.0, -offset[2]]
        for i in range(FRAMES)
    ]


def write_plane(path: Path, plane: np.ndarray) -> None:
    if path.suffix == ".npy":
        np.save(path, plane)
    elif path.suffix == ".pfm":
        header = f"Pf\n{plane.shape[1]} {plane.shape[0]}\n-1.0\n".encode()
        path.write_bytes(header + plane[::-1].astype("<f4").tobytes())
    else:
        from PIL import Image

        Image.fromarray(plane).save(path)
