"""Train on the real clip with a moving camera, prepared from its original files, and write the table of the result.

    python docs/make.py recordings.sinus measure [--data FOLDER] [--scale 0.16667] [--iterations 1500]
    python docs/make.py recordings.sinus measure --run RUN    of an existing run

The clip has 35 frames, poses, intrinsics and sparse points of a reconstruction, and one mask of the field of view. Its
anatomy is rigid; the camera and the light move.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any

from pages.store.commands import loaded, said
from pages.store.program import DATA, Program
from pages.store.tables import noted, numbers

COLUMNS = (("psnr_tissue", "PSNR tissue, dB", 2), ("psnr_full", "PSNR full, dB", 2), ("ssim_full", "SSIM full", 4))


def of_run(run: Path) -> dict[str, Any]:
    """The stored results of a run: held-out rows, settings and versions, without paths of the machine."""
    metrics = loaded(run / "metrics.json")
    rows = {"endotsr": metrics["held_out"]["mean"], "cross_fade": metrics["cross_fade"]["mean"]}
    labels = {"endotsr": "endotsr", "cross_fade": "blend of its own renders"}
    for name, row in metrics["baselines"].items():
        rows[name], labels[name] = row["mean"], row["label"]
    about = metrics["run"]
    source = about["input"]
    kept = {key: source[key] for key in ("frames", "width", "height", "training_frames", "held_out_frames", "notes")}
    return {
        "labels": labels,
        "held_out": rows,
        "training_psnr": metrics["training"]["mean"]["psnr_tissue"],
        "gaussians": about["gaussians"],
        "machine": about["machine"],
        "versions": about["versions"],
        "input": kept,
        "settings": about["settings"],
    }


def table(found: dict[str, Any]) -> str:
    """The held-out rows."""
    columns = [(key, digits) for key, _, digits in COLUMNS]
    rows = [[label, *numbers(found["held_out"][name], columns)] for name, label in found["labels"].items()]
    source, settings = found["input"], found["settings"]
    about = (
        f"`sinus_endoscopy`, {source['frames']} frames of {source['width']}x{source['height']},"
        f" {source['held_out_frames']} of them held out; preset `{settings['preset']}`,"
        f" {settings['training']['iterations']} iterations, {found['gaussians']} Gaussians; {found['date'][:10]}."
    )
    return noted(["Held-out frames", *(label for _, label, _ in COLUMNS)], rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """An existing run, or a new one."""
    if options.run is not None:
        return of_run(options.run)
    with tempfile.TemporaryDirectory() as root:
        clip, run = Path(root) / "sinus_endoscopy", Path(root) / "run"
        said("prepare", options.data, "--out", clip, "--scale", options.scale)
        said("train", clip, "--out", run, "--preset", options.preset, "--iterations", options.iterations)
        return of_run(run)


PROGRAM = Program(
    __name__, "guides/prepare.md", {"rows": table}, "sinus.json", measured,
    {"--data": DATA / "sinus_endoscopy", "--scale": 1 / 6, "--preset": "paper", "--iterations": 1500,
     "--run": {"type": Path}},
)  # fmt: skip
