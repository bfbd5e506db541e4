"""Errors of estimated poses against true ones, after the best common motion of all cameras.

In: world-to-camera poses. Out: errors in scene units and degrees.
"""

import numpy as np

from endotsr.clips.poses.views import compose, inverse
from endotsr.method.splatting.camera import CameraPose


def centres(poses: list[CameraPose]) -> np.ndarray:
    """Optical centres, (n, 3)."""
    return np.array([-pose.rotation.T @ pose.translation for pose in poses])


def path_errors(poses: list[CameraPose | None], true: list[CameraPose], scaled: bool) -> dict[str, float]:
    """Errors over the frames that have a pose.

    scaled   whether the scale of the estimate is fitted too

    Returns: `registered` frames; `path`, the length of the true path; and with three or more registered frames `error`,
             the root mean square distance of the centres after alignment; `of_path`, its ratio to the path; `step` and
             `step_degrees`, the root mean square error of the motion between successive frames.
    """
    known = [k for k, pose in enumerate(poses) if pose is not None]
    path = float(np.linalg.norm(np.diff(centres(true), axis=0), axis=1).sum())
    found = {"registered": len(known), "path": path}
    if len(known) < 3:
        return found
    estimate, reference = [poses[k] for k in known], [true[k] for k in known]
    factor, distance = aligned(centres(estimate), centres(reference), scaled)  # type: ignore[arg-type]
    error = float(np.sqrt(np.square(distance).sum(axis=1).mean()))
    return found | {"error": error, "of_path": error / path} | _steps(known, poses, true, factor)


def aligned(found: np.ndarray, true: np.ndarray, scaled: bool) -> tuple[float, np.ndarray]:
    """The scale, and the differences (n, 3) that the best common motion leaves; the scale is 1 unless `scaled`."""
    from scipy.spatial.transform import Rotation

    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    if not np.abs(a).max() > 0:
        return 1.0, -b
    turn = Rotation.align_vectors(b, a)[0]
    a = turn.apply(a)
    factor = float((a * b).sum() / (a * a).sum()) if scaled else 1.0
    return factor, factor * a - b


def _steps(known: list[int], poses: list[CameraPose | None], true: list[CameraPose], factor: float) -> dict[str, float]:
    """The error of the motion between successive frames."""
    from scipy.spatial.transform import Rotation

    far, turned = [], []
    for k in known:
        one, other = poses[k], poses[k + 1] if k + 1 < len(poses) else None
        if one is None or other is None:
            continue
        step, wanted = compose(other, inverse(one)), compose(true[k + 1], inverse(true[k]))
        error = compose(step._replace(translation=factor * step.translation), inverse(wanted))
        far.append(np.linalg.norm(error.translation))
        turned.append(np.degrees(Rotation.from_matrix(error.rotation).magnitude()))
    if not far:
        return {}
    return {"step": float(np.sqrt(np.square(far).mean())), "step_degrees": float(np.sqrt(np.square(turned).mean()))}
