"""The views to render: a time, a camera and a name for each.

In: the user's options and the record of the sequence (sequence.json). Out: the checked views.
"""

import math
from pathlib import Path
from typing import NamedTuple

from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.results.export.placement import HERE, Placement, training_camera
from endotsr.results.export.times import Times
from endotsr.results.views.cameras import PATHS, along, checked_side, fitted, path_cameras, read_cameras, shifted

LARGEST_ANGLE = 89.0  # degrees; at 90 a surface that faces the observed camera is seen edge-on


class PlannedView(NamedTuple):
    """Time, camera and name of one picture."""

    time: float
    frame: int  # the frame given as camera, else the frame nearest in time
    label: str
    camera: Camera
    exact: bool  # whether time and camera are exactly those of the frame, which allows a comparison


class ViewRequest(NamedTuple):
    """The user's choice of views."""

    times: Times = Times()
    camera: str = "observed"  # a path, the number of a frame, or a JSON file
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)  # right, down, forward; scene units
    size: str = ""  # WIDTHxHEIGHT
    angle: float = 8.0  # degrees, of orbit and sway


def check_request(request: ViewRequest, count: int) -> None:
    """Check a request on a sequence of `count` frames without its model. Raises: InputError."""
    if request.size:
        read_size(request.size)
    if not 0.0 <= request.angle <= LARGEST_ANGLE:
        raise InputError(f"render: --angle {request.angle:g} is not allowed; use 0 to {LARGEST_ANGLE:g} degrees")
    if not all(math.isfinite(number) for number in request.offset):
        raise InputError("render: --offset is not allowed; use three finite numbers")
    camera = request.camera
    if camera.removeprefix("-").isdecimal() and not 0 <= int(camera) < count:
        raise InputError(f"render: --camera {camera} is not allowed; use a frame from 0 to {count - 1}")
    if not (camera in PATHS or camera.isdecimal() or camera.lower().endswith(".json")):
        allowed = f"{', '.join(PATHS)}, the number of a frame, or a JSON file of cameras"
        raise InputError(f"render: --camera {camera!r} is not allowed; use {allowed}")


def planned_views(
    request: ViewRequest,
    wanted: list[tuple[float, int, str, bool]],
    observed: list[Camera],
    pivot_depth: float,
    placement: Placement = HERE,
) -> list[PlannedView]:
    """The views of a request.

    request       checked by `check_request`
    wanted        its `chosen_times`
    observed      the cameras of the frames
    pivot_depth   depth of the pivot of `orbit` and `sway`, scene units
    placement     from training to export coordinates, in which a camera file is given

    Raises: InputError for an unusable camera file.
    """
    cameras, own = _cameras(request, observed, [frame for _, frame, _, _ in wanted], pivot_depth, placement)
    if any(request.offset):
        cameras = [shifted(camera, request.offset) for camera in cameras]
    if request.size:
        width, height = read_size(request.size)
        cameras = [fitted(camera, width, height) for camera in cameras]
    own = own and not any(request.offset) and not request.size
    if request.camera.isdecimal():
        wanted = [(t, int(request.camera), label, False) for t, _, label, _ in wanted]
    return [PlannedView(t, i, label, camera, own and exact) for (t, i, label, exact), camera in zip(wanted, cameras)]


def _cameras(
    request: ViewRequest, observed: list[Camera], frames: list[int], pivot_depth: float, placement: Placement
) -> tuple[list[Camera], bool]:
    """One camera per frame, and whether they are the frames' own cameras."""
    nearest = [observed[i] for i in frames]
    if request.camera in PATHS:
        return path_cameras(request.camera, nearest, request.angle, pivot_depth), request.camera == "observed"
    if request.camera.isdecimal():
        return [observed[int(request.camera)]] * len(frames), False
    given = along(read_cameras(Path(request.camera), observed[0]), len(frames))
    return [training_camera(camera, placement) for camera in given], False


def read_size(text: str) -> tuple[int, int]:
    """Width and height of `WIDTHxHEIGHT`. Raises InputError."""
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise InputError(f"render: --size {text!r} is not allowed; use WIDTHxHEIGHT, for example 1280x1024")
    for side in (width, height):
        checked_side(int(side), f"render: --size {text}: side")
    return int(width), int(height)
