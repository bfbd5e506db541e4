"""A picture between two training frames, made from both along dense optical flow (specification B14).

With the flows f from the earlier frame to the later and g back, the motion field at the moment a in [0, 1] solves

    v_0(x) = f(x - a v_0(x)),    v_1(x) = -g(x + (1 - a) v_1(x)),    v = (1 - a) v_0 + a v_1,

and the picture is I_a(x) = (1 - a) I_0(x - a v(x)) + a I_1(x + (1 - a) v(x)), depth likewise. A pixel counts as tissue
where both frames are tissue at the two places and the two fields agree (forward-backward consistency):

    |v_0 - v_1|^2 <= CONSISTENT (|v_0|^2 + |v_1|^2) + TOLERANCE.

Comes in: a sequence and the indices of two training frames; goes out: a `Frame`. No held-out picture is read.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.sequences.sequence import Frame, Sequence
from endotsr.splatting.camera import Camera

FloatArray = NDArray[np.floating]

STEPS = 3  # fixed-point steps for v_0 and v_1; smooth flow contracts, and a fourth step moves it by under 0.05 px
CONSISTENT = 0.01  # of the squared lengths
TOLERANCE = 0.5  # px^2
WHOLE = 0.999  # bilinear weight of tissue, or of pixels with a prior depth, above which all four neighbours are


class Flows(NamedTuple):
    """Dense flow between two frames, both ways."""

    forward: FloatArray  # (2, H, W) px, x first: earlier -> later
    backward: FloatArray  # (2, H, W) px: later -> earlier


class MotionBetween(NamedTuple):
    """The motion field at a moment between two frames."""

    field: FloatArray  # (2, H, W) px from the earlier frame to the later, at the place where a point is at that moment
    consistent: NDArray[np.bool_]  # (H, W) the two flows agree


def flows_between(sequence: Sequence, earlier: int, later: int, method: str = "dis") -> Flows:
    """Dense flow between two frames of a sequence. See `opencv.dense_flow` for the methods."""
    from endotsr.opencv import dense_flow

    a, b = sequence.images[earlier], sequence.images[later]
    return Flows(dense_flow(a, b, method), dense_flow(b, a, method))


def motion_between(flows: Flows, fraction: float) -> MotionBetween:
    """The motion field v at the moment `fraction` and where the two flows agree on it (B14).

    fraction  a in [0, 1]: 0 is the earlier frame, 1 the later

    Edges:   equal flows in opposite directions give that flow at every moment. Swapping the frames and a -> 1 - a
             changes the sign of the field and nothing else.
    """
    from endotsr.opencv import warp_bilinear

    a, b = np.float32(fraction), np.float32(1.0 - fraction)
    from_earlier, from_later = flows.forward, -flows.backward
    for _ in range(STEPS):
        from_earlier = warp_bilinear(flows.forward, -a * from_earlier)
        from_later = -warp_bilinear(flows.backward, b * from_later)
    apart = np.square(from_earlier - from_later).sum(axis=0)
    lengths = (np.square(from_earlier) + np.square(from_later)).sum(axis=0)
    return MotionBetween(b * from_earlier + a * from_later, apart <= CONSISTENT * lengths + TOLERANCE)


def frame_between(sequence: Sequence, earlier: int, later: int, fraction: float, flows: Flows) -> Frame:
    """The picture, tissue mask and prior depth at a moment between two frames, as `Frame` (B14).

    earlier, later  frame indices; the frames may be any distance apart
    fraction        a in (0, 1)
    flows           of `flows_between` for these frames
    returns         Frame in float32; mask True where both frames are tissue and the flows agree; depth 0 where one of
                    the frames has none; time and camera are interpolated

    Reverse: none; the result is a constant of the training.
    """
    from endotsr.opencv import warp_bilinear, warp_cubic

    a, b = np.float32(fraction), np.float32(1.0 - fraction)
    motion = motion_between(flows, fraction)
    back, ahead = -a * motion.field, b * motion.field

    def both(planes: NDArray, warp) -> tuple[FloatArray, FloatArray]:
        return warp(planes[earlier].astype(np.float32), back), warp(planes[later].astype(np.float32), ahead)

    first, second = both(sequence.images, warp_cubic)
    image = np.clip((b * first + a * second) / np.float32(255), 0, 1)
    first, second = both(sequence.masks, warp_bilinear)
    mask = (first > WHOLE) & (second > WHOLE) & motion.consistent
    known = [sequence.depth[k] > 0 for k in (earlier, later)]
    first, second = warp_bilinear(known[0].astype(np.float32), back), warp_bilinear(known[1].astype(np.float32), ahead)
    known_in_both = (first > WHOLE) & (second > WHOLE)
    first, second = both(sequence.depth, warp_bilinear)
    depth = np.where(known_in_both, b * first + a * second, np.float32(0))
    time = (1.0 - fraction) * float(sequence.times[earlier]) + fraction * float(sequence.times[later])
    camera = camera_between(sequence.cameras[earlier], sequence.cameras[later], fraction)
    return Frame(np.ascontiguousarray(image), mask, np.ascontiguousarray(depth), time, camera)


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
