"""From the video of a scope in a hand to a scene, with nothing else at hand: four commands and a guessed angle.

    python docs/make.py recordings.scope_video [--data ../shared/data/sinus_endoscopy] [--seeds 3]
    python docs/make.py recordings.scope_video --table    rewrite the table of the last result

The pictures of `sinus_endoscopy` become an H.264 video of 640x360; its poses, intrinsics, points and mask are not used.
`prepare --field-of-view`, `poses --sfm` and `train --preset quick` follow. By the intrinsics
of the clip, the angle is 110 degrees. Finished runs are kept. The result is docs/results/scope_video.json; the table is
in docs/guides/prepare.md.
"""

import argparse
import json
import tempfile
from datetime import date
from pathlib import Path
from typing import Any

from endotsr.clips.opencv import area_resize
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.film_file import write_video
from endotsr.clips.sequences.sequence_file import read_sequence_file
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.recordings.any_clip import said
from pages.store import kept
from pages.store.intervals import shown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "scope_video.json", DOCS / "guides" / "prepare.md"
SIZE, RATE = (640, 360), 15.0
GUESSED = 100  # degrees; the angle with all seeds
ANGLES = (GUESSED, 80, 110, 130)
BASELINES = {
    "nearest_frame": "copy of the nearest frame",
    "two_neighbours_tissue": "mean of the two neighbours",
    "flow_interpolation_tissue": "flow between the two neighbours",
}


def video_of(data: Path, place: Path) -> Path:
    """The pictures as a video."""
    pictures = (area_resize(read_picture(file), *SIZE) for file in sorted((data / "images").iterdir()))
    write_video(place / "scope.mp4", pictures, RATE)
    return place / "scope.mp4"


def measured(key: str, runs: dict[str, tuple[int, int]], data: Path) -> dict[str, Any]:
    """PSNR of held-out tissue of one run and of the predictions without a model, dB, and the excluded border."""
    angle, seed = runs[key]
    with tempfile.TemporaryDirectory() as root:
        clip, run = Path(root) / "clip", Path(root) / "run"
        said("prepare", video_of(data, Path(root)), "--out", clip, "--field-of-view", angle)
        said("poses", clip, "--sfm")
        said("train", clip, "--preset", "quick", "--out", run, "--seed", seed)
        metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
        masks = read_sequence_file(clip).masks
    found = {name: metrics["baselines"][name]["mean"]["psnr_tissue"] for name in BASELINES}
    return {"psnr": metrics["held_out"]["mean"]["psnr_tissue"], "origin": masks.origin if masks else "", **found}


def plan(seeds: int) -> dict[str, tuple[int, int]]:
    """Angle and seed of every run."""
    wanted = [(angle, seed) for angle in ANGLES for seed in range(seeds if angle == GUESSED else 1)]
    return {f"{angle} degrees, seed {seed}": (angle, seed) for angle, seed in wanted}


def table(result: dict[str, Any]) -> str:
    """A row for each angle, and the predictions without a model."""
    runs = plan(result["seeds"])
    rows = []
    for angle in ANGLES:
        values = [result["answers"][key]["psnr"] for key, (of, _) in runs.items() if of == angle]
        rows.append([f"`quick`, {angle} degrees", str(len(values)), shown(values, 2)])
    first = result["answers"][next(iter(runs))]
    rows += [[label, "-", f"{first[name]:.2f}"] for name, label in BASELINES.items()]
    about = (
        f"`sinus_endoscopy` as a video of {SIZE[0]}x{SIZE[1]}, 35 frames, 5 of them held out; excluded:"
        f" {first['origin']}. By its intrinsics the angle is 110 degrees."
        f" {result['machine']['processor']}, {result['date']}."
    )
    return markdown(["Held-out frames", "seeds", "PSNR tissue, dB"], rows) + "\n\n" + about


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=DOCS.parents[1] / "shared" / "data" / "sinus_endoscopy")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    if not options.table:
        runs = plan(options.seeds)
        about = {"sources": kept.sources("method", "training", "clips"), "size": SIZE}
        answers = kept.measured(FILE, about, runs, lambda key: measured(key, runs, options.data))
        result = {"seeds": options.seeds, "answers": answers, "date": date.today().isoformat(), "machine": machine()}
        write_json(FILE, result)
        kept.finished(FILE)
    made = {"table": table(read_json(FILE, "python docs/make.py recordings.scope_video"))}
    write_marked(PAGE, made, "scope_video")
