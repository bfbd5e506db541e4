"""Train on the real clip with a moving camera, prepared from its original files, and write the table of the result.

    python docs/make.py recordings.sinus [--data ../shared/data/sinus_endoscopy] [--scale 0.16667] [--iterations 1500]
    python docs/make.py recordings.sinus --run RUN    write the result of an existing run
    python docs/make.py recordings.sinus --table      rewrite the table of the last result

The clip has 35 frames, poses, intrinsics and sparse points of a reconstruction, and one mask of the field of view. Its
anatomy is rigid; the camera and the light move. The result is docs/results/sinus.json; the table is in
docs/guides/prepare.md.
"""

import argparse
import json
import tempfile
from datetime import date
from pathlib import Path
from typing import Any

from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from pages.recordings.any_clip import said
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "sinus.json", DOCS / "guides" / "prepare.md"
COLUMNS = (("psnr_tissue", "PSNR tissue, dB", 2), ("psnr_full", "PSNR full, dB", 2), ("ssim_full", "SSIM full", 4))


def result(run: Path) -> dict[str, Any]:
    """The stored results of a run: held-out rows, settings and versions, without paths of the machine."""
    metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
    rows = {"endotsr": metrics["held_out"]["mean"], "cross_fade": metrics["cross_fade"]["mean"]}
    labels = {"endotsr": "endotsr", "cross_fade": "blend of its own renders"}
    for name, row in metrics["baselines"].items():
        rows[name], labels[name] = row["mean"], row["label"]
    about = metrics["run"]
    source = about["input"]
    kept = {key: source[key] for key in ("frames", "width", "height", "training_frames", "held_out_frames", "notes")}
    return {
        "date": date.today().isoformat(),
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
    rows = [
        [label, *(f"{found['held_out'][name][key]:.{digits}f}" for key, _, digits in COLUMNS)]
        for name, label in found["labels"].items()
    ]
    source, settings = found["input"], found["settings"]
    about = (
        f"`sinus_endoscopy`, {source['frames']} frames of {source['width']}x{source['height']},"
        f" {source['held_out_frames']} of them held out; preset `{settings['preset']}`,"
        f" {settings['training']['iterations']} iterations, {found['gaussians']} Gaussians; {found['date']}."
    )
    return markdown(["Held-out frames", *(label for _, label, _ in COLUMNS)], rows) + "\n\n" + about


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--data", type=Path, default=DOCS.parents[1] / "shared" / "data" / "sinus_endoscopy")
    parser.add_argument("--scale", type=float, default=1 / 6)
    parser.add_argument("--preset", default="paper")
    parser.add_argument("--iterations", type=int, default=1500)
    parser.add_argument("--run", type=Path)
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    if options.run is not None:
        write_json(FILE, result(options.run))
    elif not options.table:
        with tempfile.TemporaryDirectory() as root:
            clip, run = Path(root) / "sinus_endoscopy", Path(root) / "run"
            said("prepare", options.data, "--out", clip, "--scale", options.scale)
            said("train", clip, "--out", run, "--preset", options.preset, "--iterations", options.iterations)
            write_json(FILE, result(run))
    write_marked(PAGE, {"rows": table(read_json(FILE, "python docs/make.py recordings.sinus"))}, "sinus")
