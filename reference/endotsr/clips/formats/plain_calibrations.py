"""Calibrations as plain numbers: fx, fy, cx, cy under these names, and NumPy files of a script that calibrates.

As in `calibration_formats`: a function per format returns None for a file in another one, and pixel centres are at
integers.
"""

from pathlib import Path

import numpy as np

from endotsr.clips.formats.calibration_fields import DISTORTIONS, FLAT
from endotsr.clips.formats.calibration_formats import (
    SIZES,
    Format,
    StoredCalibration,
    StoredIntrinsics,
    distortion_of,
    one_name,
    opencv_size,
)
from endotsr.errors import InputError
from endotsr.untrusted.arrays import RefusedArray, open_npz, read_npy
from endotsr.untrusted.json import Keys, number
from endotsr.untrusted.yaml import matrix

LARGEST_FILE = 1 << 26  # bytes, unpacked; scripts also save the corners of the boards
AXES = ("fx", "fy", "cx", "cy")
COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # in the order of OpenCV


def numpy_keys(path: Path) -> Keys:
    """The arrays of an .npz file as lists, as other calibration files give them; an .npy file is a camera matrix.

    Edges:   an array of anything but numbers is the text that says so, which no reader takes for a value.
    """
    if path.suffix.lower() == ".npy":
        return {"K": read_npy(path, LARGEST_FILE).tolist()}
    found: Keys = {}
    with open_npz(path, LARGEST_FILE, compressed=True) as file:
        for name in file.names:
            try:
                found[name] = file.read(name).tolist()
            except RefusedArray as error:
                found[name] = str(error)
    return found


def read_flat(path: Path, keys: Keys) -> StoredCalibration | None:
    """One camera from fx, fy, cx, cy, with width and height, and distortion as k1, k2, p1, p2, k3 .. k6 or as a list.

    Raises:  InputError for a part of the four numbers, for distortion in both forms, and for k4 without p1 and p2, as a
             fisheye model has it.
    """
    if not {"fx", "fy"} & set(keys):
        return None
    notes = FLAT.noted(keys, path)
    if missing := [name for name in AXES if name not in keys]:
        raise InputError(f"{path}: {', '.join(missing)} missing; use {', '.join(AXES)}, and width and height")
    fx, fy, cx, cy = (number(keys[name], f"{path}: {name}") for name in AXES)
    size = opencv_size(keys, path, (*SIZES, ("w", "h")))
    found = StoredIntrinsics(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]), _distortion(path, keys), size)
    return StoredCalibration(found, notes=tuple(notes))


def _distortion(path: Path, keys: Keys) -> tuple[float, ...]:
    """The coefficients in OpenCV's order. Raises InputError as `read_flat`."""
    single, listed = [name for name in COEFFICIENTS if name in keys], one_name(keys, DISTORTIONS, path)
    if single and listed:
        raise InputError(f"{path}: {single[0]} and {listed}: use one of the two forms of the distortion")
    if "k4" in single and not {"p1", "p2"} <= set(single):
        raise InputError(
            f"{path}: k4 without p1 and p2: a fisheye model is not supported: undistort the pictures first"
        )
    if listed:
        return distortion_of(matrix(keys[listed], f"{path}: {listed}", (-1,)), f"{path}: {listed}")
    count = len(COEFFICIENTS) if {"k4", "k5", "k6"} & set(single) else 5
    values = [number(keys.get(name, 0.0), f"{path}: {name}") for name in COEFFICIENTS[:count]]
    return distortion_of(np.array(values), f"{path}")


FORMATS = (Format("FILE.json with fx, fy, cx, cy, width, height [, k1, k2, p1, p2, k3]", read_flat),)
