"""What to do with pictures of frames that are not RGB of 8 bits: the remedy of a refusal.

In: the pixels as stored. Out: the kind of the picture and its remedy, as the end of a message.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

WHITES = (255, 1023, 4095, 16383, 65535)  # largest numbers of 8, 10, 12, 14 and 16 bits
MOSAIC_FACTOR, MOSAIC_LEVELS = 2.0, 2.0  # neighbours against next neighbours; in levels of 255
COPY = "write copies by"
GREY = f"{COPY} Pillow, Image.open(A).convert('RGB').save(B)"
MOSAIC = (
    f"{COPY} cv2.imwrite(B, cv2.cvtColor(cv2.imread(A, -1), cv2.COLOR_BayerRGGB2BGR)), with the pattern of the sensor"
)
READ = "cv2.imread(A, -1)"
READ_GREY = f"{READ}[..., None].repeat(3, 2)"


def scaled(read: str = READ) -> str:
    """How copies of 8 bits are written; `read` gives their pixels."""
    return f"{COPY} cv2.imwrite(B, ({read} * F).clip(0, 255).round().astype('uint8')), with one F for all frames"


def remedy(pixels: NDArray[Any]) -> str:
    """Why this picture is no frame, and what to do.

    pixels   (H, W) of any type, or (H, W, 3) of another type than uint8
    """
    if pixels.dtype != np.uint8:
        copies, bits = scaled(READ_GREY if pixels.ndim == 2 else READ), 8 * pixels.dtype.itemsize
        return f"{bits}-bit picture; images must have 8 bits per channel: {copies}; {_factor(pixels)}"
    if np.unique(pixels).size <= 2:
        return f"grey picture of two values, as masks have them; images must be RGB: give masks by --masks, or {GREY}"
    if is_mosaic(pixels):
        return f"grey picture that seems to be the mosaic of a colour sensor; images must be RGB: {MOSAIC}"
    return f"grey picture; images must be RGB: {GREY}"


def is_mosaic(pixels: NDArray[np.uint8]) -> bool:
    """Whether every other pixel is alike and neighbours differ, along rows and columns: a Bayer mosaic."""
    levels = pixels.astype(np.float32)
    for plane in (levels, levels.T):
        if len(plane) < 3:
            return False
        near = float(np.abs(plane[1:] - plane[:-1]).mean())
        if near < MOSAIC_LEVELS or near < MOSAIC_FACTOR * float(np.abs(plane[2:] - plane[:-2]).mean()):
            return False
    return True


def _factor(pixels: NDArray[Any]) -> str:
    """The factor to 8 bits, by the largest number of a picture."""
    largest = float(np.nanmax(pixels))
    if np.issubdtype(pixels.dtype, np.floating):
        white = 1 if largest <= 1 else None
    else:
        white = next((white for white in WHITES if largest <= white), None)
    known = "" if white is None else f": F = 255/{white} if {white} is white"
    return f"the largest number here is {largest:g}{known}"
