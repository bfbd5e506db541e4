"""Masks in NumPy files, as networks that segment write them: (n, H, W) for a clip, or (H, W) for a frame.

A plane of a file for a clip has the name `FILE/000003`, so that planes are listed, paired and read like files.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.depth_stacks import ENDINGS, array_of
from endotsr.errors import InputError

KINDS = "biuf"  # of numbers, as NumPy names them: truth values are masks too
LARGEST = np.iinfo(np.uint16).max


def in_array(path: Path) -> bool:
    """Whether this is a NumPy file, or a name of `stack_planes`."""
    return path.suffix.lower() in ENDINGS or (path.parent.suffix.lower() in ENDINGS and path.parent.is_file())


def array_plane(path: Path) -> NDArray:
    """The plane (H, W), uint8 or uint16, of a path for which `in_array` holds.

    Raises:  InputError for numbers that are not whole or not from 0 to 65535, and for a file of several frames.
    """
    file = path if path.suffix.lower() in ENDINGS else path.parent
    array = array_of(file, KINDS)
    if file is path and array.ndim != 2:
        raise InputError(f"{path}: array of shape {array.shape}; allowed here: one mask (height, width)")
    plane = array if file is path else array[int(path.name)]
    wrong = ~((plane >= 0) & (plane <= LARGEST) & (plane == np.round(plane)))  # NaN is neither
    if wrong.any():
        raise InputError(
            f"{path}: holds {plane[wrong][0]:g}; use whole numbers from 0 to {LARGEST}, or True and False;"
            f' a threshold makes a mask: numpy.save("{file.stem}.npy", array > {0 if np.nanmin(plane) < 0 else 0.5})'
        )
    return plane.astype(np.uint8 if array.dtype.itemsize == 1 else np.uint16)
