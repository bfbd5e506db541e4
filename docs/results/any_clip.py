"""One simulated scene through two layouts, one command a step, and the table of what the way costs.

    python docs/results/any_clip.py                measure, a few minutes on two cores
    python docs/results/any_clip.py --table        write the table of the last result again

A moving camera with an instrument is written twice: as an EndoNeRF folder without any loss, and as a raw recording in
the layout of StereoMIS. The recording goes through prepare, depth, check, train and render. Between the two ends stands
the EndoNeRF folder with depth from its own stereo pairs, which separates the cost of the depth from that of the film.
The result is docs/results/any_clip.json; the table stands in docs/guides/prepare.md.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.cli.main import main as endotsr
from endotsr.opencv import read_png
from endotsr.report.tables import markdown
from endotsr.runs.files import write_json
from endotsr.runs.machine import machine
from endotsr.sequences.common import open_common

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parent / "pages"))
from marks import write_marked  # noqa: E402

FILE, PAGE = FOLDER / "any_clip.json", FOLDER.parent / "guides" / "prepare.md"
SCENE = ["moving-camera", "--instrument.on", "--width", "240", "--height", "192", "--frames", "25"]
TRAINING = ["--preset", "demo", "--iterations", "600"]
DEPTH = ["--nearest", "25", "--farthest", "120"]
WAYS = {
    "endonerf": "EndoNeRF layout, given depth",
    "stereo": "EndoNeRF layout, depth from its stereo pairs",
    "stereomis": "StereoMIS layout: film, `prepare`, `depth`",
}


def said(*words: object) -> None:
    """Run a command. Raises SystemExit if it fails."""
    command = [str(word) for word in words]
    print("endotsr", *command, flush=True)
    if endotsr(command) != 0:
        raise SystemExit(f"failed: endotsr {' '.join(command)}")


def trained(root: Path) -> dict[str, dict[str, float]]:
    """The held-out metrics of the three ways, and of their renders against the pictures without loss."""
    clean, raw = root / "clean", root / "raw"
    said("simulate", *SCENE, "--out", clean)
    said("simulate", *SCENE, "--out", raw, "--layout", "stereomis")
    said("prepare", clean, "--out", root / "stereo", "--masks", clean / "gt_masks", "--baseline", "4")
    said("depth", root / "stereo", *DEPTH, "--replace")
    said("prepare", raw, "--out", root / "stereomis")
    said("depth", root / "stereomis", *DEPTH)
    said("check", root / "stereomis")
    found = {}
    for way, words in (
        ("endonerf", [clean, "--masks", "gt_masks"]),
        ("stereo", [root / "stereo"]),
        ("stereomis", [root / "stereomis"]),
    ):
        run = root / f"run-{way}"
        said("train", *words, "--out", run, *TRAINING)
        said("render", run, "--film", root / f"{way}.mp4")
        said("render", run, "--frames", "test", "--out", root / f"renders-{way}")
        report = root / f"{way}.json"
        said(
            "evaluate", "--pictures", root / f"renders-{way}" / "colour", "--sequence", clean,
            "--sequence.masks", "gt_masks", "--json", report,
        )  # fmt: skip
        metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
        found[way] = {
            "own": metrics["held_out"]["mean"]["psnr_tissue"],
            "lossless": json.loads(report.read_text(encoding="utf-8"))["held_out"]["mean"]["psnr_tissue"],
            "ssim": metrics["held_out"]["mean"]["ssim_full"],
            "flow": metrics["baselines"]["flow_interpolation"]["mean"]["psnr_tissue"],
        }
    return found | {"film": {"psnr": film_psnr(clean, root / "stereomis")}, "depth": depth_errors(clean, root)}


def frames_of(clean: Path, other: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The pictures of two folders, frame by frame, (H, W, 3) in [0, 255]."""
    for file in sorted((clean / "images").iterdir()):
        yield read_png(file).astype(np.float64), read_png(other / "images" / file.name).astype(np.float64)


def film_psnr(clean: Path, prepared: Path) -> float:
    """PSNR in dB of the pictures of the film against those without loss, over all frames."""
    return float(10 * np.log10(255**2 / np.mean([((a - b) ** 2).mean() for a, b in frames_of(clean, prepared)])))


def depth_errors(clean: Path, root: Path) -> dict[str, float]:
    """Median absolute error in mm of the stereo depth on tissue, and the fraction of the tissue that has depth."""
    found = {}
    for way in ("stereo", "stereomis"):
        recording = open_common(root / way)
        errors, covered = [], []
        assert recording.depth is not None and recording.masks is not None
        for i in range(recording.count):
            with np.load(clean / "truth" / "frames" / f"{i:06d}.npz") as truth:
                true = truth["depth"]
            depth, tissue = recording.depth(i), recording.masks(i)
            assert depth is not None and tissue is not None
            errors.append(np.abs(depth - true)[(depth > 0) & tissue])
            covered.append((depth > 0)[tissue].mean())
        found[f"{way}_mm"] = float(np.median(np.concatenate(errors)))
        found[f"{way}_coverage"] = float(np.mean(covered))
    return found


def table(result: dict[str, Any]) -> str:
    """The three ways, and what separates them."""
    ways = result["ways"]
    rows = [
        [WAYS[way], f"{ways[way]['own']:.2f}", f"{ways[way]['lossless']:.2f}", f"{ways[way]['ssim']:.4f}",
         f"{ways[way]['flow']:.2f}"]
        for way in WAYS
    ]  # fmt: skip
    headings = ["Way", "PSNR tissue, dB", "the same against the lossless pictures, dB", "SSIM full", "optical flow, dB"]
    depth, film = ways["depth"], ways["film"]["psnr"]
    by_depth = ways["stereo"]["lossless"] - ways["endonerf"]["lossless"]
    by_film = ways["stereomis"]["lossless"] - ways["stereo"]["lossless"]
    about = (
        f"Held-out frames of {result['scene']}; {result['training']}. Against the lossless pictures, the stereo depth"
        f" changes the PSNR by {by_depth:+.2f} dB and the film by {by_film:+.2f} dB. The pictures of the film are at"
        f" {film:.1f} dB from the lossless ones. The stereo depth of the lossless pictures has a median error of"
        f" {depth['stereo_mm']:.2f} mm and covers {depth['stereo_coverage']:.0%} of the tissue, that of the film"
        f" {depth['stereomis_mm']:.2f} mm and {depth['stereomis_coverage']:.0%}. {result['date']}."
    )
    return markdown(headings, rows) + "\n\n" + about


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--table", action="store_true")
    if not parser.parse_args().table:
        with tempfile.TemporaryDirectory() as root:
            ways = trained(Path(root))
        about = {"scene": " ".join(SCENE), "training": " ".join(TRAINING), "date": date.today().isoformat()}
        write_json(FILE, about | {"machine": machine(), "ways": ways})
    write_marked(PAGE, {"ways": table(json.loads(FILE.read_text(encoding="utf-8")))}, "any_clip")


if __name__ == "__main__":
    main()
