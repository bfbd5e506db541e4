"""A run of windows as one scene that renders at any time, blended where two windows overlap.

In: a run folder with windows.json and trained windows. Out: a `MovingScene` of the whole recording. Frame g of G has
time g / G and the camera of the window with the larger weight.

If window k + 1 begins at frame b and window k ends before frame e, window k + 1 has the weight

    w(g) = (g - b) / (e - b),    b <= g <= e,

at frame g, and window k has 1 - w. Colour, depth and opacity are blended with these weights. At most two models are in
memory.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from endotsr.clips.sequences.record import SequenceRecord
from endotsr.clips.sequences.sequence import Frame, Sequence
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.method.splatting.render import Scene as DeformedScene
from endotsr.results.export.scene import MovingScene, open_scene
from endotsr.results.views.panels import NEEDS_TRUTH, Panel
from endotsr.results.views.pictures import check_panels, frames_shown
from endotsr.results.views.plan import PlannedView
from endotsr.studies.windows.make import window_folder
from endotsr.studies.windows.record import FOLDER, WindowsRecord, is_windowed, read_record
from endotsr.training.runs.folder import RunFolder, open_run, resume_command
from endotsr.training.runs.model import Model
from endotsr.training.runs.sources import load_run_sequence

EMPTY = WindowsRecord(source="", frames=1, overlap=0, chain=1, windows=[])
KEPT = 2  # windows with a model in memory


class WindowPart(NamedTuple):
    """The contribution of a window at a time."""

    window: int
    time: float  # of the window, in [0, 1]
    weight: float  # in [0, 1]; the weights at a time sum to 1


@dataclass(frozen=True)
class WindowedScene(MovingScene):
    """A scene made of windows; `record` lists the covered frames."""

    run: Path = Path()
    plan: WindowsRecord = EMPTY

    @property
    def model(self) -> Model:
        """The model of the first window, for properties common to all windows."""
        return self.window(0).model

    @cached_property
    def window(self) -> Any:
        """Function window number -> `MovingScene`; caches the last ones."""
        return lru_cache(KEPT)(lambda k: open_scene(window_folder(self.run, self.plan.windows[k])))

    @cached_property
    def frames(self) -> list[int]:
        """The covered frames of the recording, ascending, as listed by `record`."""
        return sorted({g for window in self.plan.windows for g in range(window.first, window.end)})

    @cached_property
    def cameras(self) -> list[Camera]:
        """The cameras of the covered frames, each with the pose correction of the window with the larger weight."""
        found: dict[int, list[Camera]] = {}
        chosen = []
        for g in self.frames:
            k = self.owner(g)
            if k not in found:
                found = {k: self.window(k).cameras}
            chosen.append(found[k][g - self.plan.windows[k].first])
        return chosen

    def frame_at(self, time: float) -> float:
        """The frame at a time of the recording; exactly g at the time g / G of a frame.

        The product of g / G and G may be less than g by rounding, which is the window before a cut.
        """
        g = time * self.plan.frames
        return round(g) if round(g) / self.plan.frames == time else g

    def parts(self, g: float) -> list[WindowPart]:
        """The windows at frame g, not necessarily an integer. Raises InputError if there is none.

        A window covers the times from its first frame to its exclusive end.
        """
        found = []
        for k, window in enumerate(self.plan.windows):
            if window.first <= g < window.end or (g == window.end and not self._shown_later(k, g)):
                found.append(WindowPart(k, self.local_time(k, g), 1.0))
        if not found:
            gap = next((gap for gap in self.plan.left_out if gap.first <= g < gap.end), None)
            why = f": frames {gap.first}:{gap.end} are left out: {gap.reason}" if gap else ""
            raise InputError(f"{self.run}: no window covers time {g / self.plan.frames:g}{why}")
        if len(found) == 1:
            return found
        before, after = found
        begin, end = self.plan.windows[after.window].first, self.plan.windows[before.window].end
        weight = (g - begin) / (end - begin)  # (21.1)
        return [before._replace(weight=1.0 - weight), after._replace(weight=weight)]

    def owner(self, g: float) -> int:
        """The window with the larger weight; of equal weights, the earlier window."""
        return max(self.parts(g), key=lambda part: (part.weight, -part.window)).window

    def _shown_later(self, k: int, g: float) -> bool:
        return k + 1 < len(self.plan.windows) and self.plan.windows[k + 1].first <= g

    def local_time(self, k: int, g: float) -> float:
        """The time of window k at frame g: linear between the times of its frames, 1 at its exclusive end."""
        window, times = self.plan.windows[k], self._times[k]
        return float(np.interp(g - window.first, np.arange(window.count + 1), [*times, 1.0]))

    @cached_property
    def _times(self) -> list[list[float]]:
        return [folder.sequence_record().times for folder in self.folders]

    @cached_property
    def folders(self) -> list[RunFolder]:
        """The run folders of the windows."""
        return [open_run(window_folder(self.run, window)) for window in self.plan.windows]

    def render(self, time: float, camera: Camera, taken_out: tuple[str, ...] = ()) -> RenderOut:
        """As `MovingScene.render`, blended in an overlap."""
        parts = [part for part in self.parts(self.frame_at(time)) if part.weight > 0]
        renders = [self.window(part.window).render(part.time, camera, taken_out) for part in parts]
        return blended(renders, [part.weight for part in parts])

    def at(self, time: float, taken_out: tuple[str, ...] = ()) -> DeformedScene:
        """The deformed Gaussians of the window with the larger weight: two sets would occlude each other."""
        g = self.frame_at(time)
        k = self.owner(g)
        return self.window(k).at(self.local_time(k, g), taken_out)


def blended(renders: list[RenderOut], weights: list[float]) -> RenderOut:
    """The weighted sum of colour, depth and opacity of renders of one view. A single render is returned unchanged."""
    if len(renders) == 1:
        return renders[0]

    def summed(name: str) -> FloatArray:
        total: FloatArray = np.zeros_like(getattr(renders[0], name))
        for render, weight in zip(renders, weights):
            total += total.dtype.type(weight) * getattr(render, name)
        return total

    return renders[0]._replace(**{name: summed(name) for name in ("colour", "depth", "opacity")})


def open_any(path: Path) -> MovingScene:
    """A scene to render: a run of windows, or any input of `open_scene`. Raises InputError."""
    return open_windows(Path(path)) if is_windowed(path) else open_scene(path)


def refuse_one_set(path: Path, out: Path) -> None:
    """Raises InputError if a run of windows is to be exported to a format for one set of Gaussians."""
    if is_windowed(path) and out.suffix.lower() in (".npz", ".glb"):
        raise InputError(
            f"{out}: this format stores one set of Gaussians, but {path} has one per window; use .ply files, a"
            f" page, or the run of a window, {path / FOLDER / '000'}"
        )


def open_windows(run: Path) -> WindowedScene:
    """The scene of a run of windows. Raises InputError if a window has no usable record or no checkpoint."""
    plan = read_record(run)
    folders = [RunFolder(window_folder(run, window)) for window in plan.windows]
    for folder in folders:
        if not folder.has_checkpoint:  # its folder may not exist either
            raise InputError(f"{folder.path}: not trained yet; continue with `{resume_command(run)}`")
        open_run(folder.path)
    return WindowedScene(_record(plan, [folder.sequence_record() for folder in folders]), run=Path(run), plan=plan)


def _record(plan: WindowsRecord, records: list[SequenceRecord]) -> SequenceRecord:
    """The record of the covered frames as one sequence. What is not of single frames is taken from the first.

    A frame is held out if a window holds it out and none trains on it. A copy of a held-out frame is neither.
    `cameras` are the first window's, valid for a static camera; for a moving one see `WindowedScene.cameras`.
    """
    names: dict[int, str] = {}
    trained: set[int] = set()
    held_out: set[int] = set()
    for window, record in zip(plan.windows, records):
        names |= {window.first + i: name for i, name in enumerate(record.names)}
        trained |= {window.first + i for i in record.train_index}
        held_out |= {window.first + i for i in record.test_index}
    frames = sorted(names)
    return msgspec.structs.replace(
        records[0],
        largest_depth=max(record.largest_depth for record in records),
        static_camera=all(record.static_camera and record.cameras == records[0].cameras for record in records),
        names=[names[g] for g in frames],
        times=[g / plan.frames for g in frames],
        train_index=[j for j, g in enumerate(frames) if g in trained],
        test_index=[j for j, g in enumerate(frames) if g in held_out - trained],
        duration=sum(record.duration for record in records) * plan.frames / sum(record.count for record in records),
    )


def shown_frames(
    scene: MovingScene, panels: tuple[Panel, ...], views: list[PlannedView], source: str | None
) -> "Sequence | WindowFrames | None":
    """The recorded frames for the panels truth and error of a film, as `views.pictures.frames_shown`."""
    if not isinstance(scene, WindowedScene):
        return frames_shown(scene, panels, views, source)
    check_panels(panels, views)
    return WindowFrames(scene, source) if set(panels) & set(NEEDS_TRUTH) else None


class WindowFrames:
    """The frames of a recording. One window is in memory at a time: ask for frames in ascending order.

    Raises: InputError if the sequence of a window is missing or differs from its training sequence.
    """

    def __init__(self, scene: WindowedScene, source: str | None = None) -> None:
        self._scene = scene
        self._sequence = lru_cache(1)(lambda k: load_run_sequence(scene.folders[k], source))

    def of_window(self, k: int) -> Sequence:
        """The sequence of window k."""
        return self._sequence(k)

    def frame(self, index: int) -> Frame:
        """Frame `index` of the scene's `record`, with its time in the recording."""
        g = self._scene.frames[index]
        k = self._scene.owner(g)
        found = self.of_window(k).frame(g - self._scene.plan.windows[k].first)
        return found._replace(time=g / self._scene.plan.frames)
