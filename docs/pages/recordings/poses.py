"""Train with disturbed poses, with and without their correction (B16), over seeds, and write the table.

    python docs/make.py recordings.poses measure [CLIP ...] [--seeds 3] [--jobs 2]

Two simulated scenes have a moving camera; in one of them the tissue also breathes. Their poses are disturbed by a
smooth error of some pixels, like the error of a tracking program. The pose error is the distance in pixels of points of
the surface, after the best common motion and scale of all cameras. A CLIP is a sequence folder with a pose for each
frame, which is used unchanged. Finished runs are kept, and a stopped command continues.
"""

import argparse
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import DEMO, with_settings
from endotsr.method.equations.pose import pose_forward
from endotsr.method.splatting.camera import Camera, backproject, project
from pages.store import kept
from pages.store.program import CLIPS, Program
from pages.store.tables import means, noted, where

SIZE, FRAMES, ITERATIONS, CLIP_ITERATIONS = (160, 128), 24, 800, 1000
SWING, BREATH = 8.0, 1.0  # mm, of the camera and of the tissue
ERROR = (0.006, 0.3)  # rad and mm, of one sine of the disturbance; there are three
STEP = 16  # pixels between the points at which the error is measured
SCENES = {"a rigid scene": (), "breathing tissue": ("breathing",)}
MOVING, RIGID = "`paper`", "`paper`, no deformation"
SETTINGS: dict[str, dict[str, Any]] = {MOVING: {}, RIGID: {"deformation": False}}
POSES = ("true", "disturbed", "corrected")


def scene_of(name: str, seed: int) -> Sequence:
    """A simulated scene with its true poses."""
    from endotsr.clips.simulator.simulate import simulate
    from pages.effects.study import settings_of

    found = settings_of(("noise", *SCENES[name], "camera_motion"), seed, FRAMES, SWING)
    size = {"width": SIZE[0], "height": SIZE[1]}
    return simulate(with_settings(found, breathing={"amplitude": BREATH}, **size)).sequence


def disturbed(sequence: Sequence, seed: int) -> Sequence:
    """The same pictures with a smooth error of the poses."""
    rng, t = np.random.default_rng(seed), sequence.times

    def smooth(size: float) -> np.ndarray:
        waves = [np.sin(2 * np.pi * (k * t + rng.random((3, 1)))) * rng.normal(size=(3, 1)) for k in (1, 2, 3)]
        return size * np.sum(waves, axis=0) / np.sqrt(1.5)

    errors = zip(*(smooth(size).T for size in ERROR), strict=True)
    poses = [pose_forward(c.rotation, c.translation, *e)[:2] for c, e in zip(sequence.cameras, errors, strict=True)]
    moved = zip(sequence.cameras, poses, strict=True)
    return replace(sequence, cameras=[c._replace(rotation=w, translation=d) for c, (w, d) in moved])


def pose_error(cameras: list[Camera], sequence: Sequence) -> float:
    """Root mean square distance in pixels from the true projections, after the best common motion and scale."""
    from scipy.optimize import least_squares

    row, column = (a.ravel() for a in np.mgrid[STEP // 2 : sequence.height : STEP, STEP // 2 : sequence.width : STEP])
    depth = sequence.depth[0][row, column].astype(float)
    seen = depth > 0
    points = backproject(sequence.cameras[0], column[seen].astype(float), row[seen].astype(float), depth[seen])
    middle = points.mean(axis=1, keepdims=True)
    wanted = [np.stack(project(camera, points)[:2]) for camera in sequence.cameras]

    def apart(common: np.ndarray) -> np.ndarray:
        turned, _, _ = pose_forward(np.eye(3), np.zeros(3), common[:3], np.zeros(3))
        moved = turned @ (points - middle) * np.exp(common[6]) + middle + common[3:6, None]
        return np.ravel([np.stack(project(c, moved)[:2]) - w for c, w in zip(cameras, wanted, strict=True)])

    return float(np.sqrt(2 * np.mean(least_squares(apart, np.zeros(7)).fun ** 2)))


def of_run(scene: str, label: str, poses: str, seed: int, clips: dict[str, str]) -> dict[str, float | None]:
    """Train one run (scene, row of `SETTINGS`, one of `POSES`, seed) and measure it."""
    import endotsr
    from endotsr.training.fitting.model import corrected_cameras

    given = endotsr.load_sequence(clips[scene]) if scene in clips else scene_of(scene, seed)
    shown = disturbed(given, seed) if scene in SCENES and poses != "true" else given
    sections: dict[str, Any] = {
        "model": {"pose_correction": poses == "corrected"} | SETTINGS[label],
        "training": {"seed": seed},
    }
    if scene in SCENES:
        points = ("first_frame_points", "other_frame_points")
        sections["initialisation"] = {name: getattr(DEMO.initialisation, name) for name in points}
        sections["density"] = {"gradient_threshold": DEMO.density.gradient_threshold}
    length = ITERATIONS if scene in SCENES else CLIP_ITERATIONS
    config = endotsr.make_config("paper", iterations=length, **sections)
    run = endotsr.train(shown, config, on_message=lambda text: None)
    found: dict[str, float | None] = {"psnr_tissue": run.evaluate()["held_out"]["mean"]["psnr_tissue"]}
    if scene in SCENES:
        cameras = corrected_cameras(run.model.frames, shown.cameras, shown.times)
        found["pixels"] = pose_error(cameras, given)
    return found


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Scene -> settings -> poses -> numbers of the runs in the order of their seeds."""
    clips = {folder.name: str(folder.resolve()) for folder in options.clips}
    rows = [
        (scene, label, poses)
        for scene in (*SCENES, *clips)
        for label in (SETTINGS if SCENES.get(scene) == () else (MOVING,))
        for poses in (POSES if scene in SCENES else POSES[1:])
    ]
    runs = [(*row, seed) for seed in range(options.seeds) for row in rows]
    about = {
        "sources": kept.sources("", beside=("effects/study",)),
        "size": SIZE, "frames": FRAMES, "iterations": (ITERATIONS, CLIP_ITERATIONS),
        "swing": SWING, "breath": BREATH, "error": ERROR, "step": STEP, "settings": SETTINGS, "scenes": SCENES,
    }  # fmt: skip
    answers = kept.measured(options.record, about, runs, partial(of_run, clips=clips), options.jobs)
    return {"seeds": options.seeds, "scenes": kept.nested(answers)}


def table(result: dict[str, Any]) -> str:
    """One row per settings and poses."""
    rows = []
    for scene, variants in result["scenes"].items():
        for label, by_poses in variants.items():
            for poses, runs in by_poses.items():
                named = "given" if poses == "disturbed" and scene not in SCENES else poses
                rows.append([scene, label, named, *means(runs, (("pixels", 2), ("psnr_tissue", 2)))])
    about = (
        f"Mean ± 95 % interval over {result['seeds']} seeds, {ITERATIONS} iterations (a clip: {CLIP_ITERATIONS});"
        f" {where(result)}."
    )
    head = ["Scene", "Settings", "Poses", "error of the poses, px", "held-out PSNR tissue, dB"]
    return noted(head, rows, about)


PROGRAM = Program(
    __name__, "guides/poses.md", {"table": table}, "poses.json", measured,
    {"clips": CLIPS, "--seeds": 3, "--jobs": 2},
)  # fmt: skip
