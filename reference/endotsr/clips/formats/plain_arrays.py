"""Arrays of real numbers from .npy and .pfm files."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.untrusted import arrays as untrusted
from endotsr.untrusted.files import read_bytes
from endotsr.untrusted.names import counted

LARGEST_FILE = 1 << 32  # bytes
PFM_HEADER = re.compile(rb"(P[Ff])\s+(\d{1,6})\s+(\d{1,6})\s+(-?\d*\.?\d+(?:[eE][-+]?\d+)?)\s")
ALLOWED = "use an .npy file of numbers"


def read_npy(path: Path, largest: int = LARGEST_FILE, allowed: str = ALLOWED) -> NDArray:
    """The array of real numbers in an .npy file. Pickled objects are never loaded.

    largest  size limit, bytes
    allowed  allowed files, for the message

    Raises:  InputError for a missing, invalid or truncated file, and for anything but real numbers.
    """
    try:
        array = untrusted.read_npy(Path(path), largest)
    except InputError as error:
        raise InputError(f"{error}; {allowed}") from None
    if array.dtype.kind not in "fiu":
        raise InputError(f"{path}: not one array of real numbers")
    return array


def read_pfm(path: Path) -> NDArray[np.float32]:
    """The plane (H, W) of a greyscale PFM file, top row first.

    Raises:  InputError for any other file, and for a scale factor, which some programs apply and others ignore.
    """
    data = read_bytes(Path(path), LARGEST_FILE)
    header = PFM_HEADER.match(data)
    if not header or header[1] != b"Pf":
        raise InputError(f"{path}: not a grey PFM file (its first bytes are not `Pf width height scale`)")
    width, height, scale = int(header[2]), int(header[3]), float(header[4])
    if abs(scale) != 1.0:
        raise InputError(
            f"{path}: its first lines state the scale factor {abs(scale):g}, which some programs apply and others"
            " ignore; use 1 or -1, with the values as they are meant"
        )
    if len(data) - header.end() != 4 * width * height:
        raise InputError(
            f"{path}: {counted(len(data) - header.end(), 'byte')} of pixels, {width}x{height} need {4 * width * height}"
        )
    plane = np.frombuffer(data, "<f4" if scale < 0 else ">f4", offset=header.end()).reshape(height, width)
    return np.ascontiguousarray(plane[::-1], np.float32)  # the format stores the bottom row first
