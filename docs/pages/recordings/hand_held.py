"""Estimate the poses of hand-held clips beside other programs, and write the tables of errors and times.

    python docs/make.py recordings.hand_held measure [--data ../shared/data] [--seeds 3]

The simulated clips have a hand-held camera in front of rigid or breathing tissue, with an instrument, and with a camera
whose exposure jumps; their depth is in whole millimetres. Two real clips follow: `sinus_endoscopy`, whose reference is
itself a reconstruction, and `surgt_davinci`, without a reference. cv2 comes with endotsr; pycolmap takes part if it is
installed. Everything runs on one thread, and times are of the processor. Finished measurements are kept, and a stopped
command continues.
"""

import argparse
import time
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.splatting.camera import CameraPose
from endotsr.results.report.tables import markdown
from pages.recordings.hand_held_clips import CYCLES, FRAMES, KINDS, LARGE, SEEN, SHIFT, SMALL, recorded, simulated
from pages.recordings.odometries import METHODS
from pages.recordings.path_errors import path_errors
from pages.store import kept
from pages.store.intervals import shown
from pages.store.program import DATA, Program
from pages.store.tables import means, noted, where

REAL = ("sinus_endoscopy", "surgt_davinci")
OURS, SLOW = "`endotsr poses`", "pycolmap"  # pycolmap is tried with one seed
SIZES = {f"{width}x{height}": (width, height) for width, height in (SMALL, LARGE)}
COLUMNS = (("error", 3), ("of_path", 4), ("step", 3), ("step_degrees", 3), ("seconds", 3))


def of_clip(kind: str, size: str, seed: int, name: str, data: Path) -> dict[str, Any]:
    """Errors and processor time of one method on one clip; `missing` for a program that is not installed."""
    import cv2
    import numba

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    sequence = simulated(kind, SIZES[size], seed) if kind in KINDS else recorded(kind, data)
    method = METHODS[name]
    try:
        _compiled(sequence)
        begun, begun_process = time.perf_counter(), time.process_time()
        found = method(sequence)
        seconds = {"wall": time.perf_counter() - begun, "seconds": time.process_time() - begun_process}
    except ImportError:
        return {"missing": True}
    per_frame = {key: value / sequence.count for key, value in seconds.items()}
    if kind == "surgt_davinci":
        return per_frame | {"frames": sequence.count, **agreeing(sequence, found.poses)}
    true = [CameraPose(camera.rotation, camera.translation) for camera in sequence.cameras]
    return per_frame | {"frames": sequence.count, **path_errors(found.poses, true, found.scaled)}


_warm: set[str] = set()


def _compiled(sequence: Sequence) -> None:
    """Load the compiled functions before the first time is taken."""
    if not _warm:
        METHODS[OURS](sequence)
        _warm.add(OURS)


def agreeing(sequence: Sequence, poses: list[CameraPose | None]) -> dict[str, Any]:
    """Without true poses: pixels of the flow that the poses leave, and that no motion leaves."""
    from endotsr.clips.poses.agreement import left_by
    from endotsr.clips.poses.estimate import movement_of
    from endotsr.clips.poses.views import Views

    matcher, pairs, _ = movement_of(Views(sequence.images, sequence.masks, sequence.depth, sequence.cameras[0]))
    whole = [pair for pair in pairs if poses[pair.source] and poses[pair.target]]
    if not whole:
        return {"registered": sum(pose is not None for pose in poses)}
    left = left_by(matcher, whole, poses)  # type: ignore[arg-type]
    return {
        "registered": sum(pose is not None for pose in poses), "left": float(np.median(left)),
        "still": float(np.median([pair.still for pair in whole])),
    }  # fmt: skip


def plan(seeds: int) -> list[tuple[str, str, int, str]]:
    """Every measurement: the clip, its size, its seed and the method."""
    small, large = SIZES
    quick = [name for name in METHODS if name != SLOW]
    rows = [(kind, small, seed, name) for seed in range(seeds) for kind in KINDS for name in quick]
    rows += [(name, "0x0", 0, method) for name in REAL for method in METHODS]
    rows += [("rigid", large, seed, name) for seed in range(seeds) for name in quick]
    return rows + [(kind, small, 0, SLOW) for kind in KINDS]


def versions() -> dict[str, str]:
    """Versions of the programs that were compared."""
    found = {}
    for name in ("opencv-contrib-python-headless", "pycolmap"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def tables(result: dict[str, Any]) -> dict[str, str]:
    """The table of simulated clips, and that of real ones."""
    rows: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for run in plan(result["seeds"]):
        answer = result["answers"].get(kept.key_of(run), {"missing": True})
        if not answer.get("missing"):
            rows.setdefault((run[0], run[1], run[3]), []).append(answer)
    made = [_row(kind, size, name, runs) for (kind, size, name), runs in rows.items() if kind in KINDS]
    real = [_row(kind, "", name, runs) for (kind, _, name), runs in rows.items() if kind == "sinus_endoscopy"]
    view = [
        [name, f"{runs[0]['left']:.2f}" if "left" in runs[0] else "-", f"{runs[0]['seconds']:.2f}",
         f"{runs[0]['registered']} of {runs[0]['frames']}"]
        for (kind, _, name), runs in rows.items() if kind == "surgt_davinci"
    ]  # fmt: skip
    head = [
        "Tissue", "Method", "error, mm", "of the path", "step, mm", "step, degrees", "s per frame", "registered",
        "seeds",
    ]  # fmt: skip
    about = (
        f"{FRAMES} frames; mean ± 95 % interval over the seeds of the simulator; processor time on one"
        f" thread of {where(result)}; OpenCV"
        f" {result['versions']['opencv-contrib-python-headless']}, pycolmap {result['versions']['pycolmap']}."
    )
    return {
        "simulated": noted(head, made, about),
        "sinus": markdown(["Clip", "Method", "error", *head[3:4], "step", *head[5:-1]], [row[:-1] for row in real]),
        "davinci": markdown(["Method", "pixels of the flow left", "s per frame", "registered"], view),
    }


def _row(kind: str, size: str, name: str, runs: list[dict[str, Any]]) -> list[str]:
    """A row of one method: means over the seeds."""
    place = f"{kind}, {size}" if size else f"`{kind}`"
    total = sum(run["frames"] for run in runs)
    cells = [place, name, *means(runs, COLUMNS)]
    of_path = [100 * run["of_path"] for run in runs if "of_path" in run]
    cells[3] = f"{shown(of_path, 2)} %" if of_path else "-"
    return [*cells, f"{sum(run['registered'] for run in runs)} of {total}", str(len(runs))]


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every measurement of the plan."""
    about = {
        "sources": kept.sources("clips/poses", beside=("recordings/odometries", "recordings/path_errors")),
        "frames": FRAMES, "shift": SHIFT, "cycles": CYCLES, "kinds": KINDS, "seen": SEEN, "versions": versions(),
    }  # fmt: skip
    runs = plan(options.seeds)
    answers = kept.measured(options.record, about, runs, partial(of_clip, data=options.data))
    by_key = {kept.key_of(run): answer for run, answer in answers.items()}
    return {"seeds": options.seeds, "versions": versions(), "answers": by_key}


PROGRAM = Program(
    __name__, "guides/poses.md", tables, "hand_held.json", measured, {"--data": DATA, "--seeds": 3},
)  # fmt: skip
