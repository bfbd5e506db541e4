"""Returns of the scope: pairs of frames far apart in time that see one place, and the poses that agree with them.

A chain of frames drifts; a place that is seen again says by how much. In: the matches between any two frames, and the
poses of the chain. Out: `Return`s, found by features between keyframes, and poses in which the difference between a
return and the chain is spread over the frames between (a pose graph).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.poses.matches import Matcher
from endotsr.clips.poses.pair_kernels import COST, RIGHT, SUMS
from endotsr.clips.poses.resection import resection
from endotsr.clips.poses.steps import UPPER, moved, solved_step
from endotsr.clips.poses.views import between, compose, inverse
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose

EVERY, MOST_KEYS = 8, 96  # frames between two keyframes, and most keyframes: pairs grow with their square
LEAST_APART = 32  # frames: nearer ones are in the pairs of the bundle adjustment or overlap with one of them
MOST_RETURNS = 2  # of a keyframe, to earlier ones
LEAST_AGREE, LEAST_AGREEING = 40, 0.6  # matches of features that agree, and their fraction
LEAST = 1e-12  # on the diagonal of the graph, whose smallest eigenvalue falls with the square of its length
ROUNDS, ENOUGH = 10, 1e-7  # of the pose graph; rad, and fraction of the depth: a shorter step ends it


class Return(NamedTuple):
    """Two frames that see one place."""

    source: int
    target: int
    pose: CameraPose  # of the target camera relative to the source camera, from the matches between both
    agree: int  # matches that agree


def keyframes(known: list[int]) -> list[int]:
    """The frames between which returns are looked for, among those with a pose."""
    return known[:: max(EVERY, -(-len(known) // MOST_KEYS))]


def returns_of(matcher: Matcher, poses: list[CameraPose | None]) -> list[Return]:
    """The returns between keyframes that are `LEAST_APART` frames apart.

    Features are found again only where the view is alike in angle and distance. Few that agree by chance are no return.
    """
    keys = keyframes([k for k, pose in enumerate(poses) if pose is not None])
    found = []
    for target in keys:
        earlier = (_return(matcher, source, target) for source in keys if target - source >= LEAST_APART)
        found += sorted(filter(None, earlier), key=lambda one: -one.agree)[:MOST_RETURNS]
    return found


def _return(matcher: Matcher, source: int, target: int) -> Return | None:
    """The return between two frames; None if too few features agree on one motion."""
    matches = matcher.by_strongest(source, target)
    done = resection(matches, matcher.camera) if matches.count >= LEAST_AGREE else None
    if done is None:
        return None
    agree = round(done.agreeing * matches.count)
    sure = agree >= LEAST_AGREE and done.agreeing >= LEAST_AGREEING
    return Return(source, target, done.pose, agree) if sure else None


def closed(poses: list[CameraPose], returns: list[Return], depth: float) -> list[CameraPose]:
    """The poses of a graph: its edges are the motions between successive frames, and the returns.

    poses     (n) one per frame; the first one is kept
    returns   numbers of frames are places in `poses`
    depth     typical depth, scene units: a translation counts as its fraction of it

    All edges have one weight, so a difference of r between a return over m frames and the chain leaves r / (m + 1) at
    each of them. Without a return the poses come back as they are.

    Oracle:   a circle whose drift is known, tests/clips/poses/test_returns.py
    """
    if not returns:
        return poses
    chain = [(k, k + 1, between(poses, k, k + 1)) for k in range(len(poses) - 1)]
    edges = chain + [(edge.source, edge.target, edge.pose) for edge in returns]
    pairs = np.array([edge[:2] for edge in edges], np.intp)
    unit = np.array([1, 1, 1, depth, depth, depth])
    for _ in range(ROUNDS):
        sums = _edge_sums(edges, pairs, poses, unit)
        step = solved_step(sums, pairs, poses, depth, 0.0, LEAST)
        poses = [moved(pose, part) for pose, part in zip(poses, step)]
        if np.abs(step / unit).max() < ENOUGH:
            break
    return poses


def _edge_sums(
    edges: list[tuple[int, int, CameraPose]], pairs: NDArray[np.intp], poses: list[CameraPose], unit: FloatArray
) -> FloatArray:
    """Half the squared distance of every edge from its measured motion, as a quadratic at the present poses."""
    sums = np.zeros((len(edges), SUMS))
    weight = np.diag(1 / unit**2)
    for place, ((source, target), edge) in enumerate(zip(pairs, edges)):
        sums[place, :RIGHT] = weight[UPPER]
        sums[place, RIGHT:COST] = weight @ difference(between(poses, source, target), edge[2])
    return sums


def difference(pose: CameraPose, measured: CameraPose) -> FloatArray:
    """(6,) the step of equation (B16) that leads from `measured` to `pose`."""
    from scipy.spatial.transform import Rotation

    turn, shift = compose(pose, inverse(measured))
    found = np.empty(6)
    found[:3] = Rotation.from_matrix(turn).as_rotvec()
    found[3:] = shift
    return found
