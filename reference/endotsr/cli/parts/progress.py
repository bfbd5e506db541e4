"""Progress on the standard error: a bar on a terminal, single lines elsewhere; and the page of a training."""

import math
import statistics
import sys
import time
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from endotsr.report.words import duration

if TYPE_CHECKING:
    from endotsr.fitting.state import TrainingState
    from endotsr.report.live_page import LivePage

QUIET_SECONDS = 30.0  # between lines if the standard error is not a terminal
BAR = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}{postfix}]"  # the time left is in the postfix
LEAST_ITERATIONS, MOST_ITERATIONS = 5, 200  # whose seconds give the time left
SPIKE = 10.0  # medians: a longer iteration compiled code and is left out
MEMORY = {"loss": 0.98, "psnr": 0.8}  # of the running means: about the last 50 views (PSNR comes every tenth)


class Progress:
    """Loss and PSNR (running means over views), Gaussian count and time left.

    page   is told of the same events, and of the time left
    """

    def __init__(self, total: int, page: "LivePage | None" = None) -> None:
        self._total, self._page = total, page
        self._said = self._ended = time.monotonic()
        self._means: dict[str, float] = {}
        self._seconds: deque[float] = deque(maxlen=MOST_ITERATIONS)
        self._bar: Any = None

    def begin(self, state: "TrainingState") -> None:
        """The training begins with `state`."""
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

    def update(self, entry: dict[str, Any]) -> None:
        """Show the log entry of one iteration."""
        for name, memory in MEMORY.items():
            value = entry.get(name)
            if value is not None and math.isfinite(value):
                mean = self._means.get(name)
                self._means[name] = value if mean is None else memory * mean + (1 - memory) * value
        now = time.monotonic()
        self._seconds.append(now - self._ended)
        self._ended = now
        if self._page is not None:
            left, _, known = self._left(entry).partition(" left")
            self._page.update(entry, None if known else left)
        if self._bar is not None:
            self._bar.update(1)
            if self._bar.n % 10 == 0 or self._bar.n == self._total:
                self._bar.set_postfix_str(self._state(entry), refresh=False)
        elif now - self._said > QUIET_SECONDS:
            self._said = now
            print(f"iteration {entry['iteration']} of {self._total}: {self._state(entry)}", file=sys.stderr, flush=True)

    def say(self, message: str) -> None:
        """A line that does not disturb the bar."""
        if self._bar is not None:
            self._bar.write(message)
        else:
            print(message, flush=True)

    def close(self) -> None:
        """End the line of the bar, and the page."""
        if self._page is not None:
            self._page.close()
        if self._bar is not None:
            self._bar.close()

    def _state(self, entry: dict[str, Any]) -> str:
        shown = f"loss {self._means.get('loss', float('nan')):.4f}, PSNR {self._means.get('psnr', float('nan')):.2f} dB"
        return f"{shown}, {entry.get('gaussians', 0)} Gaussians, {self._left(entry)}"

    def _left(self, entry: dict[str, Any]) -> str:
        return time_left(self._seconds, self._total - entry["iteration"])


def time_left(seconds: Sequence[float], remaining: int) -> str:
    """The time that is left, from the seconds of the latest iterations, those that compiled code left out.

    seconds     of the latest iterations, the last one last
    remaining   iterations to come
    """
    if len(seconds) < LEAST_ITERATIONS:
        return "time left not known yet"
    limit = SPIKE * statistics.median(seconds)
    return f"{duration(statistics.fmean(s for s in seconds if s <= limit) * remaining)} left"


class StepBar:
    """A progress bar on a terminal; one line at the beginning elsewhere."""

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
        """A line that does not disturb the bar."""
        if self._bar is not None:
            self._bar.clear()
        print(message, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
