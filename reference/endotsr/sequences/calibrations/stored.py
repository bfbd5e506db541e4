"""A calibration as it is stored, before it is of any picture."""

from typing import NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.kernels.arrays import FloatArray

HALF_A_PIXEL = "its pixel centres lie at integers, as those of OpenCV: half a pixel was added to cx and cy"


class Intrinsics(NamedTuple):
    """One camera, as stored."""

    matrix: FloatArray  # (3, 3) of OpenCV
    distortion: tuple[float, ...] = ()  # of OpenCV; empty or zeros: none
    size: tuple[int, int] | None = None  # width, height; None: the file does not say


class StoredCalibration(NamedTuple):
    """What a file holds."""

    left: Intrinsics
    right: Intrinsics | None = None
    rotation: FloatArray = np.eye(3)
    translation: FloatArray = np.zeros(3)  # millimetres


def distortion_of(numbers: FloatArray, where: str) -> tuple[float, ...]:
    """Four, five or eight coefficients; zeros beyond are dropped. Raises InputError for others."""
    values = [float(value) for value in numbers.ravel()]
    while len(values) > 4 and values[-1] == 0 and len(values) not in (5, 8):
        values.pop()
    if len(values) not in (0, 4, 5, 8):
        raise InputError(f"{where}: {len(values)} distortion coefficients; allowed: none, 4, 5 or 8")
    return tuple(values)
