"""Sweeps small enough for tests: 48x32 simulated sequences, a few hundred Gaussians, 30 iterations."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

BASE = """
sequences = ["simulated"]
seeds = [0, 1]
iterations = 30

[simulator]
width = 48
height = 32
frames = 9

[settings.initialisation]
first_frame_points = 150
other_frame_points = 40

[settings.density]
interval = 5
maximum = 400

[settings.training]
checkpoint_every = 7
"""
CONFIGURATIONS = """
[configurations.base.model]
appearance = false
spectral_motion = false
laplacian = false

[configurations.A.model]
spectral_motion = false
laplacian = false
"""
TIMES = {"seconds", "started", "finished", "peak_memory_bytes", "threads", "date", "machine"}


def write_spec(folder: Path, text: str = BASE + CONFIGURATIONS, **changes: str) -> Path:
    """SPEC.toml in a folder; `changes` replace whole lines by their keys."""
    lines = text.splitlines()
    for key, value in changes.items():
        at = next(i for i, line in enumerate(lines) if line.startswith(f"{key} ="))
        lines[at] = f"{key} = {value}"
    file = folder / "SPEC.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    return file


def start(*words: str, **environment: str) -> subprocess.Popen:
    """A command in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "endotsr.cli.main", *words],
        env=os.environ | {"MPLBACKEND": "Agg"} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until(condition: Callable[[], bool], seconds: float = 300.0) -> None:
    """Wait for a condition; AssertionError when it does not come."""
    ends = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < ends, "waited in vain"
        time.sleep(0.02)


def kill(process: subprocess.Popen) -> None:
    process.send_signal(signal.SIGKILL)
    process.wait()


def iterations(run: Path) -> list[int]:
    """The iterations of a log in their order."""
    return [json.loads(line)["iteration"] for line in (run / "log.jsonl").read_text().splitlines()]


def rows_of(out: Path) -> dict[str, dict]:
    """The rows of results.json by name."""
    return {row["name"]: row for row in json.loads((out / "results.json").read_text())["rows"]}


def numbers(out: Path) -> dict[str, dict]:
    """What no clock and no machine changes."""
    return {name: {k: v for k, v in row.items() if k not in TIMES} for name, row in rows_of(out).items()}


def assert_same_arrays(a: Path, b: Path) -> None:
    """All arrays of the last checkpoints of two runs are bitwise equal; their headers may differ."""
    with np.load(a / "checkpoint.npz") as one, np.load(b / "checkpoint.npz") as other:
        for key in set(one.files) - {"header"}:
            assert one[key].tobytes() == other[key].tobytes(), (a.name, key)


def assert_same_checkpoints(a: Path, b: Path) -> None:
    """All arrays of the last checkpoints of all runs are bitwise equal."""
    names = sorted(path.name for path in (a / "runs").iterdir())
    assert names and names == sorted(path.name for path in (b / "runs").iterdir())
    for name in names:
        assert_same_arrays(a / "runs" / name, b / "runs" / name)
