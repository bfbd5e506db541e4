"""The part of the motion of tissue that no method can tell from motion of the scope, on the simulated hand-held clips.

    python docs/make.py recordings.pose_ambiguity measure [--seeds 3]

Every frame gets the rigid motion that fits the true motion of the tissue in it best, by least squares from the mean
position of each point over the clip. Registration without any error of its own counts this motion as that of the scope:
the pose of the camera becomes that of the camera after the motion, and the table has its error.
"""

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.poses.views import compose
from endotsr.method.splatting.camera import CameraPose
from pages.recordings.hand_held_clips import FRAMES, KINDS, SMALL, with_truth
from pages.recordings.path_errors import path_errors
from pages.store.intervals import shown
from pages.store.program import Program
from pages.store.tables import means, noted

EVERY = 8  # px between the points
HEADS = ("Tissue", "motion of the tissue, mm", "error of a perfect registration, mm", "of the path", "left by it, mm")


def rigid(rest: NDArray[np.floating], now: NDArray[np.floating]) -> CameraPose:
    """The rotation and translation with the least squared distance of R rest + d from now, both (3, n)."""
    from scipy.spatial.transform import Rotation

    a, b = rest.mean(axis=1), now.mean(axis=1)
    turn = Rotation.align_vectors((now - b[:, None]).T, (rest - a[:, None]).T)[0].as_matrix()
    return CameraPose(turn, b - turn @ a)


def of_clip(kind: str, seed: int) -> dict[str, Any]:
    """The error of the path that contains the rigid part of the motion, RMS."""
    clip = with_truth(kind, SMALL, seed)
    sequence, poses, moved, left = clip.sequence, [], [], []
    true = [CameraPose(camera.rotation, camera.translation) for camera in sequence.cameras]
    for k, pose in enumerate(true):
        material = clip.truth.material_coordinates[k][:, ::EVERY, ::EVERY].reshape(2, -1)
        material = material[:, np.isfinite(material).all(axis=0)]
        rest = np.mean([clip.surface_point(material, float(t)) for t in sequence.times], axis=0)
        now = clip.surface_point(material, float(sequence.times[k]))
        motion = rigid(rest, now)
        poses.append(compose(pose, motion))
        moved.append(np.square(now - rest).sum(axis=0).mean())
        left.append(np.square(now - motion.rotation @ rest - motion.translation[:, None]).sum(axis=0).mean())
    found = path_errors(poses, true, False)
    return {"tissue": kind, "seed": seed, "moved": np.sqrt(np.mean(moved)), "left": np.sqrt(np.mean(left)), **found}


def table(result: dict[str, Any]) -> str:
    """Means over the seeds."""
    rows = []
    for kind in dict.fromkeys(row["tissue"] for row in result["rows"]):
        runs = [row for row in result["rows"] if row["tissue"] == kind]
        moved, error, left = means(runs, (("moved", 2), ("error", 3), ("left", 2)))
        rows.append([kind, moved, error, f"{shown([100 * run['of_path'] for run in runs], 2)} %", left])
    about = f"{FRAMES} frames of {SMALL[0]}x{SMALL[1]}; mean ± 95 % interval over {result['seeds']} seeds"
    return noted(HEADS, rows, f"{about} of the simulator. {result['date'][:10]}.")


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every kind of clip whose tissue moves."""
    kinds = [kind for kind in KINDS if kind.startswith("breathing")]
    return {"seeds": options.seeds, "rows": [of_clip(kind, seed) for kind in kinds for seed in range(options.seeds)]}


PROGRAM = Program(
    __name__, "guides/poses.md", {"table": table}, "pose_ambiguity.json", measured, {"--seeds": 3},
)  # fmt: skip
