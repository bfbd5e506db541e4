"""Progress on standard error (a bar on a terminal, lines elsewhere) and on the page of a training."""

import math
import statistics
import sys
import time
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from endotsr.clips.sequences.checks.cost import Standing, gaussians_at_end, iteration_work, work_left
from endotsr.config import Config
from endotsr.results.report.tables import duration
from endotsr.training.fitting.records import LogEntry

if TYPE_CHECKING:
    from endotsr.results.report.live_page import LivePage
    from endotsr.training.fitting.state import TrainingState

QUIET_SECONDS = 30.0  # between lines if standard error is no terminal
BAR = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}{postfix}]"  # the postfix contains the time left
LEAST_ITERATIONS, MOST_ITERATIONS = 5, 200  # number of timed iterations for the time left
FORECAST_AFTER = 30  # iterations of this process
SPIKE = 10.0  # medians; longer iterations compiled code and are left out
MEMORY = {"loss": 0.98, "psnr": 0.8}  # of the running means: about the last 50 views (PSNR: every tenth iteration)


class Progress:
    """Loss and PSNR (running means over views), number of Gaussians and time left.

    config   settings of the training, with a fixed length
    pixels   per frame
    page     receives the same events, and the time left
    """

    def __init__(self, config: Config, pixels: int, page: "LivePage | None" = None) -> None:
        self._config, self._pixels, self._page = config, pixels, page
        self._total, self._done, self._training = config.training.iterations, 0, None
        self._said = self._ended = time.monotonic()
        self._means: dict[str, float] = {}
        self._seconds: deque[float] = deque(maxlen=MOST_ITERATIONS)
        self._bar: Any = None

    def begin(self, state: "TrainingState") -> None:
        """The training begins with `state`."""
        self._training = state
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
        now = time.monotonic()
        standing = self._standing(entry)
        seen = self._pixels / 4 if standing.coarse else self._pixels
        work = iteration_work(standing.gaussians, seen, standing.iteration / self._total)
        self._seconds.append((now - self._ended) / float(work))
        self._ended, self._done = now, self._done + 1
        if self._page is not None:
            self._page.update(entry, lambda: self._left(standing))
        if self._done == FORECAST_AFTER and (left := self._left(standing)) is not None:
            count = gaussians_at_end(self._config)
            self.say(f"forecast: {left} of training left, about {count} Gaussians at the end")
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
        shown = f"loss {self._means.get('loss', float('nan')):.4f}, PSNR {self._means.get('psnr', float('nan')):.2f} dB"
        time_left = "time left unknown" if left is None else f"{left} left"
        return f"{shown}, {entry.get('gaussians', 0)} Gaussians, {time_left}"

    def _standing(self, entry: LogEntry) -> Standing:
        coarse = self._training is not None and self._training.coarse
        return Standing(entry["iteration"], entry.get("gaussians", 0), coarse)

    def _left(self, standing: Standing) -> str | None:
        unit = unit_seconds(self._seconds)
        return None if unit is None else duration(unit * work_left(self._config, self._pixels, standing))


def unit_seconds(seconds: Sequence[float]) -> float | None:
    """Mean seconds per unit of work, without iterations that compiled code; None = too few iterations.

    seconds   of the latest iterations, each divided by its work
    """
    if len(seconds) < LEAST_ITERATIONS:
        return None
    limit = SPIKE * statistics.median(seconds)
    return statistics.fmean(s for s in seconds if s <= limit)


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
