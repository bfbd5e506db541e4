"""A picture without the colours that its mask excludes (specification B14).

An excluded pixel, of an instrument for example, gets the colour of tissue: that of the training frame nearest in time
in which the pixel is tissue, among the NEAREST nearest ones; where none is, the colour of the nearest pixel of the
picture that has one. In: a sequence and a frame. Out: a picture. No held-out frame is read but the given one.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence

NEAREST = 16  # training frames; a limit on the time of a long clip


def by_nearness(sequence: Sequence, time: float) -> NDArray[np.integer]:
    """The training frames by their distance in time from `time`; of two equally near ones, the earlier first."""
    frames = np.asarray(sequence.train_index)
    distance = np.abs(sequence.times[frames] - time)
    return frames[np.lexsort((frames, np.round(distance, 9)))]  # times i / n have rounding errors


def fill_from(
    sequence: Sequence, frames: NDArray[np.integer], colours: NDArray[np.uint8], left: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Give each pixel the colour of the first of these frames in which it is tissue, in place.

    colours   (3, H W)
    left      flat indices of the pixels without a colour
    returns   those that are tissue in none of the frames
    """
    for k in frames:
        if not left.size:
            break
        tissue = sequence.masks[k].ravel()[left]
        found, left = left[tissue], left[~tissue]
        colours[:, found] = sequence.images[k].reshape(3, -1)[:, found]
    return left


def tissue_colours(sequence: Sequence, index: int) -> NDArray[np.uint8]:
    """The picture of frame `index` (3, H, W), with the colours of tissue in its excluded pixels.

    Edges:   a frame without excluded pixels keeps its colours. Without tissue in any of the frames, zeros.
    """
    height, width = sequence.masks[index].shape
    colours = np.where(sequence.masks[index], sequence.images[index], np.uint8(0)).reshape(3, -1)
    nearest = by_nearness(sequence, float(sequence.times[index]))[:NEAREST]
    left = fill_from(sequence, nearest, colours, np.flatnonzero(~sequence.masks[index]))
    if 0 < left.size < height * width:
        from endotsr.clips.opencv.regions import nearest_known

        missing = np.zeros(height * width, bool)
        missing[left] = True
        colours[:, left] = colours[:, nearest_known(missing.reshape(height, width)).ravel()[left]]
    return colours.reshape(3, height, width)
