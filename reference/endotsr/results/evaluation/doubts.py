"""Signs that pictures were not written as the renders of the held-out frames: their metrics would be of a mistake.

In: the held-out pictures, and the sequence. Out: one sentence, or none. Errors are those on tissue. The order of the
tests is:

- an exchange of channels or a turn (`turned`);
- pictures that equal their recorded frames;
- linear light, and a number that is off by one: the change with the largest gain is named, if all pictures together
  come nearer to the recorded frames by more than LEAST_GAIN. For a number that is off by one, the gain is counted
  against the own frame or the frame on the other side, whichever is nearer: a render between training frames resembles
  the frames before and after about equally;
- pictures that are grey at all pixels, of frames with colours on tissue;
- another order of the held-out frames, with the same LEAST_GAIN.
"""

from collections.abc import Callable

import numpy as np

from endotsr.clips.formats.files import shortened
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.results.evaluation.turned import turned_remark

LEAST_GAIN = 3.0  # dB
LARGEST_GAIN = 60.0  # dB, for pictures that a change makes equal
GAMMA = 1 / 2.2  # of display units, from linear light
EVERY = 4  # pixels between those of the search among the held-out frames
MOST_SEARCHED = 64  # held-out frames
LINEAR = "the pictures seem to be in linear light"
STEPS = {"the pictures seem to show the frame before": -1, "the pictures seem to show the frame after": 1}


def doubt(sequence: Sequence, read: Callable[[int], FloatArray]) -> str:
    """A sentence on pictures that look like a mistake; "" for pictures as they should be.

    read   the picture (3, H, W) of a held-out frame, display units
    """
    if remark := turned_remark(read, sequence):
        return remark
    held_out = [int(i) for i in sequence.test_index if sequence.masks[i].any()]
    # squared, of all pictures: without the change, and with it
    errors = {name: np.zeros(2) for name in (LINEAR, *STEPS)}
    equal, grey, coloured, thinned = [], bool(held_out), False, {}
    for i in held_out:
        picture = np.asarray(read(i), np.float32)
        tissue = sequence.masks[i]
        if not _squares(sequence, i, picture, tissue).any():
            equal.append(sequence.names[i])
        shown = (picture, np.maximum(picture, 0) ** GAMMA)
        errors[LINEAR] += [_squares(sequence, i, each, tissue).sum(dtype=float) for each in shown]
        for name, step in STEPS.items():
            errors[name] += _of_step(sequence, i, picture, step)
        grey = grey and not np.ptp(picture, axis=0).any()
        coloured = coloured or bool(np.ptp(sequence.images[i], axis=0)[tissue].any())
        if len(thinned) < MOST_SEARCHED:
            thinned[i] = picture[:, ::EVERY, ::EVERY].copy()
    if equal:
        what = f"{len(equal)} of {len(held_out)} pictures equal the recorded frames on tissue: {shortened(equal)}"
        return f"warning: {what}; they seem to be these frames, not renders"
    gain, name = max((_gain(*pair), name) for name, pair in errors.items())
    if gain > LEAST_GAIN:
        return _sentence(name, gain)
    if grey and coloured:
        return "warning: the pictures are grey, and the recorded frames have colours"
    return _exchanged(sequence, thinned)


def _gain(own: float, changed: float) -> float:
    """By how many dB a change brings pictures nearer."""
    return 10 * float(np.log10(own / max(changed, own * 10 ** (-LARGEST_GAIN / 10)))) if own > 0 else 0.0


def _sentence(what: str, gain: float) -> str:
    return f"warning: {what}: so read, they are {gain:.1f} dB nearer to the recorded frames"


def _of_step(sequence: Sequence, i: int, picture: FloatArray, step: int) -> FloatArray:
    """Squared errors of a picture beside the frame `step` from it, and beside the nearest of the other two."""
    near, far = i + step, i - step
    if min(near, far) < 0 or max(near, far) >= sequence.count:
        return np.zeros(2)
    tissue = sequence.masks[near] & sequence.masks[i] & sequence.masks[far]
    own, other, one = (_squares(sequence, k, picture, tissue).sum(dtype=float) for k in (i, far, near))
    return np.array([min(own, other), one])


def _exchanged(sequence: Sequence, thinned: dict[int, FloatArray]) -> str:
    """A sentence on pictures that are nearest to the held-out frames in another order; "" otherwise."""
    frames = list(thinned)
    tissue = [np.ascontiguousarray(sequence.masks[i, ::EVERY, ::EVERY]) for i in frames]
    if len(frames) < 2 or not all((a & b).any() for a in tissue for b in tissue):
        return ""
    error = np.array([[_mean(sequence, thinned[i], k, a & b) for k, b in zip(frames, tissue)]
                      for i, a in zip(frames, tissue)])  # fmt: skip
    nearest = error.argmin(axis=1)
    gain = _gain(float(error.trace()), float(error.min(axis=1).sum()))
    if len(set(nearest.tolist())) < len(frames) or gain <= LEAST_GAIN:
        return ""  # such as one mean picture, which is nearest to one frame
    pairs = [(sequence.names[i], sequence.names[frames[k]]) for i, k in zip(frames, nearest)]
    moved = shortened([f"{name} shows {shown}" for name, shown in pairs if name != shown])
    return _sentence(f"the pictures seem to be in another order, {moved}", gain)


def _mean(sequence: Sequence, thin: FloatArray, k: int, tissue: BoolArray) -> float:
    """The mean squared error of a thinned picture beside frame k."""
    recorded = sequence.images[k][:, ::EVERY, ::EVERY][:, tissue].astype(np.float32) / np.float32(255)
    return float(((thin[:, tissue] - recorded) ** 2).mean())


def _squares(sequence: Sequence, k: int, picture: FloatArray, tissue: BoolArray) -> FloatArray:
    """Squared errors of a picture beside the recorded frame k on these pixels."""
    return (picture[:, tissue] - sequence.images[k][:, tissue].astype(np.float32) / np.float32(255)) ** 2
