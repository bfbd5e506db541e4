"""Train on simulated hand-held clips with true, estimated and no poses, over seeds, and write the table.

    python docs/make.py recordings.hand_held_training measure [--seeds 3] [--jobs 1] [--poses NAME]

The clips are those of `recordings.hand_held` with rigid and with breathing tissue. Estimated poses come from `endotsr
poses`, which sees the held-out pictures too, as any program that estimates a trajectory does. *None* is a static
camera. The preset is `quick` at its full length; a seed sets scene and training. `FURTHER` starts with more points
where later frames show what the first one does not. Finished runs are kept, and a stopped command continues; --poses
measures one kind and keeps the other rows of the record.
"""

import argparse
from dataclasses import replace
from typing import Any

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import PRESETS
from pages.recordings.hand_held_clips import CYCLES, FRAMES, SEEN, SHIFT, SMALL, simulated
from pages.store import kept
from pages.store.commands import loaded
from pages.store.intervals import shown
from pages.store.program import Program
from pages.store.tables import means, noted, where

SCENES, PRESET = ("rigid", "breathing"), "quick"
FURTHER = "true, four times as many points from later frames"
POSES = ("true", "estimated", "none", "estimated and corrected", FURTHER)
BASELINES = {"nearest_frame": "copy of the nearest frame", "flow_interpolation": "flow between two frames"}
COLUMNS = (("psnr_tissue", 2), ("ssim_full", 4))


def with_poses(sequence: Sequence, poses: str) -> Sequence:
    """The clip with one of `POSES`."""
    import endotsr

    if poses in ("true", FURTHER):
        return sequence
    if poses == "none":
        return replace(sequence, cameras=[sequence.cameras[0]] * sequence.count, static_camera=True)
    return endotsr.estimate_poses(sequence)


def of_run(scene: str, poses: str, seed: int) -> dict[str, Any]:
    """Train one run; its held-out metrics and those of its simplest baselines."""
    import endotsr

    shown_clip = with_poses(simulated(scene, SMALL, seed), poses)
    more: dict[str, Any] = {"model": {"pose_correction": True}} if poses == POSES[3] else {}
    if poses == FURTHER:
        more = {"initialisation": {"other_frame_points": 4 * PRESETS[PRESET].initialisation.other_frame_points}}
    run = endotsr.train(shown_clip, endotsr.make_config(PRESET, training={"seed": seed}, **more))
    result = run.evaluate()
    row = result["held_out"]["mean"]
    baselines = {name: found["mean"]["psnr_tissue"] for name, found in result["baselines"].items()}
    return {"psnr_tissue": row["psnr_tissue"], "ssim_full": row["ssim_full"], "baselines": baselines}


def table(result: dict[str, Any]) -> str:
    """One row per scene and poses, then the predictions without a model."""
    rows, answers = [], result["answers"]
    for scene in SCENES:
        keys = {poses: [kept.key_of((scene, poses, seed)) for seed in range(result["seeds"])] for poses in POSES}
        by_poses = {poses: [answers[key] for key in names if key in answers] for poses, names in keys.items()}
        for poses, runs in by_poses.items():
            if runs:
                rows.append([scene, poses, *means(runs, COLUMNS), str(len(runs))])
        some = next((runs for runs in by_poses.values() if runs), [])
        for name in BASELINES if some else ():
            values = [run["baselines"][name] for run in some]
            rows.append([scene, f"*{BASELINES[name]}*", shown(values, 2), "-", str(len(some))])
    about = (
        f"Preset `{PRESET}` at full length, {FRAMES} frames of {SMALL[0]}x{SMALL[1]}; mean ± 95 % interval over the"
        f" seeds; {where(result)}."
    )
    return noted(["Tissue", "Poses", "held-out PSNR tissue, dB", "SSIM full", "seeds"], rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every run, those with corrected poses last."""
    seeds = range(options.seeds)
    kinds = ((options.poses,),) if options.poses else (POSES[:3], POSES[3:])
    runs = [(scene, poses, seed) for of in kinds for seed in seeds for scene in SCENES for poses in of]
    about = {
        "sources": kept.sources("training", "clips/poses"), "preset": PRESET, "frames": FRAMES, "size": SMALL,
        "shift": SHIFT, "cycles": CYCLES, "seen": SEEN,
    }  # fmt: skip
    answers = kept.measured(options.record, about, runs, of_run, options.jobs)
    known = loaded(options.record)["answers"] if options.poses else {}
    return {"seeds": options.seeds, "answers": known | {kept.key_of(run): answer for run, answer in answers.items()}}


PROGRAM = Program(
    __name__, "guides/poses.md", {"training": table}, "hand_held_training.json", measured,
    {"--seeds": 3, "--jobs": 1, "--poses": {"choices": POSES, "help": "one kind (default: all)"}},
)  # fmt: skip
