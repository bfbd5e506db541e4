"""A picture between two training frames, interpolated along dense optical flow (specification B14).

With the flows f from the earlier frame to the later and g back, the motion field at the time fraction a in [0, 1]
solves

    v_0(x) = f(x - a v_0(x)),    v_1(x) = -g(x + (1 - a) v_1(x)),    v = (1 - a) v_0 + a v_1.

A pixel x blends the warped pair I_0(x - a v(x)) and I_1(x + (1 - a) v(x)) in time, and likewise the unwarped pair
I_0(x) and I_1(x). The two blends are mixed with weights inverse to the local squared difference within each pair: where
the flow is wrong, the warped pictures disagree. A pixel is tissue if at least one frame is tissue at its warped
position, and is blended from those frames only. No colour that a mask excludes enters a target: the warps and the
differences read `tissue_colours`. The flow alone is computed from whole pictures.

In: a sequence and the indices of two training frames. Out: a `Frame`. No held-out picture is read. A `Gap` has what all
times between the two frames share.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.flow.between_kernels import WHOLE as WHOLE
from endotsr.clips.flow.between_kernels import motion_field, moved_priors
from endotsr.clips.flow.tissue_colours import tissue_colours
from endotsr.clips.sequences.sequence import Frame, Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera

NEARBY = 2.0  # px, standard deviation of the Gaussian window of the differences; 1 to 4 give the same within 0.1 dB
ONE_STEP = (1 / 255) ** 2  # squared difference of one grey level, the rounding of 8-bit pictures


class Flows(NamedTuple):
    """Dense flow between two frames, in both directions."""

    forward: FloatArray  # (2, H, W) px, x first: earlier -> later
    backward: FloatArray  # (2, H, W) px: later -> earlier


class Gap(NamedTuple):
    """Two frames, and what all times between them share."""

    earlier: int  # frame indices, any distance apart
    later: int
    flows: Flows
    images: FloatArray  # (2, 3, H, W) in [0, 1]: `tissue_colours` of both frames, 24 bytes per pixel


def flows_between(sequence: Sequence, earlier: int, later: int) -> Flows:
    """Dense flow between two frames of a sequence, in both directions."""
    from endotsr.clips.opencv.flow import dense_flow

    a, b = sequence.images[earlier], sequence.images[later]
    return Flows(dense_flow(a, b), dense_flow(b, a))


def gap_between(sequence: Sequence, earlier: int, later: int, flows: Flows) -> Gap:
    """The gap between two frames; flows from `flows_between` for these frames."""
    colours = np.stack([tissue_colours(sequence, index) for index in (earlier, later)])
    return Gap(earlier, later, flows, colours.astype(np.float32) / np.float32(255))


def motion_between(flows: Flows, fraction: float) -> FloatArray:
    """The motion field v at the time fraction `fraction` (B14).

    fraction  a in [0, 1]: 0 is the earlier frame, 1 the later
    returns   (2, H, W) px from the earlier frame to the later, at the position of a point at that time

    Edges:   constant opposite flows give that flow at every time. Swapping the frames and a -> 1 - a only changes the
             sign of the field.
    """
    return motion_field(flows.forward, flows.backward, fraction)


def frame_between(sequence: Sequence, gap: Gap, fraction: float) -> Frame:
    """The picture, tissue mask and prior depth at a time between two frames, as a `Frame` (B14).

    gap       from `gap_between`, once for all times between these frames
    fraction  a in [0, 1]
    returns   Frame in float32; mask True where one of the frames is tissue; depth 0 where neither has a prior; time and
              camera interpolated

    Reverse: none; the result is held fixed during training.
    """
    from endotsr.clips.opencv.flow import warp_cubic

    earlier, later, flows, images = gap
    pair, a = [earlier, later], np.float32(fraction)
    weights = np.array([1.0 - fraction, fraction], np.float32)
    field = motion_between(flows, fraction)
    factors = np.array([-a, 1 - a], np.float32)  # (18.1)
    tissue = sequence.masks[pair]
    seen, known, depth = moved_priors(tissue, sequence.depth[pair].astype(np.float32, copy=False), field, factors)
    both = seen[0] & seen[1] & tissue[0] & tissue[1]
    moved = np.stack([warp_cubic(image, factor * field) for image, factor in zip(images, factors, strict=True)])
    image = _mixed(moved, images, seen, both, weights)
    depth = _blended(depth, known, weights)
    used = seen & (weights > 0)[:, None, None]
    mask = used[0] | used[1]
    time = (1.0 - fraction) * float(sequence.times[earlier]) + fraction * float(sequence.times[later])
    camera = camera_between(sequence.cameras[earlier], sequence.cameras[later], fraction)
    return Frame(np.ascontiguousarray(np.clip(image, 0, 1)), mask, depth, time, camera)


def _mixed(moved: FloatArray, still: FloatArray, seen: BoolArray, both: BoolArray, weights: FloatArray) -> FloatArray:
    """(3, H, W) the warped and the unwarped pair, mixed with weights inverse to the local difference within each.

    moved, still  (2, 3, H, W) warped, unwarped
    seen          (2, H, W) the warped pictures are tissue
    both          (H, W) both pairs are tissue in both frames; elsewhere only the warped pictures are used
    weights       (2,) of the two frames
    """
    of_moved, of_still = _difference(moved), _difference(still)
    fraction = np.where(both, of_moved / (of_moved + of_still), np.float32(0))  # of the unwarped pair: (18.7), (18.9)
    at_rest = weights[0] * still[0] + weights[1] * still[1]  # a matrix product would start library threads
    return (1 - fraction) * _blended(moved, seen, weights) + fraction * at_rest  # (18.6)


def _difference(pair: FloatArray) -> FloatArray:
    """(H, W) local mean squared difference of two pictures (2, 3, H, W), at least `ONE_STEP`."""
    from endotsr.clips.opencv.filters import gaussian_blur

    return gaussian_blur(np.square(pair[0] - pair[1]).mean(axis=0), NEARBY) + np.float32(ONE_STEP)  # (18.8)


def _blended(pair: FloatArray, usable: BoolArray, weights: FloatArray) -> FloatArray:
    """The planes (2, ..., H, W) of two frames, blended where both are usable; else the usable one, else 0."""
    part = weights[:, None, None] * usable
    part = part / np.maximum(part.sum(axis=0), np.finfo(np.float32).tiny)
    return (part.reshape(2, *(1,) * (pair.ndim - 3), *usable.shape[1:]) * pair).sum(axis=0)


def camera_between(earlier: Camera, later: Camera, fraction: float) -> Camera:
    """The camera at a time between two cameras: linear centre, rotation at constant angular speed, linear intrinsics.

    Edges:   the same object twice is returned unchanged.
    """
    if earlier is later:
        return earlier
    from scipy.spatial.transform import Rotation

    from endotsr.method.splatting.camera import camera_centre

    turn = Rotation.from_matrix(later.rotation @ earlier.rotation.T).as_rotvec()
    rotation = Rotation.from_rotvec(fraction * turn).as_matrix() @ earlier.rotation
    centre = (1.0 - fraction) * camera_centre(earlier) + fraction * camera_centre(later)
    lens = {k: (1.0 - fraction) * getattr(earlier, k) + fraction * getattr(later, k) for k in ("fx", "fy", "cx", "cy")}
    return earlier._replace(rotation=rotation, translation=-rotation @ centre, **lens)
