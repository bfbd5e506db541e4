"""The test of a moving camera: from the poses if they differ, else from pictures and depth, else from pictures alone.

Equal poses are usually no statement at all: a clip without a trajectory has them too. The pictures then decide, by the
rule of `endotsr poses` (`clips.poses.movement`). Without depth, the camera is never called still.
"""

import numpy as np

from endotsr.clips.effects.frames import ReducedFrames
from endotsr.clips.effects.verdict import UNKNOWN, Curve, EffectVerdict
from endotsr.clips.poses.matches import matcher_of
from endotsr.clips.poses.movement import DRIFT, LEAST_FLOW, MOVING, STILL, Movement, drift, movement, pairs_that_move
from endotsr.clips.poses.views import Views, known_depth, small_views
from endotsr.clips.sequences.read import NOT_METRIC
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.splatting.camera import camera_centre, degrees_between

LEAST_POSE_CHANGE = 1e-9  # scene units, and elements of the rotation
KINDS = {"moving": "moving", "still": "none", "unclear": UNKNOWN}
RIGID = f"fraction of the flow that one rigid motion explains; below {1 - STILL:.2f} the camera is still"
DRIFTS = "drift of the picture; the camera is never called still"


def camera_verdict(sequence: Sequence, clip: ReducedFrames) -> EffectVerdict:
    """Whether the camera moves: a fact if the poses of the training frames differ, else a test of the pictures."""
    centres = np.array([camera_centre(camera) for camera in clip.cameras])
    turns = np.array([camera.rotation for camera in clip.cameras])
    shift = float(np.abs(centres - centres[0]).max())
    spread = max(shift, float(np.abs(turns - turns[0]).max()))
    if sequence.static_camera or spread <= LEAST_POSE_CHANGE:
        return _seen_verdict(sequence)
    path = np.linalg.norm(centres - centres[0], axis=1)
    turned = max(degrees_between(turn, turns[0]) for turn in turns)
    curve = Curve(f"distance from the first pose, {sequence.unit}", "time", clip.times, {"camera": path})
    return EffectVerdict("camera motion", True, "moving", spread, LEAST_POSE_CHANGE,
                         f"{sequence.unit}, and elements of the rotation", "largest difference of two poses", 0.0,
                         f"The camera moves by up to {path.max():.3g} {sequence.unit} and turns by up to {turned:.2f}"
                         " degrees.", {"largest_shift": float(path.max()), "largest_turn": turned}, curve)  # fmt: skip


def _seen_verdict(sequence: Sequence) -> EffectVerdict:
    """The verdict from the pictures of the training frames, for a clip whose poses are all the same."""
    found = seen_movement(sequence)
    by_depth = bool(np.isnan(found.drift))
    explained = 1.0 - found.left if np.isfinite(found.left) and found.flow >= LEAST_FLOW else 0.0
    statistic, threshold = (explained, 1.0 - MOVING) if by_depth else (found.drift, DRIFT)
    unit, test = ("fraction of the flow", RIGID) if by_depth else ("fraction of the width", DRIFTS)
    advice = "; endotsr poses estimates the poses" if by_depth else "; poses need depth first: endotsr depth"
    reason = f"All frames have the same pose; {found.sentence}{advice if found.answer == 'moving' else ''}."
    details = {"pairs": found.pairs, "flow": found.flow if np.isfinite(found.flow) else 0.0}
    return EffectVerdict("camera motion", found.answer == "moving", KINDS[found.answer], statistic, threshold, unit,
                         test, None, reason, details)  # fmt: skip


def seen_movement(sequence: Sequence) -> Movement:
    """Whether the camera moves, from the pictures of the training frames, and from their depth if it was measured.

    With assumed depth, a rigid motion does not explain the flow of a moving camera either.
    """
    index = sequence.train_index
    depth = known_depth(sequence.depth[index])
    views = Views(sequence.images[index], sequence.masks[index], depth, sequence.cameras[0])
    assumed = any(note.startswith(NOT_METRIC) for note in sequence.notes)
    if (depth > 0).any() and not assumed:
        return movement(pairs_that_move(matcher_of(small_views(views))))
    return drift(matcher_of(small_views(views._replace(depth=np.ones_like(depth)))))
