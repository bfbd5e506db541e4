"""Pictures of views: a folder of PNG and NPY files, a film, or both from the same renders.

In: a scene and its views. Out: a folder with colour/, depth/, opacity/ and render.json; or a film of panels in a row.
"""

from collections import deque
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any, Literal, NamedTuple, NotRequired, Protocol, TypedDict

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.sequence import Frame, Sequence
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.depth import normalised_depth
from endotsr.results.export.files import check_folder_name
from endotsr.results.export.placement import Placement, placed_camera
from endotsr.results.export.scene import MovingScene
from endotsr.results.export.times import chosen_times
from endotsr.results.report.figures import ByteImage, bytes_image
from endotsr.results.views.cameras import TURNING, pivot_depth_of
from endotsr.results.views.film import check_film
from endotsr.results.views.panels import NEEDS_TRUTH, Panel, scale_of, side_by_side
from endotsr.results.views.plan import PlannedView, ViewRequest, check_request, planned_views
from endotsr.training.runs.files import refuse_replacing, write_json
from endotsr.training.runs.folder import refuse_existing
from endotsr.training.runs.sources import load_run_sequence
from endotsr.untrusted.writing import replacing_folder

DepthKind = Literal["accumulated", "normalised"]
ABOUT_DEPTH = {
    "accumulated": "not normalised by opacity",
    "normalised": "normalised by opacity",
}
DEPTH_LEVELS = 65535  # of a 16-bit picture
DEPTH_HEADROOM = 1.5  # factor on the largest depth of the prior and the first view; other views may exceed it


class PictureEntry(TypedDict):
    """A picture in render.json."""

    file: str
    time: float
    camera_of_frame: int
    camera: NotRequired[dict[str, Any]]  # unless the view is exactly that of a frame


class ReadFrames(Protocol):
    """The recorded frames for a film: a `Sequence`, or frames read on demand."""

    def frame(self, index: int) -> Frame:
        """Frame `index` of the scene's record."""
        ...


class Look(NamedTuple):
    """Options for the appearance of views."""

    depth: DepthKind = "accumulated"
    taken_out: tuple[str, ...] = ()  # spectral components to leave out
    panels: tuple[Panel, ...] = ("render",)  # of a film, left to right


def check_panels(panels: tuple[Panel, ...], views: list[PlannedView]) -> None:
    """Raises InputError for no panels, for views of several sizes, and for truth or error in views that match no frame.

    views   of a film, whose pictures have one size
    """
    if not panels:
        raise InputError("render: --panels is empty; use one or more of render, truth, error, depth, opacity")
    sizes = [f"{width}x{height}" for width, height in dict.fromkeys((v.camera.width, v.camera.height) for v in views)]
    if len(sizes) > 1:
        raise InputError(f"render: --film: views of {', '.join(sizes[:3])}; use one size (--size WIDTHxHEIGHT)")
    needed = [name for name in panels if name in NEEDS_TRUTH]
    moved = next((view for view in views if not view.exact), None)
    if needed and moved is not None:
        raise InputError(
            f"render: --panels {needed[0]} at time {moved.time:g}: no frame has this time and camera; "
            "use the times of frames (--frames), --camera observed, no --offset and no --size"
        )


def requested_views(scene: MovingScene, request: ViewRequest, default: str) -> list[PlannedView]:
    """The views of a request. Paths rotate about the point at the median depth of the first view.

    default   frames to show if no times are chosen
    Raises: InputError as `check_request`, before the model is read, as `planned_views`, and as `MovingScene.model`.
    """
    wanted = chosen_times("render", request.times, scene.record, default)
    check_request(request, scene.record.count)
    pivot_depth, _ = 1.0, scene.model
    if request.camera in TURNING:
        time, frame, _, _ = wanted[0]
        out = scene.render(time, scene.cameras[frame])
        pivot_depth = pivot_depth_of(out.depth, out.opacity)
    return planned_views(request, wanted, scene.cameras, pivot_depth, scene.placement)


def check_outputs(
    out: Path | None,
    film: Path | None,
    rate: float | None = None,
    slow: float | None = None,
    replace: bool = False,
    option: str = "--film",
) -> None:
    """Raises InputError without an output, or if the folder or film cannot be written.

    replace   whether a film that endotsr did not write may be replaced
    option    that names the film, for the message; empty in Python
    """
    if out is None and film is None:
        raise InputError("render: --out DIR or --film FILE is missing; use one or both")
    if out is not None:
        check_folder_name(out, "pictures", film="--film FILE writes a film")
        refuse_existing(out)
    if film is not None:
        check_film(film, rate, slow)
        refuse_replacing(film, replace, option)


def frames_shown(
    scene: MovingScene, panels: tuple[Panel, ...], views: list[PlannedView], source: str | None
) -> Sequence | None:
    """The sequence for the panels truth and error; None if they are not shown.

    source   its current location; default: the recorded one
    Raises: InputError as `check_panels`, and if the scene is no run folder.
    """
    check_panels(panels, views)
    if not set(panels) & set(NEEDS_TRUTH):
        return None
    if scene.folder is None:
        raise InputError("render: --panels truth and error need the frames of a run folder; use a run folder")
    return load_run_sequence(scene.folder, source)


def rendered(scene: MovingScene, views: list[PlannedView], look: Look) -> Iterator[tuple[PlannedView, RenderOut]]:
    """Render every view, with the requested kind of depth."""
    for view in views:
        out = scene.render(view.time, view.camera, look.taken_out)
        yield view, out if look.depth == "accumulated" else out._replace(depth=normalised_depth(out))


def dropped(pictures: Iterator[tuple[PlannedView, RenderOut]]) -> None:
    """Consume pictures without keeping any of them."""
    deque(pictures, maxlen=0)


def write_pictures(
    out: Path,
    scene: MovingScene,
    pictures: Iterator[tuple[PlannedView, RenderOut]],
    look: Look,
    npy: bool = False,
    consume: Callable[[Iterator[tuple[PlannedView, RenderOut]]], object] = dropped,
) -> int:
    """Write a folder atomically; returns the number of pictures.

    npy       also write float arrays
    consume   consumes the pictures after they are written, for example to write a film of the same renders; the default
              keeps none of them
    """
    out.absolute().parent.mkdir(parents=True, exist_ok=True)
    entries: list[PictureEntry] = []
    with replacing_folder(out) as target:
        for name in ("colour", "depth", "opacity"):
            (target / name).mkdir()
        first = next(pictures)
        step = depth_step(scene.record.largest_depth, first[1].depth)

        def written() -> Iterator[tuple[PlannedView, RenderOut]]:
            for view, picture in chain([first], pictures):
                _write_view(target, view.label, picture, step, npy)
                entries.append(_entry(view, scene.placement))
                yield view, picture

        consume(written())
        unit, kind = scene.record.unit, ABOUT_DEPTH[look.depth]
        about = f"depth PNG value x depth_step = view-space z in {unit}, {kind}"
        write_json(target / "render.json", {"depth_step": step, "about": about, "pictures": entries})
    return len(entries)


def _entry(view: PlannedView, placement: Placement) -> PictureEntry:
    """The entry of render.json, with the camera unless the view is exactly that of a frame."""
    entry: PictureEntry = {"file": f"{view.label}.png", "time": view.time, "camera_of_frame": view.frame}
    return entry if view.exact else {**entry, "camera": _as_json(placed_camera(view.camera, placement))}


def _write_view(target: Path, label: str, out: RenderOut, step: float, npy: bool) -> None:
    write_png(target / "colour" / f"{label}.png", bytes_image(out.colour))
    write_png(target / "depth" / f"{label}.png", depth_bytes(out.depth, step))
    write_png(target / "opacity" / f"{label}.png", np.rint(np.clip(out.opacity, 0, 1) * 255).astype(np.uint8))
    if npy:
        for name in ("colour", "depth", "opacity"):
            np.save(target / name / f"{label}.npy", getattr(out, name))


def depth_step(largest_depth: float, depth: FloatArray) -> float:
    """Scene units per level of a 16-bit depth picture: a power of two with headroom, the same for all views."""
    largest = max(largest_depth, float(np.nan_to_num(depth).max()), 1e-6) * DEPTH_HEADROOM
    return float(2.0 ** np.ceil(np.log2(largest / DEPTH_LEVELS)))


def depth_bytes(depth: FloatArray, step: float) -> NDArray[np.uint16]:
    """(H, W) depth in scene units -> 16-bit levels, clipped; 0 = no depth."""
    return np.clip(np.rint(np.nan_to_num(depth) / step), 0, DEPTH_LEVELS).astype(np.uint16)


def _as_json(camera: Camera) -> dict[str, Any]:
    return {name: value.tolist() if hasattr(value, "tolist") else value for name, value in camera._asdict().items()}


def film_pictures(
    pictures: Iterator[tuple[PlannedView, RenderOut]], look: Look, sequence: ReadFrames | None = None
) -> Iterator[ByteImage]:
    """The panels of every view, with the same colour scale for all.

    sequence   the recorded frames; required for the panels truth and error
    """
    scale = None
    for view, out in pictures:
        scale = scale or scale_of(out.depth)
        frame = None if sequence is None else sequence.frame(view.frame)
        yield side_by_side(look.panels, out, scale, frame)
