"""Trained splats as arrays of an npz file.

The arrays are xyz (N, 3), log_scale (N, 3), quat_wxyz (N, 4), rgb (N, 3) and opacity (N,).
"""

from pathlib import Path

import numpy as np

from endotsr.errors import InputError
from endotsr.untrusted.arrays import RefusedArray, open_npz

ARRAYS = {"xyz": (3,), "log_scale": (3,), "quat_wxyz": (4,), "rgb": (3,), "opacity": ()}
LARGEST_FILE = 1 << 32  # bytes


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a trained scene.

    Raises: InputError naming the file, and the array that is missing or has the wrong shape.
    """
    try:
        with open_npz(path, LARGEST_FILE, compressed=True) as file:
            found = {name: file.read(name) for name in ARRAYS}
    except InputError:
        raise
    except (RefusedArray, KeyError) as error:
        reason = f"{error.args[0]} is missing" if isinstance(error, KeyError) else error
        raise InputError(f"{path}: not a trained scene: {reason}; use an npz with {', '.join(ARRAYS)}") from None
    for name, rest in ARRAYS.items():
        expected = (*(found["xyz"].shape[:1] or (0,)), *rest)
        if found[name].shape != expected:
            raise InputError(f"{path}: {name} has shape {found[name].shape}; use {expected}")
    return found
