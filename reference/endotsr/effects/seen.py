"""Facts that need no estimate of motion: occluders in the masks, motion of the camera, and mirror highlights."""

import numpy as np
from numpy.typing import NDArray

from endotsr.effects.clip import Clip
from endotsr.effects.verdict import Curve, EffectVerdict, Map
from endotsr.kernels.arrays import BoolArray
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.camera import camera_centre

SATURATED, COLOURLESS = 0.98, 0.1  # a highlight: largest channel above, (max - min) / max below
LEAST_HIGHLIGHT = 1e-3  # fraction of the tissue
LEAST_POSE_CHANGE = 1e-9  # scene units, and elements of the rotation


def occluder_verdict(sequence: Sequence, clip: Clip) -> EffectVerdict:
    """Whether any pixel of a training frame is excluded; a fact of the masks."""
    masks = sequence.masks[sequence.train_index]
    by_frame = 1.0 - masks.mean(axis=(1, 2))
    always, ever = (~masks).all(axis=0), (~masks).any(axis=0)
    excluded = float(by_frame.mean())
    moves = bool((ever & ~always).any())
    kind = "none" if excluded == 0 else "moving" if moves else "fixed"
    reason = {
        "none": "The masks exclude no pixel.",
        "fixed": f"The masks exclude the same {excluded:.1%} of the pixels in every frame.",
        "moving": f"The masks exclude {excluded:.1%} of the pixels; {always.mean():.1%} are never seen.",
    }[kind]
    curve = Curve("excluded, percent of the pixels", "time", clip.times, {"excluded": 100 * by_frame})
    picture = Map("excluded, percent of the frames", 100 * (~clip.masks).mean(axis=0))
    details = {"never_seen": float(always.mean())}
    return EffectVerdict("occluders", excluded > 0, kind, excluded, 0.0, "fraction of the pixels",
                         "excluded pixels", 0.0, reason, details, curve, picture)  # fmt: skip


def camera_verdict(sequence: Sequence, clip: Clip) -> EffectVerdict:
    """Whether the poses of the training frames differ; a fact of the poses."""
    centres = np.array([camera_centre(camera) for camera in clip.cameras])
    turns = np.array([camera.rotation for camera in clip.cameras])
    shift = float(np.abs(centres - centres[0]).max())
    spread = max(shift, float(np.abs(turns - turns[0]).max()))
    moves = not sequence.static_camera and spread > LEAST_POSE_CHANGE
    path = np.linalg.norm(centres - centres[0], axis=1)
    reason = (
        f"The camera moves by up to {path.max():.3g} {sequence.unit}." if moves else "All frames have the same pose."
    )
    details = {"largest_shift": float(path.max())}
    curve = Curve(f"distance from the first pose, {sequence.unit}", "time", clip.times, {"camera": path})
    return EffectVerdict("camera motion", moves, "moving" if moves else "none", spread, LEAST_POSE_CHANGE,
                         sequence.unit, "largest difference of two poses", 0.0, reason, details,
                         curve if moves else None)  # fmt: skip


def highlight_verdict(sequence: Sequence, clip: Clip) -> EffectVerdict:
    """Saturated and colourless tissue pixels at full size."""
    fractions, sums = [], np.zeros((sequence.height, sequence.width))
    for i in sequence.train_index:
        bright = highlights(sequence.images[i]) & sequence.masks[i]
        fractions.append(bright.sum() / max(int(sequence.masks[i].sum()), 1))
        sums += bright
    fraction = np.array(fractions)
    statistic = float(fraction.mean())
    fixed = float((sums >= 0.9 * len(fraction)).sum() / max(int((sums > 0).sum()), 1))
    present = statistic >= LEAST_HIGHLIGHT
    kind = "none" if not present else "fixed" if fixed > 0.5 else "moving"
    reason = f"Saturated pixels without colour cover {statistic:.2%} of the tissue."
    side = clip.shrink
    cut = sums[: sums.shape[0] // side * side, : sums.shape[1] // side * side]
    picture = cut.reshape(cut.shape[0] // side, side, cut.shape[1] // side, side).mean(axis=(1, 3))
    return EffectVerdict("highlights", present, kind, statistic, LEAST_HIGHLIGHT, "fraction of the tissue",
                         "saturated pixels without colour", 0.01, reason, {"fixed_fraction": fixed},
                         Curve("highlights, percent of the tissue", "time", clip.times, {"highlights": 100 * fraction},
                         100 * LEAST_HIGHLIGHT),
                         Map("highlight, percent of the frames", 100 * picture / len(fraction)))  # fmt: skip


def highlights(image: NDArray[np.uint8]) -> BoolArray:
    """(3, H, W) uint8 to (H, W) bool: the largest channel above 0.98, the smallest within a tenth of it."""
    largest, smallest = image.max(axis=0).astype(np.float32), image.min(axis=0).astype(np.float32)
    return (largest > SATURATED * 255) & (largest - smallest < COLOURLESS * largest)
