"""From the video of a scope in a hand to a scene, with nothing else at hand: four commands and a guessed angle.

    python docs/make.py recordings.scope_video measure [--data ../shared/data/sinus_endoscopy] [--seeds 3]

The pictures of `sinus_endoscopy` become an H.264 video of 640x360; its poses, intrinsics, points and mask are not used.
`prepare --field-of-view`, `poses --sfm` and `train --preset quick` follow. By the intrinsics
of the clip, the angle is 110 degrees. Finished runs are kept.
"""

import argparse
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

from endotsr.clips.formats.film_file import write_video
from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.sequence_file import read_sequence_file
from pages.store import kept
from pages.store.commands import loaded, said
from pages.store.intervals import shown
from pages.store.program import DATA, Program
from pages.store.tables import noted, where

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


def of_run(angle: str, seed: int, data: Path) -> dict[str, Any]:
    """PSNR of held-out tissue of one run and of the predictions without a model, dB, and the excluded border."""
    with tempfile.TemporaryDirectory() as root:
        clip, run = Path(root) / "clip", Path(root) / "run"
        said("prepare", video_of(data, Path(root)), "--out", clip, "--field-of-view", angle.split()[0])
        said("poses", clip, "--sfm")
        said("train", clip, "--preset", "quick", "--out", run, "--seed", seed)
        metrics = loaded(run / "metrics.json")
        masks = read_sequence_file(clip).masks
    found = {name: metrics["baselines"][name]["mean"]["psnr_tissue"] for name in BASELINES}
    return {"psnr": metrics["held_out"]["mean"]["psnr_tissue"], "origin": masks.origin if masks else "", **found}


def plan(seeds: int) -> list[tuple[str, int]]:
    """Angle and seed of every run."""
    return [(f"{angle} degrees", seed) for angle in ANGLES for seed in range(seeds if angle == GUESSED else 1)]


def table(result: dict[str, Any]) -> str:
    """A row for each angle, and the predictions without a model."""
    found = kept.nested({run: result["answers"][kept.key_of(run)] for run in plan(result["seeds"])})
    rows = [[f"`quick`, {a}", str(len(of)), shown([run["psnr"] for run in of], 2)] for a, of in found.items()]
    first = next(iter(found.values()))[0]
    rows += [[label, "-", f"{first[name]:.2f}"] for name, label in BASELINES.items()]
    about = (
        f"`sinus_endoscopy` as a video of {SIZE[0]}x{SIZE[1]}, 35 frames, 5 of them held out; excluded:"
        f" {first['origin']}. By its intrinsics the angle is 110 degrees."
        f" {where(result)}."
    )
    return noted(["Held-out frames", "seeds", "PSNR tissue, dB"], rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every angle."""
    about = {"sources": kept.sources("method", "training", "clips"), "size": SIZE}
    answers = kept.measured(options.record, about, plan(options.seeds), partial(of_run, data=options.data))
    return {"seeds": options.seeds, "answers": {kept.key_of(run): answer for run, answer in answers.items()}}


PROGRAM = Program(
    __name__, "guides/poses.md", {"table": table}, "scope_video.json", measured,
    {"--data": DATA / "sinus_endoscopy", "--seeds": 3},
)  # fmt: skip
