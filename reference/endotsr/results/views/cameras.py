"""Camera paths around the observed camera, and cameras from a file.

In: the cameras of the frames and a pivot depth. Out: one camera per picture. For a clip with a static camera, a path
shows the three-dimensional structure of the scene. Conventions as in `splatting.camera`.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.flow.between import camera_between
from endotsr.clips.formats.camera import checked_rotation
from endotsr.clips.sequences.record import RecordedCamera
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.untrusted.json import read_json, typed

TURNING = ("orbit", "sway")
PATHS = ("observed", *TURNING)
LARGEST_SIDE = 16384  # pixels of a rendered picture


def turned(camera: Camera, yaw: float, pitch: float, pivot_depth: float) -> Camera:
    """The camera rotated about the point of its optical axis at `pivot_depth`, whose projection is unchanged.

    yaw, pitch    radians; positive: the camera moves right, and down
    pivot_depth   view-space z of the pivot, scene units
    """
    sy, cy, sp, cp = math.sin(yaw), math.cos(yaw), math.sin(pitch), math.cos(pitch)
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    turn, pivot = about_x.T @ about_y, np.array([0.0, 0.0, pivot_depth])
    rotation = turn @ np.asarray(camera.rotation, np.float64)
    return camera._replace(rotation=rotation, translation=turn @ (camera.translation - pivot) + pivot)


def shifted(camera: Camera, offset: tuple[float, ...]) -> Camera:
    """The camera translated by `offset` = (right, down, forward) along its own axes, scene units."""
    return camera._replace(translation=np.asarray(camera.translation, np.float64) - np.asarray(offset, np.float64))


def fitted(camera: Camera, width: int, height: int) -> Camera:
    """The camera for another picture size: the same aspect ratio of pixels, and at least the same field of view."""
    scale = min(width / camera.width, height / camera.height)
    return camera._replace(
        fx=camera.fx * scale,
        fy=camera.fy * scale,
        cx=camera.cx * scale + (width - camera.width * scale) / 2,
        cy=camera.cy * scale + (height - camera.height * scale) / 2,
        width=width,
        height=height,
    )


def path_cameras(path: str, cameras: list[Camera], angle: float, pivot_depth: float) -> list[Camera]:
    """The cameras moved along a path, with one period over all pictures: the last one precedes the first.

    path     observed: unchanged; sway: right, left and back; orbit: around a circle
    angle    largest rotation, degrees
    """
    radians, count = math.radians(angle), max(len(cameras), 1)
    phases = [2 * math.pi * k / count for k in range(count)]
    if path == "sway":
        return [turned(c, radians * math.sin(p), 0.0, pivot_depth) for c, p in zip(cameras, phases)]
    if path == "orbit":
        return [turned(c, radians * math.sin(p), radians * math.cos(p), pivot_depth) for c, p in zip(cameras, phases)]
    return list(cameras)


def pivot_depth_of(depth: FloatArray, opacity: FloatArray) -> float:
    """The median depth of a rendered view over pixels with opacity above 0.5; 1 if there are none."""
    seen = opacity > 0.5
    return float(np.median(depth[seen] / opacity[seen])) if seen.any() else 1.0


def read_cameras(file: Path, like: Camera) -> list[Camera]:
    """The cameras of a JSON file: `{"cameras": [{"rotation": 3x3, "translation": [3], "fx": ..., ...}, ...]}`.

    The keys are those of sequence.json: a world-to-camera pose and pinhole intrinsics in pixels. Poses are in export
    coordinates (`export.placement`), in which the first frame has the identity pose. Missing intrinsics and sizes are
    taken from `like`.

    Raises: InputError naming file, camera and key.
    """
    entries = read_json(Path(file)).get("cameras")
    if not isinstance(entries, list) or not entries:
        raise InputError(f'{file}: key cameras is missing; use {{"cameras": [{{"rotation": ...}}, ...]}}')
    return [_camera(entry, like, f"{file}: cameras[{k}]") for k, entry in enumerate(entries)]


def _camera(entry: Any, like: Camera, where: str) -> Camera:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: {type(entry).__name__}; use an object with rotation and translation")
    lens = {key: getattr(like, key) for key in ("fx", "fy", "cx", "cy", "width", "height")}
    found = typed(lens | entry, RecordedCamera, where).camera
    for key in ("width", "height"):
        checked_side(getattr(found, key), f"{where}: {key}")
    return found._replace(rotation=checked_rotation(found.rotation, f"{where}: rotation"))


def checked_side(side: Any, where: str) -> None:
    """Raises InputError if `side` is no valid number of pixels."""
    if isinstance(side, bool) or not isinstance(side, int) or not 1 <= side <= LARGEST_SIDE:
        raise InputError(f"{where} = {side!r} is not allowed; use an integer from 1 to {LARGEST_SIDE}")


def along(cameras: list[Camera], count: int) -> list[Camera]:
    """`count` cameras along the given ones, interpolated with `camera_between`, including the first and the last.

    One camera is the first. The size is that of the first camera, and intrinsics are not converted to it. If `count`
    cameras are given, they are returned unchanged.
    """
    if len(cameras) == count:
        return list(cameras)
    last, size = len(cameras) - 1, {"width": cameras[0].width, "height": cameras[0].height}
    places = np.linspace(0, last, count) if count > 1 else [0.0]
    pairs = [(k := min(int(place), max(last - 1, 0)), min(k + 1, last), place - k) for place in places]
    return [camera_between(cameras[a], cameras[b], fraction)._replace(**size) for a, b, fraction in pairs]
