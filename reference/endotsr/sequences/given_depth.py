"""Depth or disparity that another program wrote, as depth of a sequence in the common format.

Comes in: a folder of files (png, tiff, npy, pfm), one per frame, and what the numbers mean; goes out: depth (H, W) in
the unit of the sequence, 0 = none. Disparities are of the left picture, in pixels of the size of the file, positive (a
negative sign, as some programs write, is accepted if all are negative).
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.sequences.recording import Lens
from endotsr.sequences.smaller import nearest_pixels

Kind = Literal["depth", "disparity"]


def depth_of_values(
    values: NDArray, kind: Kind, scale: float, lens: Lens, baseline: float | None, where: object
) -> NDArray[np.float32]:
    """Depth from the stored numbers, at the size of the sequence.

    scale   of the stored numbers: lengths, or pixels of disparity, of one step

    Raises:  InputError for another proportion, disparities without a baseline, and files without any depth.
    """
    numbers = values.astype(np.float64) * scale
    numbers[~np.isfinite(numbers)] = 0.0
    if kind == "disparity":
        if not baseline:
            raise InputError(f"{where}: disparity needs the baseline: [camera] baseline is 0 in sequence.toml")
        if (numbers <= 0).all():
            numbers = -numbers
        focal = lens.fx * values.shape[1] / lens.width
        numbers = np.divide(focal * baseline, numbers, out=np.zeros_like(numbers), where=numbers > 0)
    depth = nearest_pixels(np.maximum(numbers, 0.0), lens.width, lens.height, where).astype(np.float32)
    depth[~np.isfinite(depth)] = 0.0
    return depth
