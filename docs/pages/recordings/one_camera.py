"""Cost of missing depth with one camera: a network's relative depth, and no depth, compared with the true depth.

    python docs/make.py recordings.one_camera measure              some minutes on two cores

Two scenes are simulated: with a fixed camera, scale and shift of the relative depth are assumed; with a moving
camera, they are fitted to sparse points in every frame. The relative depth is an affine map of the true 1 / z, rounded
to 16 bits, with a different map in every frame of the moving camera. The points have the true depth at a few hundred
pixels per frame; 10 % of them are wrong.
"""

import argparse
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.simulator.truth import read_truth
from pages.store.commands import held_out, said
from pages.store.program import Program
from pages.store.tables import noted

SIZE = ["--relief", "2", "--width", "240", "--height", "192", "--frames", "25"]
SCENES = {"fixed": ["pulling", *SIZE], "moving": ["moving-camera", "--instrument.on", *SIZE]}
TRAINING = ["--preset", "demo", "--iterations", "600"]
POINTS, WRONG = 300, 0.1  # points of a frame, and the fraction of them whose depth is up to 30 % off
WAYS = {
    "fixed": {
        "true": "true depth",
        "relative": "relative depth, farthest assumed three times as far as nearest",
        "flat": "a plane (`--flat`)",
    },
    "moving": {
        "true": "true depth",
        "points": "points alone, planes between them",
        "relative": "relative depth, scale and shift from the points",
    },
}


def relative_files(clean: Path, place: Path, each: bool) -> None:
    """One 16-bit picture of an affine map of 1 / z per frame; `each`: a different map in every frame."""
    truth, rng = read_truth(clean), np.random.default_rng(5)
    place.mkdir()
    inverse = [1.0 / truth.frame(i).depth for i in range(len(list((clean / "images").iterdir())))]
    low, high = min(map(np.min, inverse)), max(map(np.max, inverse))
    for i, plane in enumerate(inverse):
        part, lift = (rng.uniform(0.6, 0.9), rng.uniform(0.02, 0.1)) if each else (0.9, 0.05)
        stored = 65535 * (lift + part * (plane - low) / (high - low))
        write_png(place / f"{i:06d}.png", np.rint(stored).astype(np.uint16))


def sparse_files(clean: Path, place: Path) -> None:
    """Depth at the pixels of some points per frame, in steps of 0.01 mm."""
    truth, rng = read_truth(clean), np.random.default_rng(6)
    place.mkdir()
    for i in range(len(list((clean / "images").iterdir()))):
        depth = truth.frame(i).depth
        chosen = rng.choice(depth.size, POINTS, replace=False)
        off = np.where(rng.random(POINTS) < WRONG, rng.uniform(0.7, 1.3, POINTS), 1.0)
        stored = np.zeros(depth.size, np.uint16)
        stored[chosen] = np.rint(100 * depth.reshape(-1)[chosen] * off)
        write_png(place / f"{i:06d}.png", stored.reshape(depth.shape))


def made(root: Path, scene: str, way: str) -> Path:
    """The clip of a route, with true poses."""
    clean, clip = root / scene, root / f"{scene}-{way}"
    said("prepare", clean, "--out", clip, "--masks", clean / "gt_masks")
    if way == "true":
        return clip
    files = root / f"{scene}-{way}-files"
    if scene == "moving":
        sparse_files(clean, root / f"{scene}-{way}-points")
        said("depth", clip, "--given", root / f"{scene}-{way}-points", "--kind", "depth", "--unit-scale", "0.01",
             "--replace")  # fmt: skip
    else:
        _forget_depth(clip)
    if way == "flat":
        said("depth", clip, "--flat")
    elif way == "relative":
        relative_files(clean, files, scene == "moving")
        said("depth", clip, "--given", files, "--kind", "relative", "--replace", "--trust-depth")
    elif way == "points":
        _interpolate(clip)
    said("check", clip)
    return clip


def _forget_depth(clip: Path) -> None:
    """Remove the depth of the clip, as from one camera."""
    shutil.rmtree(clip / "depth")
    text = (clip / "sequence.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[depth]")
    (clip / "sequence.toml").write_text(head + rest[rest.index("\n[") + 1 :] if "\n[" in rest else head)


def _interpolate(clip: Path) -> None:
    """Planes between the points, as computed by `endotsr prepare` from a reconstruction."""
    from endotsr.clips.sequences.points import depth_from_points
    from endotsr.method.splatting.camera import CameraPose

    opened = describe(clip)
    intrinsics = opened.intrinsics
    assert opened.depth is not None and intrinsics is not None
    for i, file in enumerate(sorted((clip / "depth").iterdir())):
        depth, stored = opened.depth(i), read_png(file)
        assert depth is not None
        row, column = np.nonzero(depth)
        z = depth[row, column].astype(np.float64)
        view = np.stack(
            [(column + 0.5 - intrinsics.cx) * z / intrinsics.fx, (row + 0.5 - intrinsics.cy) * z / intrinsics.fy, z], 1
        )
        step = float(np.median(z / stored[row, column]))
        planes = depth_from_points(view, CameraPose(np.eye(3), np.zeros(3)), intrinsics, "interpolated")
        write_png(file, np.rint(planes / step).astype(np.uint16))


def of_way(root: Path, scene: str, way: str) -> dict[str, float]:
    """Held-out metrics of a route, and its depth against the true one after the best scale for the clip."""
    clip, run = made(root, scene, way), root / f"run-{scene}-{way}"
    said("train", clip, "--out", run, *TRAINING)
    mean = held_out(run)
    return {"psnr": mean["psnr_tissue"], "ssim": mean["ssim_full"]} | _depth_error(clip, root / scene)


def _depth_error(clip: Path, clean: Path) -> dict[str, float]:
    """Median relative error of the prior depth on tissue, after one scale for the clip if its unit is arbitrary."""
    opened, truth = describe(clip), read_truth(clean)
    assert opened.depth is not None and opened.masks is not None
    ratios = []
    for i in range(opened.count):
        depth, tissue = opened.depth(i), opened.masks(i)
        assert depth is not None and tissue is not None
        known = tissue & (depth > 0)
        ratios.append((depth / truth.frame(i).depth)[known])
    ratio = np.concatenate(ratios)
    return {"depth": float(np.median(np.abs(ratio / (np.median(ratio) if opened.unit == "arbitrary" else 1) - 1)))}


def table(result: dict[str, Any]) -> str:
    """One row per route."""
    rows = []
    for scene, ways in WAYS.items():
        for way, label in ways.items():
            row = result["scenes"][scene][way]
            metric = "no" if scene == "fixed" and way != "true" else "yes"
            rows.append(
                [f"{scene} camera", label, f"{row['psnr']:.2f}", f"{row['ssim']:.4f}", f"{row['depth']:.1%}", metric]
            )
    headings = ["Scene", "Depth", "Held-out PSNR tissue, dB", "SSIM full", "error of the depth", "metric"]
    about = (
        f"Simulated scenes of 25 frames of 240x192, trained with `{' '.join(TRAINING)}`, one seed. Error of the depth:"
        f" median over tissue, after one scale for the clip where nothing is metric. The true depth and the points are"
        " rounded, to whole millimetres and to hundredths, the relative depth to 16 bits. Held-out frames are seen from"
        f" the cameras of the clip, from which a wrong shape costs little. {result['date'][:10]}."
    )
    return noted(headings, rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every route of both scenes."""
    scenes: dict[str, dict[str, Any]] = {}
    with tempfile.TemporaryDirectory() as root:
        for scene, words in SCENES.items():
            said("simulate", *words, "--out", Path(root) / scene)
            scenes[scene] = {way: of_way(Path(root), scene, way) for way in WAYS[scene]}
    return {"scenes": scenes}


PROGRAM = Program(__name__, "guides/depth.md", {"table": table}, "one_camera.json", measured)
