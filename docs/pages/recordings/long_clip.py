"""Measure the memory of a training on a long clip that repeats the frames of a short one.

    python docs/make.py recordings.long_clip measure --frames 2000 --memory 4     half the memory of an 8 GB machine
    python docs/make.py recordings.long_clip measure --frames 300 --memory 0.6    the same proportions, some minutes

The frames of the source (--source, by default ../shared/data/endonerf_pulling) are linked repeatedly into a temporary
folder. The training has as many iterations as training frames, so every frame is used about once, and ends with the
whole evaluation. Meanwhile /proc reports its own memory (RssAnon) and pages of files that the system can drop at any
time (RssFile). A result replaces that of the same frames, memory and preset.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.forecast.cost import estimated_cost
from endotsr.clips.sequences.forecast.seconds import expected_frames
from endotsr.config import config_from_dict, with_iterations
from endotsr.results.report.tables import markdown
from endotsr.training.runs.machine import dated
from pages.store.commands import loaded
from pages.store.kept import with_row
from pages.store.program import DATA, Program

NAMES = ("images", "masks", "depth")
KEY = ("frames", "memory", "preset")


def repeated(source: Path, clip: Path, frames: int) -> tuple[int, int]:
    """A folder of links in the layout of EndoNeRF; returns width and height."""
    files = {name: sorted((source / name).iterdir()) for name in NAMES}
    for name, known in files.items():
        (clip / name).mkdir(parents=True)
        for i in range(frames):
            os.symlink(known[i % len(known)].resolve(), clip / name / f"{i:06d}.png")
    rows = np.load(source / "poses_bounds.npy")
    np.save(clip / "poses_bounds.npy", rows[np.arange(frames) % len(rows)])
    height, width = read_png(files["images"][0]).shape[:2]
    return width, height


def peaks(command: list[str]) -> dict[str, float]:
    """Run a command to its end; the largest values of RssAnon, RssFile and their sum, in bytes."""
    found = {"own": 0.0, "file": 0.0, "both": 0.0}
    process = subprocess.Popen(command)
    while process.poll() is None:
        try:
            lines = Path(f"/proc/{process.pid}/status").read_text(encoding="ascii").splitlines()
        except (OSError, UnicodeDecodeError):
            lines = []
        values = {line.split(":")[0]: float(line.split()[1]) * 1024 for line in lines if line.startswith("Rss")}
        own, file = values.get("RssAnon", 0.0), values.get("RssFile", 0.0) + values.get("RssShmem", 0.0)
        for key, value in (("own", own), ("file", file), ("both", own + file)):
            found[key] = max(found[key], value)
        time.sleep(0.2)
    if process.returncode:
        raise SystemExit(f"failed: {' '.join(command)}")
    return found


def trained(options: argparse.Namespace) -> dict[str, Any]:
    """One training."""
    with tempfile.TemporaryDirectory() as root:
        clip, run = Path(root) / "clip", Path(root) / "run"
        width, height = repeated(options.source, clip, options.frames)
        iterations = options.frames - (options.frames + 6) // 8
        words = ["train", str(clip), "--out", str(run), "--preset", options.preset, "--iterations", str(iterations)]
        limit = ["--sequence.memory", f"{options.memory:g}"]
        begun = time.monotonic()
        found = peaks([sys.executable, "-m", "endotsr", *words, *limit])
        metrics = loaded(run / "metrics.json")
    config = config_from_dict({"preset": options.preset, "sequence": {"memory": options.memory}})
    frames = expected_frames(options.frames, config)
    cost = estimated_cost(frames, width, height, with_iterations(config, iterations))
    about = {"frames": options.frames, "width": width, "height": height, "preset": options.preset}
    return dated(about) | {
        "memory": options.memory,
        "iterations": iterations,
        "gaussians": metrics["run"]["gaussians"],
        "seconds": time.monotonic() - begun,
        "own_bytes": found["own"],
        "file_bytes": found["file"],
        "both_bytes": found["both"],
        "estimated_bytes": cost.total_bytes,
        "estimated_file_bytes": cost.file_bytes,
    }


def table(result: dict[str, Any]) -> str:
    """One row per measured training."""
    headings = ["Frames", "Size", "Preset", "`sequence.memory`, GB", "estimated, GB", "own memory, GB",
                "file of the frames, estimated, GB"]  # fmt: skip
    cells = [
        [f"{row['frames']}", f"{row['width']}x{row['height']}", f"`{row['preset']}`", f"{row['memory']:g}",
         f"{row['estimated_bytes'] / 1e9:.2f}", f"{row['own_bytes'] / 1e9:.2f}",
         f"{row['estimated_file_bytes'] / 1e9:.2f}"]
        for row in result["rows"]
    ]  # fmt: skip
    return markdown(headings, cells)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """One more training beside the stored ones."""
    return with_row(options.record, trained(options), KEY)


PROGRAM = Program(
    __name__, "guides/prepare.md", {"memory": table}, "long_clip.json", measured,
    {"--source": DATA / "endonerf_pulling", "--frames": 300, "--memory": 0.6, "--preset": "paper"}, stamped=False,
)  # fmt: skip
