"""PNG files, and pictures in memory whose bytes were checked. The other kinds of pictures are those of `pictures`."""

from pathlib import Path

import numpy as np

from endotsr.clips.opencv.library import cv2_library
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import Array
from endotsr.untrusted.files import read_bytes
from endotsr.untrusted.png import LARGEST_FILE, pixels_only


def read_png(path: Path) -> Array:
    """Pixels of a PNG file.

    returns  (H, W) grey or (H, W, 3) RGB, uint8 or uint16 as stored

    Raises:  InputError naming the file if it is missing, no regular file, not a PNG, truncated, damaged, too large, or
             not opaque. The chunks and the number of compressed pixels are checked first, because OpenCV decodes a
             truncated file into a half-grey picture without an error.
    """
    return decode_png(read_bytes(path, LARGEST_FILE), path)


def write_png(path: Path, pixels: Array) -> None:
    """Write (H, W) grey or (H, W, 3) RGB pixels, uint8 or uint16. `read_png` returns the same array.

    Raises:  ValueError for another shape or dtype; InputError if the file cannot be written.
    """
    pixels = np.asarray(pixels)
    if pixels.dtype not in (np.uint8, np.uint16) or not (pixels.ndim == 2 or pixels.shape[2:] == (3,)):
        raise ValueError(f"{path}: PNG needs (H, W) or (H, W, 3) of uint8 or uint16, not {pixels.shape} {pixels.dtype}")
    write_encoded(path, pixels, ".png", ())


def decode_png(data: bytes, name: object) -> Array:
    """Pixels of a PNG in memory; `name` is used in messages only. See `read_png`."""
    return decoded(pixels_only(data, name), name, "cannot be decoded as a PNG picture")


def decoded(data: bytes, name: object, failure: str) -> Array:
    """Pixels of a picture in memory whose bytes were checked: (H, W) grey or (H, W, 3) RGB, in the stored type.

    failure   message for a picture that OpenCV cannot decode

    Raises:  InputError naming the picture.
    """
    cv2 = cv2_library()
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise InputError(f"{name}: cannot be decoded: {str(error).strip().splitlines()[-1]}") from None
    if pixels is None:
        raise InputError(f"{name}: {failure}")
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[:, :, 0]
    if pixels.ndim == 3:
        pixels = opaque(pixels, name)[:, :, ::-1]  # from BGR
    return np.ascontiguousarray(pixels)


def opaque(pixels: Array, name: object) -> Array:
    """The three colour channels of a picture (H, W, 3) or (H, W, 4). Raises InputError if a pixel is transparent."""
    if pixels.shape[2] == 4 and pixels.dtype.kind == "u" and pixels[:, :, 3].min() < np.iinfo(pixels.dtype).max:
        raise InputError(
            f"{name}: has transparent pixels, and what they hide is not shown; use pictures without"
            " transparency (a mask that is stored as transparency is stored as black and white)"
        )
    return pixels[:, :, :3]


def write_encoded(path: Path, pixels: Array, ending: str, options: tuple[int, ...]) -> None:
    """Write grey or RGB pixels in the format of an ending. Raises InputError if the file cannot be written."""
    ordered = np.ascontiguousarray(pixels[:, :, ::-1] if pixels.ndim == 3 else pixels)
    done, encoded = cv2_library().imencode(ending, ordered, options)
    if not done:
        raise InputError(f"{path}: the picture cannot be encoded as {ending[1:].upper()}")
    try:
        Path(path).write_bytes(encoded.tobytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
