"""Arrays that other programs write: .npy without Python objects, and .pfm.

Comes in: a path; goes out: one array of real numbers. Raises an InputError that names the file and the reason.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.untrusted import arrays as untrusted
from endotsr.untrusted.files import read_bytes

LARGEST_FILE = 1 << 32  # bytes
PFM_HEADER = re.compile(rb"(P[Ff])\s+(\d{1,6})\s+(\d{1,6})\s+(-?\d*\.?\d+(?:[eE][-+]?\d+)?)\s")
ALLOWED = "allowed: an .npy file of numbers"


def read_npy(path: Path, largest: int = LARGEST_FILE, allowed: str = ALLOWED) -> NDArray:
    """The array of an .npy file. Pickled objects are never loaded.

    largest  bytes that the file may have
    allowed  what the message says of the files that can be read

    Raises:  InputError if the file is missing, no .npy file, truncated, or holds anything but real numbers.
    """
    try:
        array = untrusted.read_npy(Path(path), largest)
    except InputError as error:
        raise InputError(f"{error}; {allowed}") from None
    if array.dtype.kind not in "fiu":
        raise InputError(f"{path}: not one array of real numbers")
    return array


def read_pfm(path: Path) -> NDArray[np.float32]:
    """The plane (H, W) of a grey PFM file, top row first. Raises InputError for any other file."""
    data = read_bytes(Path(path), LARGEST_FILE)
    header = PFM_HEADER.match(data)
    if not header or header[1] != b"Pf":
        raise InputError(f"{path}: not a grey PFM file (its first bytes are not `Pf width height scale`)")
    width, height, scale = int(header[2]), int(header[3]), float(header[4])
    if len(data) - header.end() != 4 * width * height:
        raise InputError(
            f"{path}: {len(data) - header.end()} bytes of pixels, {width}x{height} need {4 * width * height}"
        )
    plane = np.frombuffer(data, "<f4" if scale < 0 else ">f4", offset=header.end()).reshape(height, width)
    return np.ascontiguousarray(plane[::-1], np.float32)  # the format stores the bottom row first
