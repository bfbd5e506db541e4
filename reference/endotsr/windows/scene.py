"""One scene to the outside: a run of windows that renders at any time, blended where two windows overlap.

In: a run folder with windows.json and trained windows. Out: a `MovingScene` of the whole recording. Frame g of G has
the time g / G, and its camera is that of the window with the larger weight.

Where window k + 1 begins with frame b and window k ends before frame e, the weight of window k + 1 at frame g is

    w(g) = (g - b) / (e - b),    b <= g <= e,

and that of window k is 1 - w. Colour, depth and opacity are blended with these weights. At most two models are held in
memory.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.export.scene import MovingScene, open_scene
from endotsr.kernels.arrays import FloatArray
from endotsr.runs.folder import RunFolder, open_run
from endotsr.runs.model import Model
from endotsr.runs.sources import load_run_sequence
from endotsr.sequences.record import SequenceRecord
from endotsr.sequences.sequence import Frame, Sequence
from endotsr.splatting.camera import Camera
from endotsr.splatting.render import RenderOut
from endotsr.splatting.render import Scene as DeformedScene
from endotsr.views.panels import NEEDS_TRUTH, Panel
from endotsr.views.pictures import check_panels, frames_of
from endotsr.views.plan import PlannedView
from endotsr.windows.make import window_folder
from endotsr.windows.record import FOLDER, WindowsRecord, is_windowed, read_record

EMPTY = WindowsRecord(source="", frames=1, overlap=0, chain=1, windows=[])
KEPT = 2  # windows whose models are held in memory


class WindowPart(NamedTuple):
    """A window that shows a time."""

    window: int
    time: float  # of the window, in [0, 1]
    weight: float  # in [0, 1]; those of a time sum to 1


@dataclass(frozen=True)
class WindowedScene(MovingScene):
    """A scene made of windows; `record` lists the frames that windows cover."""

    run: Path = Path()
    plan: WindowsRecord = EMPTY

    @property
    def model(self) -> Model:
        """The model of the first window: for what all windows have in common."""
        return self.window(0).model

    @cached_property
    def window(self) -> Any:
        """Window number -> its `MovingScene`; the last ones are kept."""
        return lru_cache(KEPT)(lambda k: open_scene(window_folder(self.run, self.plan.windows[k])))

    @cached_property
    def frames(self) -> list[int]:
        """The frames of the recording that windows cover, ascending: those that `record` lists."""
        return covered(self.plan)

    @cached_property
    def cameras(self) -> list[Camera]:
        """The cameras of the covered frames, each with the corrections of the window that has the larger weight."""
        found: dict[int, list[Camera]] = {}
        chosen = []
        for g in self.frames:
            k = self.owner(g)
            if k not in found:
                found = {k: self.window(k).cameras}
            chosen.append(found[k][g - self.plan.windows[k].first])
        return chosen

    def parts(self, g: float) -> list[WindowPart]:
        """The windows that show the frame g, which may lie between two frames. Raises InputError where none does.

        A window shows the times from its first frame to the frame behind its last.
        """
        found = []
        for k, window in enumerate(self.plan.windows):
            if window.first <= g < window.end or (g == window.end and not self._shown_later(k, g)):
                found.append(WindowPart(k, self.local_time(k, g), 1.0))
        if not found:
            gap = next((gap for gap in self.plan.left_out if gap.first <= g < gap.end), None)
            why = f": frames {gap.first}:{gap.end} are left out: {gap.reason}" if gap else ""
            raise InputError(f"{self.run}: no window shows time {g / self.plan.frames:g}{why}")
        if len(found) == 1:
            return found
        before, after = found
        begin, end = self.plan.windows[after.window].first, self.plan.windows[before.window].end
        weight = (g - begin) / (end - begin)  # (21.1)
        return [before._replace(weight=1.0 - weight), after._replace(weight=weight)]

    def owner(self, g: float) -> int:
        """The window with the larger weight; the earlier one of equal weights."""
        return max(self.parts(g), key=lambda part: (part.weight, -part.window)).window

    def _shown_later(self, k: int, g: float) -> bool:
        return k + 1 < len(self.plan.windows) and self.plan.windows[k + 1].first <= g

    def local_time(self, k: int, g: float) -> float:
        """The time of window k at frame g: linear between the times of its frames, 1 at the frame behind the last."""
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
        """As `MovingScene.render`, blended over an overlap."""
        parts = [part for part in self.parts(time * self.plan.frames) if part.weight > 0]
        renders = [self.window(part.window).render(part.time, camera, taken_out) for part in parts]
        return blended(renders, [part.weight for part in parts])

    def at(self, time: float, taken_out: tuple[str, ...] = ()) -> DeformedScene:
        """The deformed Gaussians at a time, of the window with the larger weight: two sets would occlude each other."""
        part = max(self.parts(time * self.plan.frames), key=lambda part: (part.weight, -part.window))
        return self.window(part.window).at(part.time, taken_out)


def blended(renders: list[RenderOut], weights: list[float]) -> RenderOut:
    """The weighted sum of renders of one view: colour, depth and opacity. One render is returned as it is."""
    if len(renders) == 1:
        return renders[0]

    def summed(name: str) -> FloatArray:
        total: FloatArray = np.zeros_like(getattr(renders[0], name))
        for render, weight in zip(renders, weights):
            total += total.dtype.type(weight) * getattr(render, name)
        return total

    return renders[0]._replace(**{name: summed(name) for name in ("colour", "depth", "opacity")})


def covered(plan: WindowsRecord) -> list[int]:
    """The frames that windows cover, ascending."""
    return sorted({g for window in plan.windows for g in range(window.first, window.end)})


def open_any(path: Path) -> MovingScene:
    """A scene to render: a run of windows, or what `open_scene` takes. Raises InputError."""
    return open_windows(Path(path)) if is_windowed(path) else open_scene(path)


def refuse_one_set(path: Path, out: Path) -> None:
    """Raises InputError for a file that holds one set of Gaussians, of a run of windows, which has many."""
    if is_windowed(path) and out.suffix.lower() in (".npz", ".glb"):
        raise InputError(
            f"{out}: holds one set of Gaussians, and {path} has one in each window; allowed: .ply files, a page, or the"
            f" run of a window, {path / FOLDER / '000'}"
        )


def open_windows(run: Path) -> WindowedScene:
    """The scene of a run of windows. Raises InputError if a window has no usable record, or none is trained yet."""
    plan = read_record(run)
    folders = [open_run(window_folder(run, window)) for window in plan.windows]
    for folder in folders:
        if not folder.has_checkpoint:
            raise InputError(f"{folder.path}: not trained yet; continue with `endotsr train --out {run} --resume`")
    return WindowedScene(_record(plan, [folder.sequence_record() for folder in folders]), run=Path(run), plan=plan)


def _record(plan: WindowsRecord, records: list[SequenceRecord]) -> SequenceRecord:
    """The record of the sequence as one window of the covered frames would have it.

    A frame is held out if every window that has it holds it out. `cameras` are those of the first window where the
    camera rests; a moving one has them in `WindowedScene.cameras`.
    """
    names: dict[int, str] = {}
    trained: set[int] = set()
    for window, record in zip(plan.windows, records):
        names |= {window.first + i: name for i, name in enumerate(record.names)}
        trained |= {window.first + i for i in record.train_index}
    frames = sorted(names)
    return SequenceRecord(
        unit=records[0].unit,
        largest_depth=max(record.largest_depth for record in records),
        static_camera=all(record.static_camera for record in records),
        names=[names[g] for g in frames],
        times=[g / plan.frames for g in frames],
        train_index=[j for j, g in enumerate(frames) if g in trained],
        test_index=[j for j, g in enumerate(frames) if g not in trained],
        cameras=records[0].cameras,
        duration=sum(record.duration for record in records) * plan.frames / sum(record.count for record in records),
    )


def shown_frames(
    scene: MovingScene, panels: tuple[Panel, ...], views: list[PlannedView], source: str | None
) -> "Sequence | WindowFrames | None":
    """The frames that truth and error of a film are shown from, as `views.pictures.frames_of`."""
    if not isinstance(scene, WindowedScene):
        return frames_of(scene, panels, views, source)
    check_panels(panels, views)
    return WindowFrames(scene, source) if set(panels) & set(NEEDS_TRUTH) else None


class WindowFrames:
    """The frames of a recording, read window by window as they are asked for in ascending order.

    Raises: InputError if the sequence of a window cannot be found or is not the one that it was trained on.
    """

    def __init__(self, scene: WindowedScene, source: str | None = None) -> None:
        self._scene = scene
        self._sequence = lru_cache(1)(lambda k: load_run_sequence(scene.folders[k], source))

    def of_window(self, k: int) -> Sequence:
        """The sequence of window k."""
        return self._sequence(k)

    def frame(self, index: int) -> Frame:
        """Frame `index` of those that `record` of the scene lists, with its time in the recording."""
        g = self._scene.frames[index]
        k = self._scene.owner(g)
        found = self.of_window(k).frame(g - self._scene.plan.windows[k].first)
        return found._replace(time=g / self._scene.plan.frames)
