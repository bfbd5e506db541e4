"""Checks of poses and calibration: jumps, units, field of view, principal point."""

from itertools import pairwise

import numpy as np

from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.crop import Crop
from endotsr.clips.sequences.sampling import longest_run
from endotsr.clips.sequences.world import FAR_FROM_ORIGIN
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, camera_centre, degrees_between

JUMP = 20.0  # times the median step
TURN = 20.0  # degrees between neighbouring frames
REPEATED = 2  # steps in a row without any change of the pose
STILL = 1e-4  # of the depth; a shorter camera path is most likely in metres, with depth in millimetres
FARTHEST_STEP = 2.0  # of the depth; with a larger step, neighbouring frames would not overlap
WIDEST, NARROWEST = 150.0, 5.0  # degrees, horizontal field of view
OFF_CENTRE = 0.25  # of the picture
EXCHANGED, IN_TURN = 0.08, 3.0  # of the picture; times nearer to its centre with cx and cy exchanged
SHORTEST_BASELINE, LONGEST_BASELINE = 0.1, 1000.0  # mm; between the views of an endoscope, and of a car
SMALLER, LARGER, ALIKE = 0.75, 1.35, 0.05  # sizes whose centre is told from this one; difference of its two parts


def camera_findings(cameras: list[Camera], depth: float, where: str, crop: Crop | None = None) -> list[Finding]:
    """Findings on the cameras of a sequence; `depth` is its median depth, 0 if unknown; `crop` as in a `Clip`."""
    centres = np.array([camera_centre(camera) for camera in cameras])
    found = intrinsics_findings(cameras[0], where, crop) + _step_findings(cameras, centres, where)
    way, distance = float(np.ptp(centres, axis=0).max()), float(np.abs(centres).max())
    if depth and 0 < way < STILL * depth:
        found.append(finding("pose-unit", where, f"the camera moves {way:.3g} in all, the depth is {depth:.4g}"))
    step = float(np.median(np.linalg.norm(np.diff(centres, axis=0), axis=1))) if len(centres) > 1 else 0.0
    if depth and step > FARTHEST_STEP * depth:
        found.append(finding("pose-unit", where, f"the camera moves {step:.4g} a frame, the depth is {depth:.4g}"))
    if depth and distance > FAR_FROM_ORIGIN * depth:
        found.append(finding("far-from-origin", where, f"the cameras are {distance:.3g} from the origin"))
    return found


def _step_findings(cameras: list[Camera], centres: FloatArray, where: str) -> list[Finding]:
    """Jumps and turns between neighbouring frames."""
    found = []
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    moved = steps[steps > 0]
    usual = float(np.median(moved)) if moved.size > 2 else np.inf
    for i in np.flatnonzero(steps > JUMP * usual):
        found.append(finding("pose-jump", where, f"the camera moves {steps[i]:.4g}, usually {usual:.4g}", int(i) + 1))
    for i in range(1, len(cameras)):
        angle = degrees_between(cameras[i].rotation, cameras[i - 1].rotation)
        if angle > TURN:
            found.append(finding("pose-turn", where, f"the camera turns by {angle:.0f} degrees", i))
    return found + _repeated_finding(cameras, where)


def _repeated_finding(cameras: list[Camera], where: str) -> list[Finding]:
    """A note on a pose that is equal in every number over several frames, in a path that moves elsewhere."""
    numbers = [np.column_stack([camera.rotation, camera.translation]).tobytes() for camera in cameras]
    equal = np.array([a == b for a, b in pairwise(numbers)])
    if not equal.any() or equal.all():
        return []
    first, last = longest_run(equal)
    if last - first < REPEATED:
        return []
    identity = bool((cameras[first].rotation == np.eye(3)).all() and not cameras[first].translation.any())
    what = (
        f"the pose does not change in {equal.sum()} of {len(equal)} steps; frames {first} to {last} have one"
        f" pose{', the identity' if identity else ''}"
    )
    return [finding("repeated-pose", where, what, first)]


def intrinsics_findings(camera: Camera | Intrinsics, where: str, crop: Crop | None = None) -> list[Finding]:
    """Field of view, principal point, shape of the pixels; of a cropped clip, those of the pictures before the crop."""
    found = []
    camera = crop.before(camera) if crop else camera
    angle = float(np.degrees(2 * np.arctan(camera.width / (2 * camera.fx))))
    if not NARROWEST < angle < WIDEST:
        found.append(finding("field-of-view", where, f"the horizontal field of view is {angle:.1f} degrees"))
    apart = _off_centre(camera, camera.cx, camera.cy)
    exchanged = apart > max(EXCHANGED, IN_TURN * _off_centre(camera, camera.cy, camera.cx))
    factor = camera.cx / camera.width + camera.cy / camera.height  # 1: of the centre
    scaled = not SMALLER < factor < LARGER and abs(camera.cx / camera.width - camera.cy / camera.height) < ALIKE
    if apart > OFF_CENTRE or exchanged or scaled:
        size = f"{camera.width}x{camera.height}"
        what = f"the principal point is at ({camera.cx:g}, {camera.cy:g}) of {size}"
        what += ", the pictures before the crop" if crop else ""
        what += ", and near the centre with cx and cy exchanged" if exchanged else ""
        what += f", the centre of pictures of {factor:.3g} times this size" if scaled and factor > 0 else ""
        found.append(finding("principal-point", where, what))
    ratio = camera.fy / camera.fx
    if not 0.8 < ratio < 1.25:
        found.append(finding("pixel-shape", where, f"fy / fx is {ratio:.2f}"))
    return found


def baseline_findings(baseline: float | None, arbitrary: bool, where: str) -> list[Finding]:
    """A baseline in millimetres that no pair of cameras has; none for lengths in an arbitrary unit."""
    if not baseline or arbitrary or SHORTEST_BASELINE <= baseline <= LONGEST_BASELINE:
        return []
    units = ((1000.0, "metres"), (1e-3, "micrometres"))
    likely = [unit for factor, unit in units if 1.0 <= factor * baseline <= LONGEST_BASELINE]
    guess = f"; it looks like {likely[0]}" if likely else ""
    return [finding("baseline-unit", where, f"the two cameras are {baseline:.4g} mm apart{guess}")]


def _off_centre(camera: Camera | Intrinsics, x: float, y: float) -> float:
    """The distance of a point from the centre of the picture, as a fraction of its side, in the farther direction."""
    return max(abs(x / camera.width - 0.5), abs(y / camera.height - 0.5))
