"""The time left that a training shows: of the iterations to come, not of compilation."""

import io
from types import SimpleNamespace

import numpy as np
import pytest

from endotsr.cli.parts import progress
from endotsr.cli.parts.progress import Progress, unit_seconds
from endotsr.clips.sequences.checks.cost import iteration_work
from endotsr.config import PRESETS


class Clock:
    """A clock that the test moves."""

    now = 0.0

    def monotonic(self):
        return self.now


PIXELS = 160 * 128


@pytest.fixture
def told(monkeypatch):
    """What a training of `quick` says whose first iteration compiles for three minutes, and whose unit takes 0.1 s."""
    clock, said, out, config = Clock(), io.StringIO(), [], PRESETS["quick"]
    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr(progress.sys, "stderr", said)
    shown = Progress(config, PIXELS)
    monkeypatch.setattr(shown, "say", out.append)
    shown.begin(SimpleNamespace(iteration=0, coarse=False))
    for iteration in range(1, 1601):
        count = int(np.interp(iteration, [config.density.start, config.density.until], [16_000, 22_000]))
        clock.now += 0.1 * iteration_work(count, PIXELS, iteration / 1600) + (
            180.0 if iteration == 1 else 40.0 if iteration == 9 else 0.0
        )
        shown.update({"iteration": iteration, "loss": 0.5, "psnr": None, "gaussians": count})
    return said.getvalue().splitlines(), out, clock.now


def test_compilation_is_no_part_of_the_time_left(told):
    lines, _, end = told
    assert lines[0].startswith("iteration 1 of 1600: ") and lines[0].endswith("time left unknown")
    assert lines[1].startswith("iteration 9 of 1600: ")
    assert seconds(lines[1].rsplit(", ", 1)[1]) == pytest.approx(end - 220, rel=0.05)


def test_the_forecast_knows_that_the_gaussians_will_grow(told):
    _, out, end = told
    assert len(out) == 1
    assert out[0].endswith("of training left, about 22000 Gaussians at the end")
    left = seconds(out[0].removeprefix("forecast: ").split(" of ")[0])
    assert left == pytest.approx(end - 220, rel=0.05)
    first = 0.1 * iteration_work(16_000, PIXELS, 0.0)
    assert left > 1.5 * 1600 * first, "the pace of the first iterations is not that of the training"


def seconds(shown):
    minutes, rest = shown.removesuffix(" left").split(":")
    return 60 * int(minutes) + int(rest)


def test_the_unit_follows_the_latest_iterations():
    assert unit_seconds([0.1] * 100) == pytest.approx(0.1)
    assert unit_seconds([0.1] * 50 + [0.3] * 50) == pytest.approx(0.2)
    assert unit_seconds([5.0, *[0.1] * 99]) == pytest.approx(0.1), "one that compiled is left out"
    assert unit_seconds([9.0] * 4) is None
