"""Trajectories of tissue points over the training frames, tracked along dense optical flow (specification B15).

A point starts at a pixel of a training frame and is tracked to the later and to the earlier training frames, one frame
at a time. While it is *followed*, its pixel moves by the flow between the two frames, and its position is that pixel
back-projected with the prior depth. It is lost if it leaves the picture or the tissue, if forward and backward flow
disagree, or if the depth jumps. A lost point moves with the nearest followed points, weighted by inverse distance. It
is followed again where it reaches a tissue pixel at its expected depth.

In: a sequence and the points' start positions. Out: a position at every training frame. No held-out picture is read.
"""

import threading
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.flow.between import WHOLE, Flows, flows_between
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.kernels.memory import Kept
from endotsr.method.kernels.threads import parallel_calls
from endotsr.method.splatting.camera import Camera, backproject, project

OUTSIDE = -1e6  # column and row of a point behind the camera
CONSISTENT = 0.01  # of the squared lengths of forward and backward flow
TOLERANCE = 0.5  # px^2
# Of the depth: a change of more than twice this between frames, or of a quarter of it where a lost point is found
# again, is another surface.
DEPTH_JUMP = 0.1
NEIGHBOURS = 8  # followed points that move a lost point
# Flows between frames that one direction keeps for the other, 143 pairs of 640x512. More are computed twice.
KEPT_BYTES = 750_000_000
FEWEST = 16  # followed points; with fewer, lost points stay in place


class Tracks(NamedTuple):
    """Positions of P points at the n training frames."""

    position: FloatArray  # (n, 3, P) float32, scene units, world axes
    followed: BoolArray  # (n, P) False: moved with neighbouring points


class _Points(NamedTuple):
    """The points at one training frame."""

    position: FloatArray  # (3, P)
    followed: BoolArray  # (P,)


def follow(sequence: Sequence, start: NDArray[np.intp], position: FloatArray) -> Tracks:
    """The points at every training frame.

    start     (P,) index of each point's training frame in `train_index`
    position  (3, P) scene units, at that frame, in which the point is visible

    The two directions run at the same time. No result depends on the number of threads.

    Edges:   with one training frame, the given positions. In a static sequence likewise, up to rounding and the noise
             of the prior depth.
    """
    train = [int(i) for i in sequence.train_index]
    count, last = position.shape[1], len(train) - 1
    out = Tracks(np.empty((last + 1, 3, count), np.float32), np.zeros((last + 1, count), bool))
    for place in range(last + 1):
        begins = start == place
        out.position[place][:, begins], out.followed[place, begins] = position[:, begins], True
    kept: Kept[int, Flows] = Kept(KEPT_BYTES)
    stopped = threading.Event()

    def along(way: int) -> None:
        """Take the points to the later frames (way 1) or to the earlier ones (-1). No point has a frame in both."""
        try:
            for place in range(last) if way > 0 else range(last, 0, -1):
                if stopped.is_set():
                    return
                pair = min(place, place + way)
                there_and_back = kept.get(pair, partial(flows_between, sequence, train[pair], train[pair + 1]))
                flow = there_and_back if way > 0 else Flows(there_and_back.backward, there_and_back.forward)
                known = start <= place if way > 0 else start >= place
                here = _Points(out.position[place][:, known], out.followed[place, known])
                there = _step(sequence, (train[place], train[place + way]), here, flow)
                out.position[place + way][:, known], out.followed[place + way, known] = there
        except BaseException:
            stopped.set()  # `parallel_calls` waits for the other direction
            raise

    try:
        parallel_calls(partial(along, 1), partial(along, -1))
    finally:
        stopped.set()  # an interruption may come while this thread waits
    return out


def _step(sequence: Sequence, frames: tuple[int, int], here: _Points, flows: Flows) -> _Points:
    """The points at the second frame."""
    source, target = (sequence.cameras[i] for i in frames)
    pixel, _ = _project(source, here.position)
    moved = pixel + _sampled(flows.forward, pixel)
    apart = moved + _sampled(flows.backward, moved) - pixel
    lengths = np.square(moved - pixel).sum(axis=0)
    agree = np.square(apart).sum(axis=0) <= 2 * CONSISTENT * lengths + TOLERANCE  # (19.2)
    found, at = _lifted(sequence, frames[1], moved)  # (19.1)
    followed = here.followed & agree & _near(at, _project(target, here.position)[1], 2 * DEPTH_JUMP)  # (19.3)
    position = np.where(followed, found, here.position)
    lost = ~followed
    if lost.any() and np.count_nonzero(followed) >= FEWEST:
        position[:, lost] += _motion_around(here.position, position, followed, lost)  # (19.4)
    _refind(sequence, frames[1], position, followed, lost)
    return _Points(position, followed)


def _motion_around(before: FloatArray, after: FloatArray, followed: BoolArray, lost: BoolArray) -> FloatArray:
    """(3, lost) mean displacement of the nearest followed points, weighted by inverse distance."""
    from scipy.spatial import KDTree

    distance, nearest = KDTree(before[:, followed].T).query(before[:, lost].T, k=NEIGHBOURS)
    weight = 1.0 / (distance + 1e-3 * distance.max(initial=1e-12))
    motion = (after - before)[:, followed][:, nearest]
    return (motion * weight).sum(axis=2) / weight.sum(axis=1)


def _refind(sequence: Sequence, frame: int, position: FloatArray, followed: BoolArray, lost: BoolArray) -> None:
    """Follow lost points again, in place, where the frame shows tissue at their depth."""
    pixel, depth = _project(sequence.cameras[frame], position[:, lost])
    found, at = _lifted(sequence, frame, pixel)
    again = _near(at, depth, DEPTH_JUMP / 4)  # (19.5)
    places = np.flatnonzero(lost)[again]
    position[:, places], followed[places] = found[:, again], True


def _near(depth: FloatArray, expected: FloatArray, fraction: float) -> BoolArray:
    return (depth > 0) & (np.abs(depth - expected) <= fraction * np.abs(expected))


def _project(camera: Camera, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Column and row (2, P), 0 = centre of the first pixel, and depth (P,)."""
    u, v, depth = project(camera, position)
    return np.where(depth > 0, np.stack([u, v]) - 0.5, OUTSIDE), depth


def _sampled(planes: FloatArray, pixel: FloatArray) -> FloatArray:
    """(C, P) float64 bilinear samples of (C, H, W) at (2, P) columns and rows; outside, the border value."""
    from endotsr.clips.opencv.flow import sample_bilinear

    return sample_bilinear(planes.astype(np.float64), *pixel)


def _lifted(sequence: Sequence, frame: int, pixel: FloatArray) -> tuple[FloatArray, FloatArray]:
    """World positions (3, P) of pixels at the prior depth of a frame, and that depth (P,); 0 = no tissue or no
    depth."""
    camera, prior = sequence.cameras[frame], sequence.depth[frame].astype(np.float64)
    usable = (sequence.masks[frame] & (prior > 0)).astype(np.float64)
    whole, depth = _sampled(np.stack([usable, prior]), pixel)
    inside = (pixel >= 0).all(axis=0) & (pixel[0] <= camera.width - 1) & (pixel[1] <= camera.height - 1)
    depth = np.where(inside & (whole > WHOLE), depth, 0.0)
    return backproject(camera, pixel[0], pixel[1], depth), depth
