"""Train on a clip from its own stereo pictures, as png, jpg and video, without its depth, and write the table.

    python docs/make.py recordings.own_pictures CLIP [--seeds 3] [--iterations 1500]
    python docs/make.py recordings.own_pictures --table    rewrite the table of the last result

CLIP is a folder in the layout of EndoNeRF with right pictures. All routes use `prepare` at half size. The first route
keeps the depth of the folder; the others compute it by `depth` from the pictures. The distance of the cameras is fitted
once to the given depth. The renders of every route are also compared with the lossless pictures. The result is
docs/results/own_pictures.json; the table is in docs/guides/prepare.md.
"""

import argparse
import json
import tempfile
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv import read_png
from endotsr.clips.sequences.layouts import describe
from endotsr.method.splatting.camera import Camera
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.recordings.any_clip import depth_error, said, video_psnr
from pages.store import kept
from pages.store.intervals import shown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "own_pictures.json", DOCS / "guides" / "prepare.md"
QUALITY = 90  # of the jpg pictures
SCALE = 0.5
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
        raise SystemExit(f"{clip}: left and right pictures have too few common pixels with depth")
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


def measured(key: str, clips: dict[str, Path], iterations: int) -> dict[str, float]:
    """Train one run "way, seed n", and measure it."""
    way, _, seed = key.partition(", seed ")
    clean = clips[GIVEN]
    with tempfile.TemporaryDirectory() as scratch:
        run, report = Path(scratch) / "run", Path(scratch) / "report.json"
        words = ["--preset", "sharp", "--iterations", iterations, "--seed", seed]
        said("train", clips[way], "--out", run, *words)
        said("render", run, "--frames", "test", "--out", Path(scratch) / "renders")
        said("evaluate", "--pictures", Path(scratch) / "renders" / "colour", "--sequence", clean, "--json", report)
        own = json.loads((run / "metrics.json").read_text(encoding="utf-8"))["held_out"]["mean"]
        against = json.loads(report.read_text(encoding="utf-8"))["held_out"]["mean"]
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
        runs = [[run[key] for run in found["runs"]] for key, _ in RUN]
        inputs = [[found["input"][key]] if key in found["input"] else [] for key, _ in INPUT]
        digits = [digits for _, digits in RUN + INPUT]
        rows.append([WAYS[way], *map(shown, runs + inputs, digits)])
    head = ["Way", "PSNR tissue, dB", "against the lossless pictures, dB", "SSIM tissue, as well",
            "PSNR of the prepared pictures, dB", "depth from the given one, mm", "coverage of the tissue"]  # fmt: skip
    about = (
        f"`{result['clip']}` at half size, preset `sharp`, {result['iterations']} iterations, {result['seeds']} seeds,"
        f" mean ± 95 % interval; {result['machine']['processor']}, {result['date']}."
    )
    return markdown(head, rows) + "\n\n" + about


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("clip", type=Path, nargs="?", metavar="CLIP")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=1500)
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    if not options.table:
        if options.clip is None:
            parser.error("CLIP is needed")
        keys = [f"{way}, seed {seed}" for seed in range(options.seeds) for way in WAYS]
        about = {"clip": options.clip.resolve().name, "seeds": options.seeds, "iterations": options.iterations}
        with tempfile.TemporaryDirectory() as root:
            clips = prepared(options.clip, Path(root))
            sources = {"iterations": options.iterations, "sources": kept.sources("")}
            found = kept.measured(FILE, sources, keys, lambda key: measured(key, clips, options.iterations))
            inputs = {way: about_input(clips, way) for way in WAYS}
        seeds = range(options.seeds)
        runs = {way: [found[f"{way}, seed {seed}"] for seed in seeds] for way in WAYS}
        ways = {way: {"input": inputs[way], "runs": runs[way]} for way in WAYS}
        write_json(FILE, about | {"date": date.today().isoformat(), "machine": machine(), "ways": ways})
        kept.finished(FILE)
    write_marked(PAGE, {"ways": table(read_json(FILE, "docs/pages/recordings/own_pictures.py CLIP"))}, "own_pictures")
