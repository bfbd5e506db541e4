"""The progress page of a training: iterations, time left, curves, and a render of one frame.

`training.html` is rewritten in the run folder during training, and the browser reloads it: no server and no script. The
page renders one frame with the current parameters, without changing them. After a page, the next follows with the first
iteration that ends after FEWEST_SECONDS, or later if pages would otherwise take more than LARGEST_FRACTION of the time,
but at most MOST_SECONDS later. A page that cannot be written does not stop the training. After
the evaluation the page redirects to the report.
"""

import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.results.report import parts
from endotsr.results.report.figures import bytes_image
from endotsr.results.report.line_chart import ChartCurve, chart_svg
from endotsr.training.fitting.model import camera_at, render_at, spectral_from
from endotsr.training.fitting.records import LogEntry
from endotsr.training.runs.folder import RunFolder, resume_command
from endotsr.training.runs.log import log_until
from endotsr.training.runs.machine import now
from endotsr.untrusted.writing import replace_text

if TYPE_CHECKING:
    from endotsr.training.fitting.state import TrainingState

LIVE_PAGE, REPORT = "training.html", "report.html"  # in a run folder
FEWEST_SECONDS, MOST_SECONDS = 5.0, 60.0  # between two pages
LARGEST_FRACTION = 0.01  # fraction of the time that pages may take
KEPT = ("iteration", "loss", "psnr")  # keys of the log shown on the page


class LivePage:
    """Writes `training.html` of a run folder during training."""

    def __init__(self, folder: RunFolder, sequence: Sequence, config: Config) -> None:
        frames = sequence.test_index if len(sequence.test_index) else sequence.train_index
        self._folder, self._sequence, self._config = folder, sequence, config
        self._frame = int(frames[len(frames) // 2])
        self._kind = "held-out" if len(sequence.test_index) else "training"
        self._spectral = spectral_from(config.model, sequence.times[sequence.train_index])
        self._log: list[LogEntry] = []
        self._psnr = ChartCurve(f"{self._kind} frame {self._frame}", [], [])
        self._due = 0.0

    def begin(self, state: "TrainingState") -> None:
        """The training begins; it updates `state` in place. Writes a page without a render: kernels compile now."""
        self._state = state
        self._log = [_kept(entry) for entry in log_until(self._folder.log, state.iteration)]
        self._write("running", None, picture=False)
        self._due = 0.0

    def update(self, entry: LogEntry, left: Callable[[], str | None]) -> None:
        """An iteration has ended. entry: its line of the log; left: returns the time left, None if unknown."""
        self._log.append(_kept(entry))
        if time.monotonic() >= self._due:
            self._write("running", left())

    def close(self) -> None:
        """The training has ended; write the page with the status of run.json.

        Without a render if it was stopped before the first one, which would compile the kernels.
        """
        with contextlib.suppress(OSError, InputError):
            status = str(self._folder.record().get("status"))
            self._write(status, None, picture=bool(self._psnr.x) or status == "finished")

    def _write(self, status: str, left: str | None, picture: bool = True) -> None:
        began = time.monotonic()
        with contextlib.suppress(OSError):  # the training itself reports a full disk
            replace_text(self._folder.path / LIVE_PAGE, self._html(status, left, picture))
        done = time.monotonic()
        self._due = done + min(max(FEWEST_SECONDS, (done - began) / LARGEST_FRACTION), MOST_SECONDS)

    def _html(self, status: str, left: str | None, picture: bool) -> str:
        done, planned = self._state.iteration, self._config.training.iterations
        name, shown = self._folder.path.absolute().name, ""
        if picture:
            with contextlib.suppress(ValueError):  # the training itself reports numbers that are not finite
                shown = self._picture()
        loss = self._log[-1].get("loss") if self._log else None
        psnr = self._psnr.y[-1] if self._psnr.y else None
        running = status == "running"
        boxes = (
            parts.card(parts.cell(done), "", f"of {planned} iterations"),
            parts.card(parts.cell(left if running else status), "", "time left" if running else "status"),
            parts.card(parts.number(loss, 4), "", "loss of the last view"),
            parts.card(parts.number(psnr, 2), "dB", f"PSNR of {self._kind} frame {self._frame}, tissue"),
            parts.card(parts.cell(self._state.gaussians.count), "", "Gaussians"),
        )
        body = (
            f'<header><p class="eyebrow">Endo-TSR · training</p><h1>{parts.text(name)}</h1>'
            f'<div class="cards">{"".join(boxes)}</div></header>{shown}{self._curves(planned)}'
            f"<footer>Updated at {now()}. {_advice(status, self._folder.path)}</footer>"
        )
        again = f"{FEWEST_SECONDS:.0f}" if status in ("running", "finished") else ""
        return parts.page(f"{done} of {planned}: {name}", body, again)

    def _picture(self) -> str:
        """The current render of the frame, and the truth; appends its PSNR to the curve."""
        state, index, time_ = self._state, self._frame, float(self._sequence.times[self._frame])
        camera = camera_at(state.frames, self._sequence.cameras[index], time_)
        out = render_at(state.gaussians, self._spectral, self._config, camera, time_, frames=state.frames)
        truth, mask = self._sequence.frame(index).image, self._sequence.masks[index]
        self._psnr.x.append(float(state.iteration))
        self._psnr.y.append(psnr_tissue(np.clip(out.colour, 0, 1), truth, mask))  # as in the log and the report
        shown = "".join(
            parts.figure(label, parts.image(bytes_image(colour), label))
            for label, colour in (("Render", out.colour), ("Truth", truth))
        )
        title = f"{self._kind.capitalize()} frame {index} after iteration {state.iteration}"
        return parts.section(title, f'<div class="charts">{shown}</div>')

    def _curves(self, planned: int) -> str:
        """Loss and PSNR (training views and the frame) over the iterations."""
        loss, views = (
            ChartCurve(label, [e["iteration"] for e in self._log if e.get(key) is not None],
                  [float(v) for e in self._log if (v := e.get(key)) is not None])
            for key, label in (("loss", "loss"), ("psnr", "training views"))
        )  # fmt: skip
        charts = (
            ("Loss", chart_svg("Loss", [loss], planned, logarithmic=True)),
            ("PSNR, dB", chart_svg("PSNR, dB", [views, self._psnr], planned)),
        )
        figures = "".join(parts.figure(title, svg) for title, svg in charts if svg)
        return parts.section("Curves", f'<div class="charts">{figures}</div>') if figures else ""


def lead_to_report(folder: Path) -> None:
    """Redirect an existing progress page to the report."""
    if (folder / LIVE_PAGE).is_file():
        page = parts.page("Endo-TSR", f'<p><a href="{REPORT}">The report</a></p>', f"0; url={REPORT}")
        replace_text(folder / LIVE_PAGE, page)


def _kept(entry: LogEntry) -> LogEntry:
    """The entry with the keys shown on the page."""
    return cast(LogEntry, {key: entry.get(key) for key in KEPT if key in entry})


def _advice(status: str, folder: Path) -> str:
    """The next step for the reader of the page."""
    if status == "running":
        return "This page updates itself during training."
    if status == "finished":
        return "After the evaluation, this page redirects to the report."
    return f"Continue with <code>{parts.text(resume_command(folder))}</code>."
