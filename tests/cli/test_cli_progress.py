"""The time left that a training shows: of the iterations to come, not of compilation."""

import io
from types import SimpleNamespace

import pytest

from endotsr.cli.parts import progress
from endotsr.cli.parts.progress import Progress, time_left


class Clock:
    """A clock that the test moves."""

    now = 0.0

    def monotonic(self):
        return self.now


@pytest.fixture
def lines(monkeypatch):
    """What a training says whose first iteration compiles for three minutes, and whose others take 0.1 s."""
    clock, said = Clock(), io.StringIO()
    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr(progress.sys, "stderr", said)
    shown = Progress(6000)
    shown.begin(SimpleNamespace(iteration=0))
    for iteration in range(1, 1001):
        clock.now += 180.0 if iteration == 1 else 40.0 if iteration == 9 else 0.1
        shown.update({"iteration": iteration, "loss": 0.5, "psnr": None, "gaussians": 10})
    return said.getvalue().splitlines()


def test_compilation_is_no_part_of_the_time_left(lines):
    assert lines[0].startswith("iteration 1 of 6000: ") and lines[0].endswith("time left not known yet")
    assert lines[1].startswith("iteration 9 of 6000: ") and lines[1].endswith(", 9:59 left")
    assert lines[-1].startswith("iteration 9") and 8 * 60 < seconds(lines[-1]) < 9 * 60


def seconds(line):
    minutes, rest = line.rsplit(", ", 1)[1].removesuffix(" left").split(":")
    return 60 * int(minutes) + int(rest)


def test_the_time_left_follows_the_latest_iterations():
    assert time_left([0.1] * 100, 600) == "1:00 left"
    assert time_left([0.1] * 50 + [0.3] * 50, 600) == "2:00 left"
    assert time_left([5.0, *[0.1] * 99], 600) == "1:00 left", "one that compiled is left out"
    assert time_left([9.0] * 4, 600) == "time left not known yet"
