"""The table of docs/guides/show.md: python docs/make.py recordings.show measure RUN

Measures the cost of a viewer page, films and files of a trained run: seconds of the command on all cores (start of
Python included) and megabytes of its output. A headless browser opens the page and draws with the processor:
milliseconds per picture, and PSNR of its picture against the reference renderer.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.api import Run, open_run
from endotsr.results.evaluation.metrics import psnr
from pages.store.program import DOCS, RUN, Program
from pages.store.tables import noted, where_with_cores

COMMANDS = {
    "page": ("export", "--out", "page.html"),
    "film of all frames": ("render", "--film", "frames.mp4", "--frames", "all"),
    "film with four panels": (
        "render", "--film", "panels.webm", "--frames", "all", "--panels", "render", "truth", "error", "depth"),
    "film of 100 pictures, swaying camera": ("render", "--film", "sway.mp4", "--count", "100", "--camera", "sway"),
    "pictures of the held-out frames": ("render", "--out", "pictures"),
    "Gaussians at one time (`.ply`)": ("export", "--out", "scene.ply", "--times", "0.5"),
    "point cloud": ("export", "--out", "points.ply", "--content", "points", "--times", "0.5"),
    "mesh": ("export", "--out", "mesh.ply", "--content", "mesh", "--times", "0.5"),
    "slim model": ("export", "--out", "slim.npz"),
}  # fmt: skip
MOMENT = 0.5  # time at which the page is compared


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every command on this run, and the page in a browser."""
    run = options.run
    opened = open_run(run)
    assert isinstance(opened, Run), f"{run}: trained in windows"
    sequence, megabytes = opened.sequence, (run / "checkpoint.npz").stat().st_size / 1e6
    with tempfile.TemporaryDirectory() as folder:
        commands = {name: _one(run, words, Path(folder)) for name, words in COMMANDS.items()}
        page = _in_browser(opened, Path(folder) / "page.html")
    return {
        "gaussians": opened.model.gaussians.count, "frames": sequence.count, "width": sequence.width,
        "height": sequence.height, "checkpoint_mb": megabytes, "commands": commands, "page": page,
    }  # fmt: skip


def _one(run: Path, words: tuple[str, ...], folder: Path) -> dict[str, float]:
    command, *rest = words
    before = set(folder.iterdir())
    began = time.monotonic()
    subprocess.run([sys.executable, "-m", "endotsr", command, run.resolve(), *rest, "-q"], cwd=folder, check=True)
    seconds = time.monotonic() - began
    (made,) = set(folder.iterdir()) - before
    files = [made] if made.is_file() else [file for file in made.rglob("*") if file.is_file()]
    return {"seconds": seconds, "mb": sum(file.stat().st_size for file in files) / 1e6}


def _in_browser(run: Run, page: Path) -> dict[str, float]:
    """Milliseconds per picture, and PSNR against the reference renderer."""
    sys.path.insert(0, str(DOCS.parent / "tests" / "results" / "views"))
    from browser import drawn  # type: ignore[import-not-found]
    from frame_rate import milliseconds_a_picture  # type: ignore[import-not-found]

    reference = np.clip(run.render(MOMENT).colour, 0.0, 1.0)
    picture = drawn(page, f"t={MOMENT}").transpose(2, 0, 1) / 255.0
    whole = np.ones(reference.shape[1:], bool)
    return {"milliseconds": milliseconds_a_picture(page), "psnr": psnr(picture, reference, whole)}


def table(result: dict[str, Any]) -> str:
    """Output, seconds, megabytes."""
    rows = [(name, f"{x['seconds']:.1f} s", f"{x['mb']:.1f} MB") for name, x in result["commands"].items()]
    page = result["page"]
    slim = result["commands"]["slim model"]["mb"] / result["checkpoint_mb"]
    size = f"{result['width']}x{result['height']}"
    note = (
        f"A run of {result['gaussians']} Gaussians on {result['frames']} frames of {size}, whose checkpoint has "
        f"{result['checkpoint_mb']:.0f} MB; the slim model is {slim:.0%} of it. A headless browser that draws with the "
        f"processor needs {page['milliseconds']:.0f} ms per picture of the page, with a PSNR of {page['psnr']:.1f} "
        f"dB against the reference renderer ({where_with_cores(result)})."
    )
    return noted(("Written", "Time", "Size"), rows, note)


PROGRAM = Program(__name__, "guides/show.md", {"sizes": table}, "show.json", measured, {"run": RUN})
