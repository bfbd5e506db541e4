"""A picture between two training frames, made from both along dense optical flow (specification B14).

With the flows f from the earlier frame to the later and g back, the motion field at the moment a in [0, 1] solves

    v_0(x) = f(x - a v_0(x)),    v_1(x) = -g(x + (1 - a) v_1(x)),    v = (1 - a) v_0 + a v_1.

A pixel x shows either the pair that moved, I_0(x - a v(x)) and I_1(x + (1 - a) v(x)), or the pair that stayed, I_0(x)
and I_1(x). Each pair is blended in time, and the two blends are mixed with weights inverse to the local squared
difference within the pair: where the flow is wrong, its two pictures disagree. A pixel counts as tissue where one of
the frames is tissue at its moved place, and is made of the frames that are.

In: a sequence and the indices of two training frames. Out: a `Frame`. No held-out picture is read.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.arrays import BoolArray, FloatArray
from endotsr.sequences.sequence import Frame, Sequence
from endotsr.splatting.camera import Camera

STEPS = 3  # fixed-point steps for v_0 and v_1; smooth flow contracts, and a fourth step moves it by under 0.05 px
WHOLE = 0.999  # bilinear weight of tissue, or of pixels with a prior depth, above which all four neighbours are
NEARBY = 2.0  # px, standard deviation of the Gaussian window of the differences; 1 to 4 give the same within 0.1 dB
ONE_STEP = (1 / 255) ** 2  # squared difference that 8-bit pictures of the same thing have


class Flows(NamedTuple):
    """Dense flow between two frames, both ways."""

    forward: FloatArray  # (2, H, W) px, x first: earlier -> later
    backward: FloatArray  # (2, H, W) px: later -> earlier


def flows_between(sequence: Sequence, earlier: int, later: int) -> Flows:
    """Dense flow between two frames of a sequence, both ways."""
    from endotsr.opencv import dense_flow

    a, b = sequence.images[earlier], sequence.images[later]
    return Flows(dense_flow(a, b), dense_flow(b, a))


def motion_between(flows: Flows, fraction: float) -> FloatArray:
    """The motion field v at the moment `fraction` (B14).

    fraction  a in [0, 1]: 0 is the earlier frame, 1 the later
    returns   (2, H, W) px from the earlier frame to the later, at the place where a point is at that moment

    Edges:   equal flows in opposite directions give that flow at every moment. Swapping the frames and a -> 1 - a
             changes the sign of the field and nothing else.
    """
    from endotsr.opencv import warp_bilinear

    a, b = np.float32(fraction), np.float32(1.0 - fraction)
    from_earlier, from_later = flows.forward, -flows.backward
    for _ in range(STEPS):
        from_earlier = warp_bilinear(flows.forward, -a * from_earlier)  # (18.2), (18.4)
        from_later = -warp_bilinear(flows.backward, b * from_later)  # (18.3)
    return b * from_earlier + a * from_later  # (18.5)


def frame_between(sequence: Sequence, earlier: int, later: int, fraction: float, flows: Flows) -> Frame:
    """The picture, tissue mask and prior depth at a moment between two frames, as `Frame` (B14).

    earlier, later  frame indices; the frames may be any distance apart
    fraction        a in [0, 1]
    flows           of `flows_between` for these frames
    returns         Frame in float32; mask True where one of the frames is tissue; depth 0 where neither has a prior;
                    time and camera are interpolated

    Reverse: none; the result is a constant of the training.
    """
    from endotsr.opencv import warp_bilinear, warp_cubic

    pair, a = [earlier, later], np.float32(fraction)
    weights = np.array([1.0 - fraction, fraction], np.float32)
    field = motion_between(flows, fraction)
    places = (-a * field, (1 - a) * field)  # (18.1)

    def moved(planes: NDArray, warp) -> FloatArray:
        return np.stack([warp(plane.astype(np.float32), place) for plane, place in zip(planes, places, strict=True)])

    images, tissue = sequence.images[pair].astype(np.float32) / np.float32(255), sequence.masks[pair]
    seen = moved(tissue, warp_bilinear) > WHOLE
    both = seen[0] & seen[1] & tissue[0] & tissue[1]
    image = _mixed(moved(images, warp_cubic), images, seen, both, weights)
    known = moved(tissue & (sequence.depth[pair] > 0), warp_bilinear) > WHOLE
    depth = _blended(moved(sequence.depth[pair], warp_bilinear), known, weights)
    mask = np.tensordot(weights, seen, 1) > 0
    time = (1.0 - fraction) * float(sequence.times[earlier]) + fraction * float(sequence.times[later])
    camera = camera_between(sequence.cameras[earlier], sequence.cameras[later], fraction)
    return Frame(np.ascontiguousarray(np.clip(image, 0, 1)), mask, depth, time, camera)


def _mixed(moved: FloatArray, still: FloatArray, seen: BoolArray, both: BoolArray, weights: FloatArray) -> FloatArray:
    """(3, H, W) the moved and the still pair of pictures, mixed by how little the two pictures of each differ nearby.

    moved, still  (2, 3, H, W)
    seen          (2, H, W) the moved pictures are tissue
    both          (H, W) both pairs are tissue in both frames; elsewhere the moved pictures alone are used
    weights       (2,) of the two frames
    """
    of_moved, of_still = _difference(moved), _difference(still)
    fraction = np.where(both, of_moved / (of_moved + of_still), np.float32(0))  # of the still pair: (18.7), (18.9)
    return (1 - fraction) * _blended(moved, seen, weights) + fraction * np.tensordot(weights, still, 1)  # (18.6)


def _difference(pair: FloatArray) -> FloatArray:
    """(H, W) mean squared difference of two pictures (2, 3, H, W) around a pixel, at least `ONE_STEP`."""
    from endotsr.opencv import gaussian_blur

    return gaussian_blur(np.square(pair[0] - pair[1]).mean(axis=0), NEARBY) + np.float32(ONE_STEP)  # (18.8)


def _blended(pair: FloatArray, usable: BoolArray, weights: FloatArray) -> FloatArray:
    """The planes (2, ..., H, W) of two frames, blended where both are usable, else the usable one, else 0."""
    part = weights[:, None, None] * usable
    part = part / np.maximum(part.sum(axis=0), np.finfo(np.float32).tiny)
    return (part.reshape(2, *(1,) * (pair.ndim - 3), *usable.shape[1:]) * pair).sum(axis=0)


def camera_between(earlier: Camera, later: Camera, fraction: float) -> Camera:
    """The camera at a moment between two: the centre on the straight line, the rotation at constant angular speed.

    Edges: the same object twice is returned as it is. Intrinsics are interpolated linearly.
    """
    if earlier is later:
        return earlier
    from scipy.spatial.transform import Rotation

    from endotsr.splatting.camera import camera_centre

    turn = Rotation.from_matrix(later.rotation @ earlier.rotation.T).as_rotvec()
    rotation = Rotation.from_rotvec(fraction * turn).as_matrix() @ earlier.rotation
    centre = (1.0 - fraction) * camera_centre(earlier) + fraction * camera_centre(later)
    lens = {k: (1.0 - fraction) * getattr(earlier, k) + fraction * getattr(later, k) for k in ("fx", "fy", "cx", "cy")}
    return earlier._replace(rotation=rotation, translation=-rotation @ centre, **lens)
