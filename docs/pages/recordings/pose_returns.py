"""The error of poses with and without returns, on simulated clips whose camera goes far and comes back.

    python docs/make.py recordings.pose_returns [--seeds 3]
    python docs/make.py recordings.pose_returns --table     rewrite the table of the last result

A hand-held camera moves over rigid or breathing tissue, farther than one picture shows. Depth is in whole millimetres.
The result is docs/results/pose_returns.json; the table is in docs/guides/prepare.md.
"""

import argparse
import time
from datetime import date
from pathlib import Path
from typing import Any

from endotsr.method.splatting.camera import CameraPose
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.recordings.hand_held import SMALL, simulated
from pages.recordings.path_errors import path_errors
from pages.store.intervals import shown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "pose_returns.json", DOCS / "guides" / "prepare.md"
FRAMES, SHIFT, CYCLES = 200, 20.0, 1.5  # largest sideways shift in mm, and the rate of the path
TISSUE = ("rigid", "breathing")
WAYS = {"without returns": False, "with returns": True}


def measured(kind: str, seed: int) -> list[dict[str, Any]]:
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


def tables(result: dict[str, Any]) -> dict[str, str]:
    """The table: means over the seeds."""
    rows = []
    for kind in TISSUE:
        for way in WAYS:
            runs = [row for row in result["rows"] if (row["tissue"], row["way"]) == (kind, way)]
            cells = [shown([run[key] for run in runs], digits) for key, digits in (("error", 3), ("seconds", 3))]
            share = shown([100 * run["of_path"] for run in runs], 2)
            rows.append([kind, way, cells[0], f"{share} %", cells[1], shown([run["returns"] for run in runs], 0)])
    head = ["Tissue", "`endotsr poses`", "error, mm", "of the path", "s per frame", "returns"]
    about = (
        f"{FRAMES} frames of {SMALL[0]}x{SMALL[1]}; mean ± 95 % interval over {result['seeds']} seeds of the simulator;"
        f" processor time on one thread of {result['machine']['processor']}, {result['date']}."
    )
    return {"table": markdown(head, rows) + "\n\n" + about}


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    if not options.table:
        rows = [row for seed in range(options.seeds) for kind in TISSUE for row in measured(kind, seed)]
        result = {"date": date.today().isoformat(), "machine": machine(), "seeds": options.seeds, "rows": rows}
        write_json(FILE, result)
    write_marked(PAGE, tables(read_json(FILE, "docs/pages/recordings/pose_returns.py")), "pose_returns")
