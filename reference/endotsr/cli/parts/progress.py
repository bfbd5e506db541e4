"""Progress on standard error (a bar on a terminal, lines elsewhere) and on the page of a training."""

import math
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from endotsr.clips.sequences.forecast.seconds import (
    Beside,
    TimedCommand,
    estimated_seconds,
    evaluation_units,
    start_units,
)
from endotsr.clips.sequences.forecast.work import Standing, expected_gaussians
from endotsr.results.report.tables import duration
from endotsr.training.fitting.records import LogEntry
from endotsr.training.runs.time_left import TimeLeft

if TYPE_CHECKING:
    from endotsr.results.report.live_page import LivePage
    from endotsr.training.fitting.state import TrainingState

QUIET_SECONDS = 30.0  # between lines if standard error is no terminal
BAR = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}{postfix}]"  # the postfix contains the time left
FORECAST_AFTER = 60  # iterations of this process, or more until their speed is known; a coarse start is checked at 50
LEAST_SECONDS = 3.0  # of the initial motion and of the evaluation, to tell a speed; shorter ones mostly load code
MEMORY = {"loss": 0.98, "psnr": 0.8}  # of the running means: about the last 50 views (PSNR: every tenth iteration)


class Progress:
    """Loss and PSNR (running means over views), number of Gaussians and time left.

    plan     settings of the training, with a fixed length, and its frames
    page     receives the same events, and the time left
    """

    def __init__(self, plan: TimedCommand, page: "LivePage | None" = None) -> None:
        self._plan, self._page = plan, page
        self._total, self._done = plan.config.training.iterations, 0
        self._training: TrainingState | None = None
        self._forecast_said = False
        self._said = self._ended = time.monotonic()
        self._means: dict[str, float] = {}
        self.time_left = TimeLeft(plan)
        self._bar: Any = None

    def begin(self, state: "TrainingState") -> None:
        """The training begins with `state`."""
        self._training = state
        seconds, units = time.monotonic() - self._ended, start_units(self._plan)
        if state.iteration == 0 and units and seconds >= LEAST_SECONDS:
            self._plan = self._plan._replace(beside=self._plan.beside._replace(start=seconds / units))
            self.time_left = TimeLeft(self._plan)
        if self._page is not None:
            self._page.begin(state)
        self._said = self._ended = time.monotonic()
        if sys.stderr.isatty():
            from tqdm import tqdm

            self._bar = tqdm(
                total=self._total,
                initial=state.iteration,
                unit="it",
                dynamic_ncols=True,
                mininterval=0.25,
                bar_format=BAR,
            )

    def update(self, entry: LogEntry) -> None:
        """Show the log entry of one iteration."""
        for name, memory in MEMORY.items():
            value = entry.get(name)
            if value is not None and math.isfinite(value):
                mean = self._means.get(name)
                self._means[name] = value if mean is None else memory * mean + (1 - memory) * value
        now, state = time.monotonic(), self._training
        assert state is not None
        standing = self.standing(entry)
        self.time_left.add(standing, now - self._ended, state.making)
        self._ended, self._done = now, self._done + 1
        if self._page is not None:
            self._page.update(entry, lambda: self._left(standing))
        if not self._forecast_said and self._done >= FORECAST_AFTER and (forecast := self._forecast(standing)):
            self._forecast_said = True
            self.say(forecast)
        if self._bar is not None:
            self._bar.update(1)
            if self._bar.n % 10 == 0 or self._bar.n == self._total:
                self._bar.set_postfix_str(self._state(entry, self._left(standing)), refresh=False)
        elif now - self._said > QUIET_SECONDS:
            self._said = now
            print(
                f"iteration {entry['iteration']} of {self._total}: {self._state(entry, self._left(standing))}",
                file=sys.stderr,
                flush=True,
            )

    def standing(self, entry: LogEntry) -> Standing:
        """The progress of the training after the iteration of a log entry."""
        state = self._training
        assert state is not None
        return Standing(entry["iteration"], entry.get("gaussians", 0), state.coarse, state.coarse_until)

    def remember_speed(self) -> None:
        """Store the speed of this machine for later forecasts, if the training was long enough to tell."""
        from endotsr.training.runs.speed import remember_beside, remember_unit

        remember_unit(self._plan.threads, self.time_left.unit, self._done, self._plan.pixels)
        remember_beside(self._plan.threads, self._plan.beside, self._plan.pixels)
        self._ended = time.monotonic()

    def remember_evaluation(self) -> None:
        """The same for the evaluation, which has taken the time since the end of the training."""
        from endotsr.training.runs.speed import remember_beside

        seconds, units = time.monotonic() - self._ended, evaluation_units(self._plan)
        if units and seconds >= LEAST_SECONDS:
            remember_beside(self._plan.threads, Beside(evaluation=seconds / units), self._plan.pixels)

    def say(self, message: str) -> None:
        """Print a line without breaking the bar."""
        if self._bar is not None:
            self._bar.write(message)
        else:
            print(message, flush=True)

    def close(self) -> None:
        """Close the bar and the page."""
        if self._page is not None:
            self._page.close()
        if self._bar is not None:
            self._bar.close()

    def _state(self, entry: LogEntry, left: str | None) -> str:
        quantities = (("loss", "loss {:.4f}"), ("psnr", "PSNR {:.2f} dB"))
        shown = [words.format(self._means[name]) for name, words in quantities if name in self._means]
        time_left = "time left unknown" if left is None else f"{left} left"
        return ", ".join([*shown, f"{entry.get('gaussians', 0)} Gaussians", time_left])

    def _left(self, standing: Standing) -> str | None:
        seconds = self.time_left.seconds(standing)
        return None if seconds is None else duration(seconds)

    def _forecast(self, standing: Standing) -> str:
        """The line after the first timed iterations; empty without a time."""
        left, unit = self._left(standing), self.time_left.unit
        if left is None or unit is None:
            return ""
        evaluation = estimated_seconds(self._plan, unit).evaluation
        then = f", then {duration(evaluation)} of evaluation" if evaluation else ""
        count = expected_gaussians(self._plan.config, standing, np.array([self._total]), self._plan.pixels)[0]
        return f"forecast: {left} of training left{then}; about {count:.0f} Gaussians at the end"


class StepBar:
    """A progress bar on a terminal; elsewhere one line at the beginning."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._bar: Any = None

    def __enter__(self) -> "StepBar":
        return self

    def begin(self, steps: int) -> None:
        """Set the number of steps."""
        from tqdm import tqdm

        self._bar = tqdm(total=steps, desc=self._name, disable=None, dynamic_ncols=True)
        if self._bar.disable:
            print(f"{self._name}: {steps} steps", flush=True)

    def step(self, count: int = 1) -> None:
        """Advance by a number of completed steps."""
        self._bar.update(count)

    def say(self, message: str) -> None:
        """Print a line without breaking the bar."""
        if self._bar is not None:
            self._bar.clear()
        print(message, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
