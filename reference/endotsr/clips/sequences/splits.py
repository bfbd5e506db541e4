"""The range of frames that is selected, and its split into training and held-out frames.

In: the number of frames. Out: a range, and the split as ascending frame numbers (train (n_train,), test (n_test,)). A
range is applied before the split. The split counts frames. It does not depend on their pictures or times.
"""

import numpy as np

from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import IndexArray
from endotsr.untrusted.names import counted

LEAST_FRAMES = 3
LEAST_TRAINING_FRAMES = 2
LEAST_BLOCK_PERIOD = 24


def every_eighth(count: int) -> tuple[IndexArray, IndexArray]:
    """The published split: frame i is held out when (i - 1) % 8 == 0, that is 1, 9, 17, ..."""
    index = np.arange(count)
    held_out = (index - 1) % 8 == 0
    return index[~held_out], index[held_out]


def blocks(count: int, length: int) -> tuple[IndexArray, IndexArray]:
    """Contiguous held-out blocks, which the mean of the two neighbouring frames cannot predict.

    The sequence is divided into periods of max(24, 2 length) frames, and a block of `length` frames is held out in the
    middle of each. A block without a training frame after it is dropped: held-out frames always have training frames on
    both sides.

    Raises:  InputError if no block fits.
    """
    period = max(LEAST_BLOCK_PERIOD, 2 * length)
    first = (period - length) // 2
    held_out = np.zeros(count, bool)
    for start in range(first, count - length, period):
        held_out[start : start + length] = True
    if not held_out.any():
        raise InputError(
            f"split blocks: no held-out block of {length} frames fits into {counted(count, 'frame')};"
            f" at least {first + length + 1} frames are needed"
        )
    index = np.arange(count)
    return index[~held_out], index[held_out]


def every_second(count: int) -> tuple[IndexArray, IndexArray]:
    """Frames 1, 3, 5, ... are held out: a clip at half its frame rate."""
    index = np.arange(count)
    return index[::2], index[1::2]


def end_of_clip(count: int, length: int) -> tuple[IndexArray, IndexArray]:
    """The last `length` frames are held out: the model has to extrapolate.

    Raises:  InputError if fewer than 2 training frames remain.
    """
    first = count - length
    if first < LEAST_TRAINING_FRAMES:
        raise InputError(
            f"split end: {length} held-out frames of {count}; at least {LEAST_TRAINING_FRAMES} are needed for training"
        )
    index = np.arange(count)
    return index[:first], index[first:]


def too_few(count: int) -> str:
    """Why a training needs more frames than `count`; "" if these suffice."""
    number = "1 frame is" if count == 1 else f"{count} frames are"
    return f"{number} too few: at least {LEAST_FRAMES} are needed" if count < LEAST_FRAMES else ""


def split_frames(count: int, split: str, block_length: int) -> tuple[IndexArray, IndexArray]:
    """The split named in the configuration.

    Raises:  InputError if there are fewer than 3 frames, fewer than 2 training frames, or no block fits.
    """
    if few := too_few(count):
        raise InputError(few)
    if split == "blocks":
        train, test = blocks(count, block_length)
    elif split == "end":
        train, test = end_of_clip(count, block_length)
    else:
        train, test = every_second(count) if split == "every_second" else every_eighth(count)
    if len(train) < LEAST_TRAINING_FRAMES:
        raise InputError(
            f"the split {split} leaves {len(train)} training frames: at least {LEAST_TRAINING_FRAMES} are needed"
        )
    return train, test


def selected_frames(config: SequenceConfig, count: int, where: object) -> range:
    """The frames that a configuration selects. Raises InputError naming `where`, also for an impossible split."""
    try:
        frames = parse_frame_range(config.frames, count)
        split_frames(len(frames), config.split, config.block_length)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return frames


def parse_frame_range(text: str, count: int, least: int = LEAST_FRAMES) -> range:
    """At least `least` of `count` frames, selected by "start:stop[:step]" in Python's slice notation; "" selects all.

    Negative numbers count from the end. Unlike in a Python slice, an end beyond the sequence is refused, and the step
    is at least 1.

    Raises:  InputError naming the text and what is allowed.
    """
    if not text.strip():
        return range(count)
    try:
        numbers = [int(part) if part.strip() else None for part in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3):
        raise InputError(f"frames {text!r}: not a range; write start:stop or start:stop:step")
    start, stop, step = (*numbers, None)[:3]
    if step is not None and step < 1:
        raise InputError(f"frames {text!r}: the step must be 1 or more")
    for bound in (start, stop):
        if bound is not None and not -count <= bound <= count:
            raise InputError(
                f"frames {text!r}: {bound} is outside the {counted(count, 'frame')} of the sequence;"
                f" use {-count} to {count}"
            )
    chosen = range(count)[slice(start, stop, step)]
    if len(chosen) < least:
        raise InputError(f"frames {text!r}: selects {len(chosen)} of {count} frames; at least {least} are needed")
    return chosen
