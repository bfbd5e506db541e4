"""Which pictures are made: a time, a camera and a name for each.

In: what the user asks for and the record of the sequence (sequence.json). Out: the views, checked.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from endotsr.errors import InputError
from endotsr.runs.sources import nearest_frame, remembered_cameras
from endotsr.splatting.camera import Camera
from endotsr.views.cameras import PATHS, along, checked_side, fitted, path_cameras, read_cameras, shifted

LARGEST_ANGLE = 89.0  # degrees: beyond it a scene that was seen from one side is empty


class View(NamedTuple):
    """Time, camera and name of one picture."""

    time: float
    frame: int  # whose camera it is, or that the camera path starts from
    label: str
    camera: Camera
    exact: bool  # whether this is the moment of a frame and its own camera, so that it can be compared with it


@dataclass(frozen=True)
class Request:
    """The views that are asked for. One of `times`, `frames` and `count` is given, or none for the default."""

    times: tuple[float, ...] = ()
    frames: Literal["test", "train", "all"] | None = None
    count: int | None = None
    camera: str = "observed"  # a path, the number of a frame, or a JSON file
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)  # right, down, forward; scene units
    size: str = ""  # WIDTHxHEIGHT
    angle: float = 8.0  # degrees, of orbit and sway


def moments(request: Request, record: dict[str, Any], default: str = "test") -> list[tuple[float, int, str, bool]]:
    """Time, nearest frame, name, and whether it is the moment of that frame.

    Raises: InputError for a time that does not exist, or for two ways to choose the times.
    """
    if sum([bool(request.times), request.frames is not None, request.count is not None]) > 1:
        raise InputError("render: give one of --times, --frames and --count")
    if request.times or request.count is not None:
        times = list(request.times) or _even(request.count or 0)
        for time in times:
            if not 0.0 <= time <= 1.0:
                raise InputError(f"render: --times {time:g} is not allowed; allowed: times in [0, 1]")
        known = record["times"]
        nearest = [nearest_frame(known, t) for t in times]
        return [(t, i, f"{k:05d}", known[i] == t) for k, (t, i) in enumerate(zip(times, nearest))]
    every = range(len(record["names"]))
    chosen = {"test": record["test_index"], "train": record["train_index"], "all": every}[request.frames or default]
    return [(record["times"][i], i, record["names"][i], True) for i in chosen]


def _even(count: int) -> list[float]:
    if count < 1:
        raise InputError(f"render: --count {count} is not allowed; allowed: an integer >= 1")
    return [i / max(count - 1, 1) for i in range(count)]


def check_request(request: Request, record: dict[str, Any], default: str = "test") -> None:
    """Everything that can be refused without a model and its cameras. Raises: InputError."""
    moments(request, record, default)
    if request.size:
        read_size(request.size)
    if not 0.0 <= request.angle <= LARGEST_ANGLE:
        raise InputError(f"render: --angle {request.angle:g} is not allowed; allowed: 0 to {LARGEST_ANGLE:g} degrees")
    if not all(math.isfinite(number) for number in request.offset):
        raise InputError("render: --offset is not allowed; allowed: three finite numbers")
    camera, count = request.camera, len(record["names"])
    if camera.lstrip("-").isdecimal() and not 0 <= int(camera) < count:
        raise InputError(f"render: --camera {camera} is not allowed; allowed: a frame from 0 to {count - 1}")
    if not (camera in PATHS or camera.isdecimal() or camera.lower().endswith(".json")):
        allowed = f"{', '.join(PATHS)}, the number of a frame, or a JSON file of cameras"
        raise InputError(f"render: --camera {camera!r} is not allowed; allowed: {allowed}")


def views_of(request: Request, record: dict[str, Any], pivot_depth: float, default: str = "test") -> list[View]:
    """The views of a request.

    request       checked by `check_request`
    record        sequence.json
    pivot_depth   depth of the point around which `orbit` and `sway` turn, scene units
    default       frames to show if no times are chosen

    Raises: InputError for a file of cameras that cannot be used.
    """
    wanted = moments(request, record, default)
    observed = remembered_cameras(record)
    cameras, own = _cameras(request, observed, [frame for _, frame, _, _ in wanted], pivot_depth)
    if any(request.offset):
        cameras = [shifted(camera, request.offset) for camera in cameras]
    if request.size:
        width, height = read_size(request.size)
        cameras = [fitted(camera, width, height) for camera in cameras]
    own = own and not any(request.offset) and not request.size
    if request.camera.isdecimal():
        wanted = [(t, int(request.camera), label, False) for t, _, label, _ in wanted]
    return [View(t, i, label, camera, own and exact) for (t, i, label, exact), camera in zip(wanted, cameras)]


def _cameras(
    request: Request, observed: list[Camera], frames: list[int], pivot_depth: float
) -> tuple[list[Camera], bool]:
    """One camera for each of the frames, and whether they are those of the frames."""
    nearest = [observed[i] for i in frames]
    if request.camera in PATHS:
        return path_cameras(request.camera, nearest, request.angle, pivot_depth), request.camera == "observed"
    if request.camera.isdecimal():
        return [observed[int(request.camera)]] * len(frames), False
    return along(read_cameras(Path(request.camera), observed[0]), len(frames)), False


def read_size(text: str) -> tuple[int, int]:
    """Width and height of `WIDTHxHEIGHT`. Raises InputError."""
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise InputError(f"render: --size {text!r} is not allowed; allowed: WIDTHxHEIGHT, for example 1280x1024")
    for side in (width, height):
        checked_side(int(side), f"render: --size {text}: side")
    return int(width), int(height)
