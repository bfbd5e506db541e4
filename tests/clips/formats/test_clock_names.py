"""Names that state a time of day: those whose order is not that of time are named, and no others."""

from pathlib import Path

import pytest

from endotsr.clips.formats.files import time_order
from endotsr.clips.sequences.checks.clock_names import clock_findings
from endotsr.clips.sequences.checks.frames import gap_findings


def in_order(names: list[str]) -> list[Path]:
    files = [Path("clip") / f"{name}.png" for name in names]
    return [files[i] for i in time_order(files)]


def clock(seconds: int, form: str = "{:02d}-{:02d}-{:02d}") -> str:
    return form.format(seconds // 3600 % 24, seconds // 60 % 60, seconds % 60)


LATE = range(86400 - 40, 86400 + 30, 10)  # seconds of seven pictures, past midnight
FORMS = (
    "{:02d}-{:02d}-{:02d}",
    "{:02d}{:02d}{:02d}",
    "shot_{:02d}.{:02d}.{:02d}.250",
    "2026-03-01 {:02d}_{:02d}_{:02d}",
)


@pytest.mark.parametrize("form", FORMS)
def test_names_past_midnight(form):
    (found,) = clock_findings(in_order([clock(t, form) for t in LATE]))
    assert found.code == "order-of-names" and "past midnight" in found.what and found.frame == 3
    assert clock(86400 - 40, form) in found.what


@pytest.mark.parametrize("names", [
    [clock(t) for t in range(36000, 36100, 10)],
    [clock(t) for t in (10, 20, 50000, 50010)],  # two recordings of one day
    [f"2026-03-0{1 + t // 86400}_{clock(t)}" for t in LATE],
    [f"20260{301 + t // 86400}T{clock(t, '{:02d}{:02d}{:02d}')}" for t in LATE],
    [f"{i:06d}" for i in range(0, 240000, 1000)],
    [f"frame_{i}" for i in range(9)], ["000000", "120000", "235959"], ["left", "right", "up"],
    [f"{i:02d}_{j:02d}_{k:02d}" for i in range(24) for j in range(0, 60, 20) for k in range(0, 60, 20)],
])  # fmt: skip
def test_other_names_are_not_said_to_be_exchanged(names):
    assert clock_findings(in_order(names)) == []


SCREEN = "Screenshot 2026-03-0{} at {}.{:02d}.{:02d} {}M"


def test_names_with_am_and_pm():
    """One o'clock has a smaller number than noon."""
    noon = [SCREEN.format(1, 12, 59, 58 + k, "P") for k in range(2)] + [
        SCREEN.format(1, 1, 0, k, "P") for k in range(3)
    ]
    (found,) = gap_findings(in_order(noon))
    assert (
        found.code == "order-of-names"
        and found.what == f"{noon[0]}.png is earlier than {noon[4]}.png, and comes after it"
    )
    later = [SCREEN.format(1, 11, 59, 58 + k, "P") for k in range(2)] + [
        SCREEN.format(2, 12, 0, k, "A") for k in range(3)
    ]
    assert gap_findings(in_order(later)) == [] == gap_findings(in_order(noon[2:]))
