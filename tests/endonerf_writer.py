"""A sequence in memory as a folder in the layout of EndoNeRF, for tests that need files."""

from pathlib import Path

import numpy as np

from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.poses import rows_from_cameras
from endotsr.clips.sequences.sequence import Sequence


def write_endonerf(sequence: Sequence, folder: Path) -> None:
    """Write a sequence in this layout: images, depth as 16-bit whole millimetres, masks with white = excluded, poses.

    Depth is rounded, to no less than 1 where there is depth. Names become 000000.png, 000001.png, ...
    Raises:  InputError if a camera does not fit the format.
    """
    rows = rows_from_cameras(sequence.cameras, sequence.depth.reshape(sequence.count, -1).max(axis=1))
    for name in ("images", "masks", "depth"):
        (folder / name).mkdir(parents=True)
    np.save(folder / "poses_bounds.npy", rows)
    for i in range(sequence.count):
        depth = sequence.depth[i]
        millimetres = np.where(depth > 0, np.maximum(np.rint(depth), 1), 0).astype(np.uint16)
        write_png(folder / "images" / f"{i:06d}.png", sequence.images[i].transpose(1, 2, 0))
        write_png(folder / "masks" / f"{i:06d}.png", np.where(sequence.masks[i], 0, 255).astype(np.uint8))
        write_png(folder / "depth" / f"{i:06d}.png", millimetres)
