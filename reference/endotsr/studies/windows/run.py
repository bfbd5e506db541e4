"""The Python interface of a run of windows; `endotsr.open_run` returns it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from endotsr.clips.sequences.record import SequenceRecord
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.studies.windows.scene import WindowedScene, WindowFrames, open_windows
from endotsr.training.runs.files import refuse_replacing
from endotsr.training.runs.folder import RunFolder

if TYPE_CHECKING:
    from endotsr.studies.windows.evaluation import WindowedEvaluation


@dataclass(eq=False, repr=False)
class WindowedRun:
    """A recording trained in windows, rendered and evaluated as one run."""

    path: Path
    _source: str | None = None  # folder of the sequence; None = as recorded

    def __repr__(self) -> str:
        return f"WindowedRun({len(self.scene.plan.windows)} windows, {len(self.scene.frames)} frames)"

    @cached_property
    def scene(self) -> WindowedScene:
        """The scene. Raises InputError if a window is not trained."""
        return open_windows(self.path)

    @property
    def windows(self) -> list[RunFolder]:
        """The run folders of the windows; `endotsr.open_run(folder.path)` opens one of them."""
        return self.scene.folders

    @property
    def sequence_record(self) -> SequenceRecord:
        """Times, names, split and unit of the covered frames."""
        return self.scene.record

    def render(self, time: float, camera: Camera | int | None = None, *, without: tuple[str, ...] = ()) -> RenderOut:
        """Colour (3, H, W) in display units, depth (H, W) in scene units and opacity (H, W), as `Run.render`.

        time      of the recording, in [0, 1]; frame g of G is at g / G
        camera    a Camera, or the index of a frame in `sequence_record`; default: the camera of the nearest frame
        without   spectral components to leave out: "appearance", "spectral_motion"

        In an overlap the renders of both windows are blended with weights linear in time.
        Raises: InputError for a time outside every window, and for a frame or component that does not exist.
        """
        return self.scene.picture(time, camera, without)

    def follow(self, points: FloatArray, frame: int, frames: Sequence[int]) -> FloatArray:
        """Positions (F, 3, P) at `frames` of tissue points (3, P) given at `frame`; scene units, world axes.

        frame, frames   of the recording, counted from 0

        A point moves with the nearest Gaussians; in the middle of an overlap the next window takes over (B18d). Its
        position is NaN beyond a cut. Raises: InputError for a frame outside every window.
        """
        from endotsr.studies.windows.follow import followed

        return followed(self.scene, points, frame, frames)

    def view(self, path: str | Path, *, held_out: bool = False, replace: bool = False) -> Path:
        """Write the viewer page and, in the same folder, the folder of its windows; returns the page.

        held_out  also show the held-out frames; this reads the sequence
        replace   replace an existing page that endotsr did not write

        Raises: InputError if `path` is no .html name, for such a page, and if the folder of windows contains other
                files.
        """
        from endotsr.results.views.page import check_page
        from endotsr.studies.windows.page import WINDOW_KEYS, write_windows_page

        path = Path(path)
        check_page(path, WINDOW_KEYS)
        refuse_replacing(path, replace)
        frames = WindowFrames(self.scene, self._source) if held_out else None
        write_windows_page(path, self.scene, path.stem, WINDOW_KEYS, frames)
        return path

    def evaluate(self, *, lpips: str | Path | None = None) -> "WindowedEvaluation":
        """Held-out metrics of all windows, the cost of each window, and the flicker at seams.

        lpips     AlexNet LPIPS weights (.npz); without them LPIPS is None
        returns   the keys of `windows.measure.measure_windows`

        Raises: InputError if the sequence or the weights cannot be used.
        """
        from endotsr.results.evaluation.lpips import load_lpips_weights
        from endotsr.studies.windows.measure import measure_windows

        return measure_windows(self.scene, WindowFrames(self.scene, self._source), load_lpips_weights(lpips))
