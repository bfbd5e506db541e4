"""Train one window of a simulated recording for several numbers of iterations, and write the table of the guide.

    python docs/make.py recordings.window_length measure [--seeds 3]      about a minute a run

The recording is that of `recordings.windows measure recording`: 240 frames of 160x128. The window is its first 48
frames. Finished runs are kept, and a stopped command continues.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any

import endotsr
from pages.recordings.windows import Steps, recorded_clip
from pages.store import kept
from pages.store.intervals import shown
from pages.store.program import Program
from pages.store.tables import noted, where

FRAMES, SIZE, WINDOW, PRESET = 240, "160x128", 48, "demo"
LENGTHS = (600, 1500, 3000)  # iterations
SPLITS = {"every_eighth": "Every eighth", "blocks": "Blocks of 8"}
BASELINES = {
    "nearest_frame": "*copy of the nearest training frame*",
    "two_neighbours": "*blend*",
    "flow_interpolation": "*flow*",
}


def of_run(clip: Path, split: str, iterations: int, seed: int) -> dict[str, Any]:
    """Tissue PSNR of one training on its training frames, on the held-out ones, and of the baselines there, dB."""
    sequence = endotsr.load_sequence(clip, preset=PRESET, frames=f"0:{WINDOW}", split=split)
    settings = {"seed": seed, "visits_per_frame": 0}
    run = endotsr.train(sequence, preset=PRESET, iterations=iterations, training=settings, on_message=lambda text: None)
    found = run.evaluate()
    return {
        "iterations": run.iteration,
        "training_frames": len(sequence.train_index),
        "training": found["training"]["mean"]["psnr_tissue"],
        "held_out": found["held_out"]["mean"]["psnr_tissue"],
        "baselines": {name: found["baselines"][name]["mean"]["psnr_tissue"] for name in BASELINES},
    }


def table(result: dict[str, Any]) -> str:
    """One row per number of iterations, and one per baseline."""
    runs = result["runs"]
    eighth = runs["every_eighth"]
    rows = []
    for length in LENGTHS:
        per_frame = length / eighth[str(length)][0]["training_frames"]
        training = shown([run["training"] for run in eighth[str(length)]], 2)
        held_out = [shown([run["held_out"] for run in runs[split][str(length)]], 2) for split in SPLITS]
        rows.append([f"{length} ({per_frame:.0f})", training, *held_out])
    for name, label in BASELINES.items():
        values = [runs[split][str(LENGTHS[0])][0]["baselines"][name] for split in SPLITS]
        rows.append([label, "", *(f"{value:.2f}" for value in values)])
    seeds = len(eighth[str(LENGTHS[0])])
    about = (
        f"Tissue PSNR in dB, one window of {WINDOW} frames of the simulated recording below ({SIZE}, preset"
        f" `{PRESET}`), mean ± 95 % interval over {seeds} seeds; iterations per frame and training frames of the first"
        f" split; {where(result)}."
    )
    return noted(["Iterations (per frame)", "Training frames", *SPLITS.values()], rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Split -> iterations -> numbers of the runs in the order of their seeds."""
    runs = [(split, str(length), seed) for seed in range(options.seeds) for split in SPLITS for length in LENGTHS]
    about = {"sources": kept.sources("method", "training", "clips/simulator"), "window": WINDOW, "preset": PRESET}
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        recorded_clip(Steps(folder), folder, FRAMES, SIZE)
        clip = folder / "clip"
        measure = lambda split, length, seed: of_run(clip, split, int(length), seed)
        answers = kept.measured(options.record, about, runs, measure)
    return {"runs": kept.nested(answers)}


PROGRAM = Program(
    __name__, "guides/recording.md", {"table": table}, "window_length.json", measured,
    {"--seeds": 3, "--keep": {"type": Path, "help": "folder for what is made (default: a temporary one)"}},
)  # fmt: skip
