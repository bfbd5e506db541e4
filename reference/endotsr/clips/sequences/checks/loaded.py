"""Checks that `frame_pass` makes for `endotsr check`, on a sequence in memory: what a training says of its frames.

In: the sequence as it was read, before it is scaled. Out: findings. Right views are no part of a sequence. The first
one is read here: its pair shows inverted depth, which a training refuses.
"""

import numpy as np

from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.depth import light_correlation, light_finding
from endotsr.clips.sequences.checks.flips import DepthTurns, pair_finding, shading_finding, shading_fit
from endotsr.clips.sequences.checks.frame_pass import SAMPLED
from endotsr.clips.sequences.checks.kinds import Finding
from endotsr.clips.sequences.checks.polarity import MaskEvidence
from endotsr.clips.sequences.checks.specks import Specks
from endotsr.clips.sequences.clip import Clip, colour_picture
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError


def loaded_mask_findings(sequence: Sequence, where: str) -> list[Finding]:
    """Masks that are noise, in all frames, and masks that fit the pictures after a flip, in the sampled ones."""
    specks, evidence = Specks(), MaskEvidence()
    for i, mask in enumerate(sequence.masks):
        specks.add(i, mask)
    for i in even_frames(sequence.count, SAMPLED):
        evidence.add(sequence.picture(i), sequence.masks[i], sequence.depth[i])
    return [*specks.findings(where), *evidence.flip_findings(where)]


def loaded_depth_findings(sequence: Sequence, where: str) -> list[Finding]:
    """Depth that opposes the light, that fits it after a flip, or whose orientation changes from frame to frame."""
    light, shading, turns = [], [], DepthTurns()
    for i in even_frames(sequence.count, SAMPLED):
        shown = sequence.picture(i), sequence.depth[i], sequence.masks[i]
        light.append(light_correlation(*shown))
        shading += filter(None, [shading_fit(*shown)])
    for i, depth in enumerate(sequence.depth):
        turns.add(i, depth)
    return [*light_finding(light, where), *shading_finding(shading, where), *turns.findings(where)]


def first_pair_findings(sequence: Sequence, clip: Clip, frames: range) -> list[Finding]:
    """Inverted or flipped depth, by the stereo pair of the first frame; none without a right view that can be read."""
    assert clip.depth is not None
    if len(clip.right) != clip.count:
        return []
    try:
        right = colour_picture(read_picture(clip.right[frames[0]]), clip.right[frames[0]])
    except InputError:
        return []  # a training reads no right view; `endotsr check` names the file
    left = np.ascontiguousarray(sequence.picture(0))
    if right.shape != left.shape or not sequence.depth[0].any():
        return []
    return pair_finding(left, right, sequence.depth[0], str(clip.depth.files[frames[0]]), 0)
