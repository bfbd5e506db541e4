"""What a training will need, estimated from the size of the sequence before anything is read whole."""

import os
from typing import NamedTuple

from endotsr.errors import InputError

BYTES_A_PIXEL = 3 + 1 + 4 + 1  # image, mask, depth, and the stored mask while it is read
WORKING = 1.6e9  # bytes of a training beside the sequence, for 640x512 pixels
PIXELS = 640 * 512
SECONDS = 0.1  # an iteration of 640x512 pixels on two cores


class Cost(NamedTuple):
    """Estimates for one training."""

    sequence_bytes: float
    total_bytes: float
    minutes: float  # on two cores


def estimated_cost(count: int, width: int, height: int, iterations: int, scale: float = 1.0) -> Cost:
    """The cost of `iterations` on `count` frames of this size, read at `scale`."""
    read = count * width * height * BYTES_A_PIXEL
    part = width * height * scale**2 / PIXELS
    return Cost(read, read + WORKING * max(part, 0.3), iterations * SECONDS * max(part, 0.1) / 60)


def memory_of_machine() -> float | None:
    """Bytes of memory of this machine; None where the system does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return None


def refuse_too_large(count: int, width: int, height: int, where: object) -> None:
    """Raises InputError for a sequence that does not fit into the memory of this machine, before it is read."""
    memory = memory_of_machine()
    needed = count * width * height * BYTES_A_PIXEL
    if memory is not None and needed > memory:
        raise InputError(
            f"{where}: {count} frames of {width}x{height} need {needed / 1e9:.1f} GB, this machine has"
            f" {memory / 1e9:.1f} GB; allowed: fewer --frames, or smaller pictures (endotsr prepare --scale)"
        )
