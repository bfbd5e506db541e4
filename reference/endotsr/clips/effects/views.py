"""Whether the views differ enough to separate view-dependent colour of each degree from constant colour.

For points of the reference depth, the harmonics of a degree are evaluated along the view directions of the training
cameras, and the part explained by lower degrees is removed. The root mean square of the residual is the change of
colour between frames per unit coefficient. A coefficient of `TYPICAL` must change the colour visibly, by at least half
a grey level. A fixed camera sees every static point along one direction and determines only degree 0.
"""

import numpy as np

from endotsr.clips.effects.frames import ReducedFrames
from endotsr.clips.effects.verdict import UNKNOWN, EffectVerdict
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.camera import backproject, camera_centre
from endotsr.method.splatting.harmonics_formulas import harmonic_basis

TYPICAL = 0.1  # typical coefficient of trained scenes, display units
LEAST_CHANGE = 0.5 / 255.0  # display units
POINTS = 64
SEED = 21
HIGHEST = 3


def view_verdict(sequence: Sequence, clip: ReducedFrames) -> EffectVerdict:
    """The verdict on the highest degree that the views determine; `kind` is "degree D"."""
    test = "change of colour by a typical coefficient of degree 1 between frames"
    if sequence.static_camera:
        return EffectVerdict("view change", False, "degree 0", 0.0, LEAST_CHANGE, "display units", test, 0.0,
                             "All frames have the same pose: every point keeps one view direction.",
                             {"degree": 0, "changes": [0.0] * HIGHEST, "angle_degrees": 0.0})  # fmt: skip
    directions = view_directions(clip)
    if not len(directions):
        reason = "Without depth the view directions are not known; every degree is assumed."
        details = {"degree": HIGHEST, "changes": [LEAST_CHANGE] * HIGHEST, "angle_degrees": 0.0}
        return EffectVerdict("view change", True, UNKNOWN, LEAST_CHANGE, LEAST_CHANGE, "display units", test, 0.01,
                             reason, details)  # fmt: skip
    changes = [float(np.median([degree_change(d, k) for d in directions])) for k in range(1, HIGHEST + 1)]
    degree = next((k - 1 for k in range(1, HIGHEST + 1) if changes[k - 1] < LEAST_CHANGE), HIGHEST)
    angle = float(np.degrees(np.median([largest_angle(d) for d in directions])))
    reason = f"The view of a point turns by {angle:.2g} degrees from the first frame, which determines degree {degree}."
    return EffectVerdict("view change", degree > 0, f"degree {degree}", changes[0], LEAST_CHANGE, "display units", test,
                         0.01, reason, {"degree": degree, "changes": changes, "angle_degrees": angle})  # fmt: skip


def view_directions(clip: ReducedFrames) -> FloatArray:
    """Unit vectors (P, m, 3) from the cameras to points of the reference depth; P = 0 without depth."""
    depth = clip.depth[clip.reference]
    known = np.flatnonzero((depth > 0) & clip.masks[clip.reference])
    chosen = np.sort(np.random.default_rng(SEED).permutation(known)[:POINTS])
    row, column = np.divmod(chosen, depth.shape[1])
    u, v = (axis * clip.shrink + clip.shrink // 2 for axis in (column, row))
    points = backproject(clip.cameras[clip.reference], u, v, depth.ravel()[chosen].astype(float))
    centres = np.array([camera_centre(camera) for camera in clip.cameras])
    away = points.T[:, None, :] - centres[None]
    return away / np.linalg.norm(away, axis=2, keepdims=True)


def degree_change(directions: FloatArray, degree: int) -> float:
    """RMS over frames of TYPICAL x the strongest harmonic of this degree, without the lower degrees."""
    lower, own = harmonic_design(directions, degree - 1), harmonic_design(directions, degree)
    own = own[:, lower.shape[1] :]
    # singular directions at rounding level are ignored
    left, sizes, _ = np.linalg.svd(lower, full_matrices=False)
    basis = left[:, sizes > 1e-6 * sizes[0]]
    rest = own - basis @ (basis.T @ own)
    return TYPICAL * float(np.linalg.svd(rest, compute_uv=False)[0]) / len(directions) ** 0.5


def harmonic_design(directions: FloatArray, degree: int) -> FloatArray:
    """Harmonics of degree 0 ... `degree` along directions (m, 3): one row per direction, (degree + 1)^2 columns."""
    formula = harmonic_basis.py_func  # uncompiled: there are only a few thousand directions
    rows = [(Y00, *formula(*map(float, direction))) for direction in directions]
    return np.array(rows)[:, : (degree + 1) ** 2]


def harmonic_sizes(clip: ReducedFrames) -> FloatArray:
    """Mean |Y_k| over the pixel directions of the reference camera in world axes, (16,)."""
    camera = clip.cameras[clip.reference]
    u, v = (np.linspace(0, side - 1, 9).ravel() for side in (camera.width, camera.height))
    column, row = (axis.ravel() for axis in np.meshgrid(u, v))
    away = backproject(camera, column, row, np.ones(column.size)).T - camera_centre(camera)
    directions = away / np.linalg.norm(away, axis=1, keepdims=True)
    return np.abs(harmonic_design(directions, HIGHEST)).mean(axis=0)


def largest_angle(directions: FloatArray) -> float:
    """Largest angle to the first direction, radians."""
    return float(np.arccos(np.clip(directions @ directions[0], -1, 1)).max())
