"""A camera matrix as text: three lines of three numbers, or of four as Hamlyn has them (the last column is 0)."""

from pathlib import Path
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.kernels.arrays import FloatArray
from endotsr.sequences.calibrations.stored import Intrinsics, StoredCalibration
from endotsr.untrusted.files import read_text

ABOUT = "FILE.txt with a camera matrix K of 3x3 numbers"
LARGEST_FILE = 1 << 16  # bytes


def read(path: Path, keys: dict[str, Any]) -> StoredCalibration | None:
    """One camera without distortion. Raises InputError."""
    return StoredCalibration(Intrinsics(read_matrix(path))) if path.suffix.lower() == ".txt" else None


def read_matrix(path: Path) -> FloatArray:
    """K (3, 3) in OpenCV's convention. Raises InputError naming what is allowed."""
    words = read_text(path, LARGEST_FILE).replace(",", " ").replace("[", " ").replace("]", " ").split()
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.size not in (9, 12) or not np.isfinite(numbers).all():
        raise InputError(f"{path}: {len(words)} words; allowed: a camera matrix of 3x3 or 3x4 finite numbers")
    rows = numbers.reshape(3, -1)
    if rows.shape[1] == 4 and rows[:, 3].any():
        raise InputError(f"{path}: the fourth column is not 0: a projection of another camera than the left one")
    if (rows[2, :3] != (0, 0, 1)).any() or rows[1, 0] != 0:
        raise InputError(f"{path}: allowed: rows `fx 0 cx`, `0 fy cy`, `0 0 1`")
    return rows[:, :3]
