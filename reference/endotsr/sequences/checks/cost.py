"""What a training will need, estimated from the size of the sequence before anything is read whole."""

from typing import NamedTuple

from endotsr.kernels.memory import memory_limit
from endotsr.sequences.frame_store import PIXEL_BYTES

TARGET_BYTES = 7.3  # a pixel: what the losses keep of a training frame
BETWEEN_BYTES = 2 * 14.3  # a pixel: the two moments between neighbouring training frames, where they are targets too
WORKING = 1.2e9  # bytes of a training beside the frames, for 640x512 pixels
PIXELS = 640 * 512
SECONDS = 0.1  # an iteration of 640x512 pixels on two cores


class Cost(NamedTuple):
    """Estimates for one training."""

    sequence_bytes: float  # of the frames as read
    total_bytes: float  # of memory; frames that lie in a file take none
    file_bytes: float  # of the file of the frames; 0 = they are in memory
    minutes: float  # on two cores


def estimated_cost(
    count: int, width: int, height: int, iterations: int, scale: float = 1.0, memory: float = 0.0, between: bool = False
) -> Cost:
    """The cost of `iterations` on `count` frames of this size, read at `scale`.

    memory   `sequence.memory`, GB; 0 = half of this machine's
    between  whether moments between the frames are targets too (`training.bridge_fraction`)
    """
    limit, read = memory_limit(memory), count * width * height * PIXEL_BYTES
    part = width * height * scale**2 / PIXELS
    in_file = read > limit / 2
    kept = min(count * part * PIXELS * TARGET_BYTES, limit / 4)
    kept += min(count * part * PIXELS * BETWEEN_BYTES, limit / 4) if between else 0.0
    small = part * PIXELS * count * PIXEL_BYTES if scale != 1.0 else 0.0  # both sizes exist while frames are scaled
    total = (0 if in_file else read) + min(small, limit / 2) + kept + WORKING * max(part, 0.3)
    return Cost(read, total, read if in_file else 0.0, iterations * SECONDS * max(part, 0.1) / 60)
