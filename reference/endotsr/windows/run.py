"""A run of windows from Python: what `endotsr.open_run` returns for one."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from endotsr.kernels.arrays import FloatArray
from endotsr.runs.folder import RunFolder
from endotsr.sequences.record import SequenceRecord
from endotsr.splatting.camera import Camera
from endotsr.splatting.render import RenderOut
from endotsr.windows.scene import WindowedScene, WindowFrames, open_windows


@dataclass(eq=False, repr=False)
class WindowedRun:
    """A recording that was trained in windows. It renders and is measured as one run."""

    path: Path
    _source: str | None = None  # where the sequence is; None = where the records say

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
        """Times, names, split and unit of the frames that windows cover."""
        return self.scene.record

    def render(self, time: float, camera: Camera | int | None = None, *, without: tuple[str, ...] = ()) -> RenderOut:
        """Colour (3, H, W) in display units, depth (H, W) in scene units and opacity (H, W), as `Run.render`.

        time      of the recording, in [0, 1]; frame g of G is at g / G
        camera    a Camera, or the place of a frame in `sequence_record`; default: that of the frame nearest in time
        without   spectral components to leave out: "appearance", "spectral_motion"

        In an overlap the renders of both windows are blended, with weights linear in time.
        Raises: InputError for a time that no window shows, and for a frame or component that does not exist.
        """
        return self.scene.picture(time, camera, without)

    def follow(self, points: FloatArray, frame: int, frames: Sequence[int]) -> FloatArray:
        """Positions (F, 3, P) of points (3, P) that are tissue at one frame, at other frames; scene units, world axes.

        frame, frames   of the recording, counted from 0

        A point moves with the Gaussians around it, and passes to those of the next window in the middle of an overlap
        (B18d). Behind a cut its position is NaN. Raises: InputError for a frame that no window shows.
        """
        from endotsr.windows.follow import followed

        return followed(self.scene, points, frame, frames)

    def view(self, path: str | Path, *, held_out: bool = False) -> Path:
        """Write the page that plays the recording, and the folder of its windows beside it; returns the page.

        held_out  also show the held-out frames, for which the sequence is read

        Raises: InputError for a name that is not that of a page, and for a folder of windows that holds other files.
        """
        from endotsr.views.page import check_page
        from endotsr.windows.page import WINDOW_KEYS, write_windows_page

        path = Path(path)
        check_page(path, WINDOW_KEYS)
        frames = WindowFrames(self.scene, self._source) if held_out else None
        write_windows_page(path, self.scene, path.stem, WINDOW_KEYS, frames)
        return path

    def evaluate(self, *, lpips: str | Path | None = None) -> dict[str, Any]:
        """Metrics of the held-out frames of all windows, what each window cost, and the flicker at seams.

        lpips     AlexNet LPIPS weights (.npz); without them the LPIPS values are None
        returns   the keys of `windows.measure.measure_windows`

        Raises: InputError if the sequence or the weights cannot be used.
        """
        from endotsr.evaluation.lpips import load_lpips_weights
        from endotsr.windows.measure import measure_windows

        return measure_windows(self.scene, WindowFrames(self.scene, self._source), load_lpips_weights(lpips))
