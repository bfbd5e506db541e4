"""The error of poses with and without returns, on simulated clips whose camera goes far and comes back.

    python docs/make.py recordings.pose_returns measure [--seeds 3]

A hand-held camera moves over rigid or breathing tissue, farther than one picture shows. Depth is in whole millimetres.
"""

import argparse
import time
from typing import Any

from endotsr.method.splatting.camera import CameraPose
from pages.recordings.hand_held_clips import SMALL, simulated
from pages.recordings.path_errors import path_errors
from pages.store.intervals import shown
from pages.store.program import Program
from pages.store.tables import means, noted, where

FRAMES, SHIFT, CYCLES = 200, 20.0, 1.5  # largest sideways shift in mm, and the rate of the path
TISSUE = ("rigid", "breathing")
WAYS = {"without returns": False, "with returns": True}


def of_clip(kind: str, seed: int) -> list[dict[str, Any]]:
    """Errors and processor time of both ways on one clip."""
    import cv2
    import numba

    from endotsr.clips.poses.estimate import estimated
    from endotsr.clips.poses.views import Views

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    clip = simulated(kind, SMALL, seed, FRAMES, SHIFT, CYCLES)
    true = [CameraPose(camera.rotation, camera.translation) for camera in clip.cameras]
    views, rows = Views(clip.images, clip.masks, clip.depth, clip.cameras[0]), []
    for name, with_returns in WAYS.items():
        begun = time.process_time()
        found = estimated(views, with_returns=with_returns)
        row = {"tissue": kind, "seed": seed, "way": name, "returns": len(found.returns)}
        row |= {"seconds": (time.process_time() - begun) / FRAMES, **path_errors(found.poses, true, False)}
        rows.append(row)
        print(row, flush=True)
    return rows


def table(result: dict[str, Any]) -> str:
    """Means over the seeds."""
    rows = []
    for kind in TISSUE:
        for way in WAYS:
            runs = [row for row in result["rows"] if (row["tissue"], row["way"]) == (kind, way)]
            error, *others = means(runs, (("error", 3), ("seconds", 3), ("returns", 0)))
            rows.append([kind, way, error, f"{shown([100 * run['of_path'] for run in runs], 2)} %", *others])
    head = ["Tissue", "`endotsr poses`", "error, mm", "of the path", "s per frame", "returns"]
    about = (
        f"{FRAMES} frames of {SMALL[0]}x{SMALL[1]}; mean ± 95 % interval over {result['seeds']} seeds of the simulator;"
        f" processor time on one thread of {where(result)}."
    )
    return noted(head, rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Both kinds of tissue with every seed."""
    rows = [row for seed in range(options.seeds) for kind in TISSUE for row in of_clip(kind, seed)]
    return {"seeds": options.seeds, "rows": rows}


PROGRAM = Program(
    __name__, "guides/poses.md", {"table": table}, "pose_returns.json", measured, {"--seeds": 3},
)  # fmt: skip
