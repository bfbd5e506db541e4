"""Train on simulated hand-held clips with true, estimated and no poses, over seeds, and write the table.

    python docs/make.py recordings.hand_held_training [--seeds 3] [--jobs 1]
    python docs/make.py recordings.hand_held_training --so-far    write what an unfinished measurement has
    python docs/make.py recordings.hand_held_training --table     rewrite the table of the last result

The clips are those of `recordings.hand_held` with rigid and with breathing tissue. Estimated poses come from
`endotsr poses`, which sees the held-out pictures too, as any program that estimates a trajectory does. *None* is a
static camera. The preset is `quick` at its full length; a seed sets scene and training. Finished runs are kept, and a
stopped command continues. The result is docs/results/hand_held_training.json; the table is in docs/guides/prepare.md.
"""

import argparse
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

from endotsr.clips.sequences.sequence import Sequence
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.recordings.hand_held import CYCLES, FRAMES, SEEN, SHIFT, SMALL, simulated
from pages.store import kept
from pages.store.intervals import shown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "hand_held_training.json", DOCS / "guides" / "prepare.md"
SCENES, PRESET = ("rigid", "breathing"), "quick"
POSES = ("true", "estimated", "none", "estimated and corrected")
BASELINES = {"nearest_frame": "copy of the nearest frame", "flow_interpolation": "flow between two frames"}


def with_poses(sequence: Sequence, poses: str) -> Sequence:
    """The clip with one of `POSES`."""
    import endotsr

    if poses == "true":
        return sequence
    if poses == "none":
        return replace(sequence, cameras=[sequence.cameras[0]] * sequence.count, static_camera=True)
    return endotsr.estimate_poses(sequence)


def measured(key: str, runs: dict[str, tuple[str, str, int]]) -> dict[str, Any]:
    """Train one run (scene, poses, seed); its held-out metrics and those of its simplest baselines."""
    import endotsr

    scene, poses, seed = runs[key]
    print(key, flush=True)
    shown_clip = with_poses(simulated(scene, SMALL, seed), poses)
    corrected: dict[str, Any] = {"model": {"pose_correction": True}} if poses == POSES[3] else {}
    run = endotsr.train(shown_clip, endotsr.make_config(PRESET, training={"seed": seed}, **corrected))
    result = run.evaluate()
    row = result["held_out"]["mean"]
    baselines = {name: found["mean"]["psnr_tissue"] for name, found in result["baselines"].items()}
    return {"psnr_tissue": row["psnr_tissue"], "ssim_full": row["ssim_full"], "baselines": baselines}


def table(result: dict[str, Any]) -> str:
    """One row per scene and poses, then the predictions without a model."""
    rows, answers = [], result["answers"]
    for scene in SCENES:
        by_poses = {
            poses: [answers[key] for seed in range(result["seeds"])
                    if (key := f"{scene}, {poses}, seed {seed}") in answers]
            for poses in POSES
        }  # fmt: skip
        for poses, runs in by_poses.items():
            if runs:
                cells = [shown([run[name] for run in runs], digits) for name, digits in COLUMNS]
                rows.append([scene, poses, *cells, str(len(runs))])
        some = next((runs for runs in by_poses.values() if runs), [])
        for name in BASELINES if some else ():
            values = [run["baselines"][name] for run in some]
            rows.append([scene, f"*{BASELINES[name]}*", shown(values, 2), "-", str(len(some))])
    about = (
        f"Preset `{PRESET}` at full length, {FRAMES} frames of {SMALL[0]}x{SMALL[1]}; mean ± 95 % interval over the"
        f" seeds; {result['machine']['processor']}, {result['date']}."
    )
    return markdown(["Tissue", "Poses", "held-out PSNR tissue, dB", "SSIM full", "seeds"], rows) + "\n\n" + about


COLUMNS = (("psnr_tissue", 2), ("ssim_full", 4))


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time; the numbers do not depend on it")
    parser.add_argument("--so-far", action="store_true")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    if not options.table:
        first, then = POSES[:3], POSES[3:]
        rows = [
            (scene, poses, seed)
            for part in (first, then) for seed in range(options.seeds) for scene in SCENES for poses in part
        ]  # fmt: skip
        runs = {f"{scene}, {poses}, seed {seed}": (scene, poses, seed) for scene, poses, seed in rows}
        about = {
            "sources": kept.sources("training", "clips/poses"), "preset": PRESET, "frames": FRAMES, "size": SMALL,
            "shift": SHIFT, "cycles": CYCLES, "seen": SEEN,
        }  # fmt: skip
        answers = kept.measured(FILE, about, [] if options.so_far else runs, partial(measured, runs=runs), options.jobs)
        found = {"seeds": options.seeds, "date": date.today().isoformat(), "machine": machine()}
        write_json(FILE, found | {"answers": answers})
        if not options.so_far:
            kept.finished(FILE)
    made = {"training": table(read_json(FILE, "docs/pages/recordings/hand_held_training.py"))}
    write_marked(PAGE, made, "hand_held_training")
