"""Depth of a whole clip in one file: an .npz or .npy array (n, H, W), as networks for videos write it; .mat of a frame.

A plane of such a file has the name `FILE/000003`, so that planes are listed, paired and read like files.
"""

import os
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.conversions import stack_conversion
from endotsr.errors import InputError
from endotsr.untrusted.arrays import RefusedArray, open_npz, read_npy
from endotsr.untrusted.files import open_regular
from endotsr.untrusted.matlab import read_mat

ENDINGS = (".npz", ".npy")
LARGEST_FILE = 1 << 34  # bytes
MATLAB = ".mat"  # one frame: MATLAB stores frames last, and others first
ONE = "use one array of real numbers, (frames, height, width) for a clip or (height, width) for a frame"


def stack_planes(path: Path, kinds: str = "fiu") -> list[Path] | None:
    """The names of the planes of a file that holds those of a clip; None for any other path. Raises InputError.

    kinds    as in `array_of`
    """
    if path.suffix.lower() not in ENDINGS or not path.is_file():
        return None
    array = array_of(path, kinds)
    return [path / f"{k:06d}" for k in range(len(array))] if array.ndim == 3 else None


def plane_of_stack(path: Path) -> NDArray | None:
    """The plane (H, W) with a name of `stack_planes`; None for any other path. Raises InputError."""
    file = path.parent
    if file.suffix.lower() not in ENDINGS or not file.is_file():
        return None
    return array_of(file)[int(path.name)]


def array_of(path: Path, kinds: str = "fiu") -> NDArray:
    """The array of an .npz or .npy file, (n, H, W) or (H, W), or of a .mat file, (H, W); axes of length 1 are dropped.

    kinds    the kinds of numbers that count, as NumPy names them

    Edges:   an array with a side of 2 or 3, as colours and matrices have, does not count: a clip of two or three frames
             is not read.
    Raises:  InputError for a file without exactly one such array, and for what is no regular file.
    """
    with open_regular(path, LARGEST_FILE) as file:
        status = os.fstat(file.fileno())
    return _array(path, status.st_mtime_ns, status.st_size, kinds)


@lru_cache(maxsize=2)  # depth and masks of a clip
def _array(path: Path, changed: int, size: int, kinds: str) -> NDArray:
    if path.suffix.lower() == ".npy":
        arrays = {path.name: read_npy(path, LARGEST_FILE)}
    elif path.suffix.lower() == MATLAB:
        arrays = {name: array for name, array in read_mat(path).items() if isinstance(array, np.ndarray)}
    else:
        try:
            with open_npz(path, LARGEST_FILE, compressed=True) as file:
                arrays = {name: file.read(name) for name in file.names}
        except RefusedArray as error:
            raise InputError(f"{path}: {error}; {ONE}") from None
    planes = {name: np.squeeze(array) for name, array in arrays.items() if array.dtype.kind in kinds}
    planes = {name: array for name, array in planes.items() if array.ndim in (2, 3) and min(array.shape) > 3}
    several = next((name for name, array in planes.items() if array.ndim == 3), None)
    if path.suffix.lower() == MATLAB and several is not None:
        raise InputError(
            f"{path}: holds an array of several frames; use one file of (height, width) per frame, or in Python:"
            f" `{stack_conversion(path, several)}` if its last axis is that of the frames"
        )
    if len(planes) != 1:
        held = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "nothing"
        raise InputError(f"{path}: holds {held}; {ONE}")
    return next(iter(planes.values()))
