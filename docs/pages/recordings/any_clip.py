"""One simulated scene through two layouts, one command per step, and the table of the cost of each input route.

    python docs/make.py recordings.any_clip measure [--ways stereo ...]      a few minutes on two cores

A scene with a moving camera and an instrument is written as a lossless EndoNeRF folder, and as raw recordings in the
layout of StereoMIS. A recording is processed by prepare, depth, check, train and render. Two intermediate routes, the
EndoNeRF folder with depth from its stereo pairs and a recording with lossless video, separate the cost of the depth, of
the layout and of the compression.
"""

import argparse
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.simulator.truth import read_truth
from pages.store.commands import held_out, loaded, said
from pages.store.program import Program
from pages.store.tables import noted

SCENE = ["moving-camera", "--instrument.on", "--width", "240", "--height", "192", "--frames", "25"]
TRAINING = ["--preset", "demo", "--iterations", "600"]
DEPTH = ["--nearest", "25", "--farthest", "120"]
WAYS = {
    "endonerf": "EndoNeRF layout, given depth",
    "stereo": "EndoNeRF layout, depth from its stereo pairs",
    "lossless": "StereoMIS layout, video without loss, `prepare`, `depth`",
    "stereomis": "StereoMIS layout, compressed video, `prepare`, `depth`",
}


def made(root: Path, way: str) -> list[object]:
    """Create the folder of a route; returns its arguments of `train`."""
    clean, clip = root / "clean", root / way
    if way == "endonerf":
        return [clean, "--masks", "gt_masks"]
    if way == "stereo":
        said("prepare", clean, "--out", clip, "--masks", clean / "gt_masks", "--baseline", "4")
        said("depth", clip, *DEPTH, "--replace")
        return [clip]
    raw = root / f"raw-{way}"
    said("simulate", *SCENE, "--out", raw, "--layout", "stereomis", *(["--lossless"] if way == "lossless" else []))
    said("prepare", raw, "--out", clip)
    said("depth", clip, *DEPTH)
    said("check", clip)
    return [clip]


def of_way(root: Path, way: str) -> dict[str, float]:
    """Held-out metrics of a route, metrics of its renders against the lossless pictures, and its input."""
    clean, run, report = root / "clean", root / f"run-{way}", root / f"{way}.json"
    said("train", *made(root, way), "--out", run, *TRAINING)
    said("render", run, "--film", root / f"{way}.mp4")
    said("render", run, "--frames", "test", "--out", root / f"renders-{way}")
    said(
        "evaluate", "--pictures", root / f"renders-{way}" / "colour", "--sequence", clean,
        "--sequence.masks", "gt_masks", "--json", report,
    )  # fmt: skip
    found = {
        "own": held_out(run)["psnr_tissue"],
        "lossless": held_out(report)["psnr_tissue"],
        "ssim": held_out(run)["ssim_full"],
        "flow": loaded(run / "metrics.json")["baselines"]["flow_interpolation"]["mean"]["psnr_tissue"],
    }
    if way == "endonerf":
        return found
    truth = read_truth(clean)
    depth = depth_error(root / way, lambda frame: truth.frame(frame).depth)
    return found | depth | {"video": video_psnr(clean, root / way)}


def frames_of(clean: Path, other: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The pictures of two folders, frame by frame, (H, W, 3) in [0, 255]."""
    for file in sorted((clean / "images").iterdir()):
        yield read_png(file).astype(np.float64), read_png(other / "images" / file.name).astype(np.float64)


def video_psnr(clean: Path, prepared: Path) -> float:
    """PSNR in dB of the prepared pictures against the lossless ones, over all frames; infinite if equal."""
    error = np.mean([((a - b) ** 2).mean() for a, b in frames_of(clean, prepared)])
    return float(10 * np.log10(255**2 / error)) if error else float("inf")


def depth_error(prepared: Path, wanted: Callable[[int], np.ndarray | None]) -> dict[str, float]:
    """Median absolute error in mm of the depth on tissue, and the fraction of the tissue that has depth.

    wanted    frame -> reference depth, (H, W) in mm; 0 = not compared
    """
    clip = describe(prepared)
    errors, covered = [], []
    assert clip.depth is not None and clip.masks is not None
    for i in range(clip.count):
        depth, tissue, known = clip.depth(i), clip.masks(i), wanted(i)
        assert depth is not None and tissue is not None and known is not None
        compared = tissue & (known > 0)
        errors.append(np.abs(depth - known)[compared & (depth > 0)])
        covered.append((depth > 0)[compared].mean())
    return {"depth_mm": float(np.median(np.concatenate(errors))), "coverage": float(np.mean(covered))}


def table(result: dict[str, Any]) -> str:
    """One row per route, and the differences between them."""
    ways, rows = result["ways"], []
    for way, label in WAYS.items():
        if way not in ways:
            continue
        row = ways[way]
        video = row.get("video", np.inf)
        depth = f"{row['depth_mm']:.2f}, {row['coverage']:.0%}" if "depth_mm" in row else "given"
        rows.append(
            [label, f"{row['own']:.2f}", f"{row['lossless']:.2f}", f"{row['ssim']:.4f}", f"{row['flow']:.2f}",
             "-" if video is None or not np.isfinite(video) else f"{video:.1f}", depth]
        )  # fmt: skip
    headings = ["Way", "PSNR tissue, dB", "against the lossless pictures, dB", "SSIM full", "optical flow, dB",
                "PSNR of the prepared pictures, dB", "depth: error in mm, coverage"]  # fmt: skip
    steps = {
        "the depth from stereo": ("stereo", "endonerf"),
        "the raw layout": ("lossless", "stereo"),
        "the compression of the video": ("stereomis", "lossless"),
    }
    changes = [
        f"{what} {ways[a]['lossless'] - ways[b]['lossless']:+.2f} dB" for what, (a, b) in steps.items()
        if a in ways and b in ways
    ]  # fmt: skip
    about = (
        f"Held-out frames of `{result['scene']}`, trained with `{result['training']}`, one seed. What changes the PSNR"
        f" against the lossless pictures: {', '.join(changes)}. The given depth is rounded to whole millimetres. A"
        " compressed video loses sensor noise, which makes its own held-out frames easier to predict."
        f" {result['date'][:10]}."
    )
    return noted(headings, rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The chosen routes; stored results of the other routes of the same scene and training are kept."""
    about = {"scene": " ".join(SCENE), "training": " ".join(TRAINING)}
    known = loaded(options.record) if options.record.exists() else {}
    ways = known["ways"] if {key: known.get(key) for key in about} == about else {}
    with tempfile.TemporaryDirectory() as root:
        said("simulate", *SCENE, "--out", Path(root) / "clean")
        ways |= {way: of_way(Path(root), way) for way in options.ways}
    return about | {"ways": ways}


PROGRAM = Program(
    __name__, "guides/checks.md", {"ways": table}, "any_clip.json", measured,
    {"--ways": {"nargs": "+", "choices": list(WAYS), "default": list(WAYS)}},
)  # fmt: skip
