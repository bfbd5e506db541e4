"""Whether the pictures of another program agree better with the frames after an exchange of channels or a turn.

In: pictures of held-out frames, and the frames. Out: a sentence, or none.
"""

from collections.abc import Callable

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.baselines import unit_image

LOOKED_AT = 3  # held-out frames
CLEARLY = 0.25  # of the mean squared error as stored: an exchange within this part of it is named
FINEST = 1e-6  # display units, squared; below the rounding of 8 bits
OTHERS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "with red and blue exchanged": lambda picture: picture[::-1],
    "upside down": lambda picture: picture[:, ::-1],
    "mirrored": lambda picture: picture[:, :, ::-1],
    "turned by 180 degrees": lambda picture: picture[:, ::-1, ::-1],
}


def turned_remark(read: Callable[[int], FloatArray], sequence: Sequence) -> str:
    """The sentence on pictures that are clearly nearer to their frames in another order; empty without one.

    read   the picture (3, H, W) of a frame, display units
    """
    frames = [int(i) for i in sequence.test_index if sequence.masks[i].any()][:LOOKED_AT]
    if not frames:
        return ""
    pictures = [read(i) for i in frames]
    stored = _error(pictures, sequence, frames)
    found = {name: _error(list(map(turn, pictures)), sequence, frames) for name, turn in OTHERS.items()}
    name = min(found, key=lambda key: found[key])
    if not found[name] < CLEARLY * stored:
        return ""
    gain = 10 * np.log10(stored / max(found[name], FINEST))
    return f"warning: {name}, the pictures agree with the frames better by {gain:.1f} dB than as they are stored"


def _error(pictures: list[FloatArray], sequence: Sequence, frames: list[int]) -> float:
    """Mean squared error on the tissue of all frames, display units."""
    off = [(picture - unit_image(sequence, i))[:, sequence.masks[i]] for picture, i in zip(pictures, frames)]
    return float(np.mean(np.concatenate(off, axis=1).astype(np.float64) ** 2))
