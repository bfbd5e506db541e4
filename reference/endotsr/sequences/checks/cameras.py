"""Checks of poses and calibration: jumps, units, field of view, principal point."""

import numpy as np

from endotsr.sequences.checks.findings import Finding
from endotsr.sequences.world import FAR_FROM_ORIGIN
from endotsr.splatting.camera import Camera, camera_centre

JUMP = 20.0  # times the median step
TURN = 20.0  # degrees between neighbouring frames
STILL = 1e-4  # of the depth: a whole way shorter than this is most likely in metres beside millimetres
WIDEST, NARROWEST = 150.0, 5.0  # degrees, horizontal field of view
OFF_CENTRE = 0.25  # of the picture


def camera_findings(cameras: list[Camera], depth: float, where: str) -> list[Finding]:
    """Findings on the cameras of a sequence; `depth` is its median depth, 0 if unknown."""
    found = _lens_findings(cameras[0], where)
    centres = np.array([camera_centre(camera) for camera in cameras])
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    moved = steps[steps > 0]
    if moved.size and moved.size > 2:
        for i in np.flatnonzero(steps > JUMP * np.median(moved)):
            found.append(
                Finding(
                    "warning",
                    "pose-jump",
                    where,
                    int(i) + 1,
                    f"the camera moves {steps[i]:.4g}, usually {np.median(moved):.4g}",
                    "one wrong pose blurs the whole scene",
                    "check this pose, or leave the frame out",
                )
            )
    for i in range(1, len(cameras)):
        cosine = (np.trace(cameras[i].rotation @ cameras[i - 1].rotation.T) - 1) / 2
        angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
        if angle > TURN:
            found.append(
                Finding(
                    "warning",
                    "pose-turn",
                    where,
                    i,
                    f"the camera turns by {angle:.0f} degrees",
                    "between neighbouring frames this is most likely a wrong pose",
                    "check axes and direction of the trajectory",
                )
            )
    way = float(np.ptp(centres, axis=0).max())
    if depth and 0 < way < STILL * depth:
        found.append(
            Finding(
                "warning",
                "pose-unit",
                where,
                None,
                f"the camera moves {way:.3g} in all, the depth is {depth:.4g}",
                "the poses may be in metres beside a depth in millimetres",
                "state the unit: prepare --trajectory-unit",
            )
        )
    if depth and np.abs(centres).max() > FAR_FROM_ORIGIN * depth:
        found.append(
            Finding(
                "note",
                "far-from-origin",
                where,
                None,
                f"the cameras stand {np.abs(centres).max():.3g} from the origin",
                "float32 is too coarse there",
                "none needed: the world is moved",
            )
        )
    return found


def _lens_findings(camera: Camera, where: str) -> list[Finding]:
    found = []
    angle = float(np.degrees(2 * np.arctan(camera.width / (2 * camera.fx))))
    if not NARROWEST < angle < WIDEST:
        found.append(
            Finding(
                "warning",
                "field-of-view",
                where,
                None,
                f"the horizontal field of view is {angle:.1f} degrees",
                "the focal length may belong to another picture size or be in millimetres",
                "state the focal length in pixels of these pictures",
            )
        )
    across, down = abs(camera.cx / camera.width - 0.5), abs(camera.cy / camera.height - 0.5)
    if max(across, down) > OFF_CENTRE:
        found.append(
            Finding(
                "warning",
                "principal-point",
                where,
                None,
                f"the principal point is at ({camera.cx:g}, {camera.cy:g}) of {camera.width}x{camera.height}",
                "the calibration may belong to another picture size",
                "check width and height",
            )
        )
    ratio = camera.fy / camera.fx
    if not 0.8 < ratio < 1.25:
        found.append(
            Finding(
                "warning",
                "pixel-shape",
                where,
                None,
                f"fy / fx is {ratio:.2f}",
                "pixels are rarely that oblong; pictures may have been stretched",
                "check the calibration against the picture size",
            )
        )
    return found
