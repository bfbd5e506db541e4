"""What trainings said about their time, what they took, and their held-out quality against seconds.

    python docs/make.py bench.waiting measure CLIP ... --preset quick --lpips FILE

`endotsr train` runs on each clip in this process, with its evaluation. The first clip is forecast at the assumed speed
of a machine, the next ones at the speed of the training before. Without --wall every time is processor time of one
thread, which other work on the machine changes less than the time on the wall. The environment has to contain
OPENBLAS_NUM_THREADS=1, as in the process of a command. The renders for the curve are no part of any time. With an empty
folder as NUMBA_CACHE_DIR the first training is a cold one.
"""

import argparse
import contextlib
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

from endotsr.cli.main import BLAS
from endotsr.cli.parts import progress, waiting
from endotsr.clips.sequences.forecast.seconds import COMPILATION, TimedCommand, estimated_seconds
from endotsr.clips.sequences.forecast.work import Standing
from endotsr.errors import InputError
from endotsr.method.kernels.kernel_cache import kernel_folder
from endotsr.method.kernels.vectors import REGISTER
from endotsr.results.evaluation.metrics import psnr
from endotsr.results.report import live_page
from endotsr.results.report.live_page import LivePage
from endotsr.training.fitting import bridged
from endotsr.training.fitting.model import camera_at, render_at
from endotsr.training.runs import speed
from endotsr.training.runs import training as runs_training
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine, now
from pages.bench.waiting_text import draw, quality, said
from pages.store import commands
from pages.store.kept import with_row
from pages.store.program import CLIPS, LPIPS, Program

MARKS = 10  # renders of every held-out frame, evenly over the iterations
POINTS = 100  # of the stored course of the time left, evenly over the iterations
MINUTE = 60.0
KEYS = ("psnr_full", "psnr_tissue", "lpips")
# A row replaces the row with these values.
SAME = ("clip", "preset", "iterations", "seed", "clock", "cold", "register_bytes", "processor")


class Watch:
    """Time since its creation without what was excluded, seconds."""

    def __init__(self, wall: bool) -> None:
        self._clock = time.perf_counter if wall else time.process_time
        self._began, self._excluded = self._clock(), 0.0

    def now(self) -> float:
        """Seconds."""
        return self._clock() - self._began - self._excluded

    @contextlib.contextmanager
    def excluded(self) -> Iterator[None]:
        """What happens inside takes no time."""
        began = self._clock()
        yield
        self._excluded += self._clock() - began


class Heard:
    """What one command says, with the times at which it does."""

    def __init__(self, watch: Watch) -> None:
        self.watch, self.said, self.curve, self.course = watch, {}, [], []
        self.trained, self.largest_rise, self._least = 0.0, 0.0, float("inf")
        self._about: LivePage | None = None

    def first_line(
        self, plan: TimedCommand, known: speed.KnownSpeed, compiled: bool, at: Standing | None = None
    ) -> str:
        """In place of `waiting_line`."""
        found = estimated_seconds(plan, known.unit, at)
        left = sum(found) - found.reading + (0.0 if compiled else COMPILATION)
        self.said["start"] = {
            "at": self.watch.now(), "left": left, "evaluation": found.evaluation, "initial": found.start,
            "speed": SOURCES[known.source], "compiled": compiled,
        }  # fmt: skip
        return LINE(plan, known, compiled, at)

    def update(self, shown: progress.Progress, entry: Any) -> None:
        """In place of `Progress.update`."""
        UPDATE(shown, entry)
        with self.watch.excluded():
            state, plan = shown._training, shown._plan
            assert state is not None
            at, now = shown.standing(entry), self.watch.now()
            self.trained = now
            left, unit = shown.time_left.seconds(at), shown.time_left.unit
            if left is not None and unit is not None and shown._done >= progress.FORECAST_AFTER:
                if entry["iteration"] * POINTS // plan.config.training.iterations > len(self.course):
                    self.course.append({"iteration": at.iteration, "at": now, "left": left, "unit": unit})
                self._hear(now, left, estimated_seconds(plan, unit).evaluation)
            if entry["iteration"] * MARKS // plan.config.training.iterations > len(self.curve):
                self.curve.append(self._point(shown, now, at))

    def _hear(self, now: float, left: float, evaluation: float) -> None:
        self._least = min(self._least, left)
        self.largest_rise = max(self.largest_rise, left / self._least - 1.0 if left > 5.0 else 0.0)
        told = {"at": now, "left": left + evaluation, "evaluation": evaluation}
        self.said.setdefault("forecast", told)
        if now >= MINUTE:
            self.said.setdefault("minute", told)

    def _point(self, shown: progress.Progress, now: float, at: Standing) -> dict[str, float]:
        """Mean held-out PSNR of the current parameters."""
        page, state = shown._page, shown._training
        assert page is not None and state is not None
        sequence, config, found = page._sequence, page._config, []
        for index in map(int, sequence.test_index):
            moment = float(sequence.times[index])
            camera = camera_at(state.frames, sequence.cameras[index], moment)
            out = render_at(state.gaussians, page._spectral, config, camera, moment, frames=state.frames)
            found.append(psnr(out.colour, sequence.frame(index).image, sequence.masks[index]))
        return {
            "seconds": now, "iteration": at.iteration, "gaussians": at.gaussians, "psnr_full": sum(found) / len(found)
        }  # fmt: skip


SOURCES = {speed.TRAINED: "measured", speed.TIMED: "timed", speed.ASSUMED: "assumed"}
LINE, UPDATE = waiting.waiting_line, progress.Progress.update


def heard(clip: Path, words: list[str], wall: bool, kept_speed: Path) -> dict[str, Any]:
    """One command. kept_speed: the file in which trainings keep the speed of the machine."""
    watch = Watch(wall)
    spoken, cold = Heard(watch), not any(kernel_folder().glob("compiled-*"))
    clock = SimpleNamespace(monotonic=watch.now, perf_counter=watch.now, thread_time=time.thread_time)
    with tempfile.TemporaryDirectory() as root, contextlib.ExitStack() as stack:
        for module in (progress, bridged, runs_training, live_page):
            stack.enter_context(mock.patch.object(module, "time", clock))
        stack.enter_context(mock.patch.object(waiting, "waiting_line", spoken.first_line))
        stack.enter_context(mock.patch.object(progress.Progress, "update", lambda *given: spoken.update(*given)))
        stack.enter_context(mock.patch.object(speed, "speed_file", lambda threads: kept_speed))
        run = Path(root) / "run"
        threads = [] if wall else ["--threads", "1"]
        commands.said("train", clip, "--out", run, *words, *threads)
        whole, metrics = watch.now(), commands.loaded(run / "metrics.json")
    about, here = metrics["run"], machine()
    return {
        "clip": clip.resolve().name, "frames": about["input"]["frames"],
        "size": f"{about['input']['width']}x{about['input']['height']}", "preset": about["settings"]["preset"],
        "seed": about["seed"], "threads": about["threads"], "clock": "wall" if wall else "processor",
        "cold": cold, "register_bytes": REGISTER,
        "iterations": about["iteration"], "gaussians": about["gaussians"], "said": spoken.said,
        "trained": spoken.trained, "whole": whole, "largest_rise": spoken.largest_rise,
        "forecast_after": progress.FORECAST_AFTER, "passes": 1, "blas_threads": 1, "curve": spoken.curve,
        "course": spoken.course,
        "held_out": {key: metrics["held_out"]["mean"][key] for key in KEYS},
        "blend": {key: metrics["baselines"]["two_neighbours"]["mean"][key] for key in KEYS},
        "processor": here.get("processor"), "machine": here, "date": now()[:10],
    }  # fmt: skip


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Train on every clip; what was said is stored in place of an earlier command of the same kind."""
    if os.environ.get(BLAS[0]) != BLAS[1]:
        raise InputError(f"bench.waiting: set {'='.join(BLAS)}, with which a command runs")
    words = ["--preset", options.preset, "--seed", str(options.seed)]
    words += ["--lpips", str(options.lpips)] if options.lpips else []
    words += ["--iterations", str(options.iterations)] if options.iterations else []
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as root:
        for clip in options.clips:
            row = heard(clip, words, options.wall, Path(root) / "speed.json")
            found = with_row(options.record, row, SAME)
            write_json(options.record, found)
    return found


PROGRAM = Program(
    __name__, "bench.md", {"said": said, "quality": quality}, "waiting.json", measured,
    {
        "clips": {**CLIPS, "nargs": "+"}, "--preset": "quick", "--seed": 0, "--lpips": LPIPS,
        "--iterations": {"type": int, "help": "exact length (default: that of the preset on the clip)"},
        "--wall": {"action": "store_true", "help": "time on the wall, with all threads"},
    },
    draw, stamped=False,
)  # fmt: skip
