"""Train on a clip from its own stereo pictures, as png, jpg and video, without its depth, and write the table.

    python docs/make.py recordings.own_pictures measure CLIP [--seeds 3] [--iterations 1500]

CLIP is a folder in the layout of EndoNeRF with right pictures. All routes use `prepare` at half size. The first route
keeps the depth of the folder; the others compute it by `depth` from the pictures. The distance of the cameras is fitted
once to the given depth. The renders of every route are also compared with the lossless pictures.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.layouts import describe
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from pages.recordings.any_clip import depth_error, video_psnr
from pages.store import kept
from pages.store.commands import held_out, said
from pages.store.program import CLIP, Program
from pages.store.tables import means, noted, where

QUALITY, SCALE = 90, 0.5  # of the jpg pictures, and of the size of all
GIVEN = "given depth"
WAYS = {
    GIVEN: "png, depth of the folder",
    "png": "png, `depth`",
    "jpg": f"jpg of quality {QUALITY}, `depth`",
    "mp4": "video, left above right, `depth`",
}
RUN = (("own", 2), ("lossless", 2), ("ssim", 4))  # measured in every run, and the decimals in the table
INPUT = (("pictures", 1), ("depth_mm", 1), ("coverage", 2))  # the same for every seed


def rectified_pair(clip: Path) -> tuple[Camera, float]:
    """The left camera, and the distance of the cameras in mm that fits the given depth."""
    import endotsr
    from endotsr.results.evaluation.right_view import stereo_baseline

    sequence = endotsr.load_sequence(clip)
    right = sorted((clip / "images_right").iterdir())
    found = stereo_baseline(sequence, lambda i: read_png(right[i]).transpose(2, 0, 1))
    if found is None:
        raise InputError(f"{clip}: left and right pictures have too few common pixels with depth")
    return sequence.cameras[0], found[0]


def recordings(clip: Path, root: Path) -> dict[str, Path]:
    """The clip as jpg pictures and as one stacked video."""
    import cv2

    pairs = list(zip(*(sorted((clip / side).iterdir()) for side in ("images", "images_right")), strict=True))
    video: Any = None
    for side in ("left", "right"):
        (root / "jpg" / side).mkdir(parents=True)
    for i, names in enumerate(pairs):
        left, right = (np.asarray(cv2.imread(str(name))) for name in names)
        for side, picture in (("left", left), ("right", right)):
            cv2.imwrite(str(root / "jpg" / side / f"{i:06d}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        stacked = np.concatenate([left, right])
        size = stacked.shape[1::-1]
        video = video or cv2.VideoWriter(str(root / "clip.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 15.0, size)
        video.write(stacked)
    video.release()
    return {"jpg": root / "jpg", "mp4": root / "clip.mp4"}


def prepared(clip: Path, root: Path) -> dict[str, Path]:
    """The common format of every route."""
    camera, baseline = rectified_pair(clip)
    intrinsics: list[object] = [camera.fx, camera.fy, camera.cx, camera.cy]
    common: list[object] = ["--scale", SCALE, "--baseline", f"{baseline:.4f}"]
    made = recordings(clip, root)
    sources: dict[str, list[object]] = {
        GIVEN: [clip],
        "png": [clip],
        "jpg": [made["jpg"], "--camera", *intrinsics, "--masks", clip / "masks"],
        "mp4": [made["mp4"], "--stereo", "stacked", "--camera", *intrinsics, "--masks", clip / "masks"],
    }
    for way, words in sources.items():
        said("prepare", *words, "--out", root / "clips" / way, *common)
        if way != GIVEN:
            said("depth", root / "clips" / way, "--replace")
    return {way: root / "clips" / way for way in sources}


def of_run(way: str, seed: int, clips: dict[str, Path], iterations: int) -> dict[str, float]:
    """Train one run, and measure it."""
    with tempfile.TemporaryDirectory() as scratch:
        run, report = Path(scratch) / "run", Path(scratch) / "report.json"
        words = ["--preset", "sharp", "--iterations", iterations, "--seed", seed]
        said("train", clips[way], "--out", run, *words)
        said("render", run, "--frames", "test", "--out", Path(scratch) / "renders")
        said("evaluate", "--pictures", Path(scratch) / "renders" / "colour", "--sequence", clips[GIVEN],
             "--json", report)  # fmt: skip
        own, against = held_out(run), held_out(report)
    return {"own": own["psnr_tissue"], "lossless": against["psnr_tissue"], "ssim": against["ssim_tissue"]}


def about_input(clips: dict[str, Path], way: str) -> dict[str, float]:
    """Pictures against the lossless ones, and depth against the given one on tissue."""
    if way == GIVEN:
        return {}
    given = describe(clips[GIVEN]).depth
    assert given is not None
    loss = video_psnr(clips[GIVEN], clips[way])
    return depth_error(clips[way], given) | ({"pictures": loss} if np.isfinite(loss) else {})


def table(result: dict[str, Any]) -> str:
    """One row per route."""
    rows = []
    for way, found in result["ways"].items():
        rows.append([WAYS[way], *means(found["runs"], RUN), *means([found["input"]], INPUT)])
    head = ["Way", "PSNR tissue, dB", "against the lossless pictures, dB", "SSIM tissue, as well",
            "PSNR of the prepared pictures, dB", "depth from the given one, mm", "coverage of the tissue"]  # fmt: skip
    about = (
        f"`{result['clip']}` at half size, preset `sharp`, {result['iterations']} iterations, {result['seeds']} seeds,"
        f" mean ± 95 % interval; {where(result)}."
    )
    return noted(head, rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every route with every seed."""
    runs = [(way, seed) for seed in range(options.seeds) for way in WAYS]
    about = {"iterations": options.iterations, "sources": kept.sources("")}
    with tempfile.TemporaryDirectory() as root:
        clips = prepared(options.clip, Path(root))
        train = lambda *run: of_run(*run, clips=clips, iterations=options.iterations)
        found = kept.nested(kept.measured(options.record, about, runs, train))
        ways = {way: {"input": about_input(clips, way), "runs": found[way]} for way in WAYS}
    clip = options.clip.resolve().name
    return {"clip": clip, "seeds": options.seeds, "iterations": options.iterations, "ways": ways}


PROGRAM = Program(
    __name__, "guides/checks.md", {"ways": table}, "own_pictures.json", measured,
    {"clip": CLIP, "--seeds": 3, "--iterations": 1500},
)  # fmt: skip
