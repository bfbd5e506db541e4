"""Estimate the poses of hand-held clips beside other programs, and write the tables of errors and times.

    python docs/make.py recordings.hand_held [--data ../shared/data] [--seeds 3]
    python docs/make.py recordings.hand_held --so-far    write what an unfinished measurement has
    python docs/make.py recordings.hand_held --table     rewrite the tables of the last result

The simulated clips have a hand-held camera in front of rigid or breathing tissue, with an instrument, and with a camera
whose exposure jumps; their depth is in whole millimetres. Two real clips follow: `sinus_endoscopy`, whose reference is
itself a reconstruction, and `surgt_davinci`, without a reference. cv2 comes with endotsr; pycolmap takes part if it is
installed. Everything runs on one thread, and times are of the processor. Finished measurements are kept, and a stopped
command continues. The result is docs/results/hand_held.json; the tables are in docs/guides/prepare.md.
"""

import argparse
import tempfile
import time
from datetime import date
from functools import lru_cache, partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import with_settings
from endotsr.method.splatting.camera import CameraPose
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.recordings.any_clip import said
from pages.recordings.odometries import METHODS
from pages.recordings.path_errors import path_errors
from pages.store import kept
from pages.store.intervals import shown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "hand_held.json", DOCS / "guides" / "prepare.md"
SMALL, LARGE = (320, 256), (640, 512)
FRAMES, SHIFT, CYCLES = 48, 8.0, 2.0  # largest sideways shift in mm, and the rate of the path of the hand
SEEN = ("camera_motion", "motion_blur", "vignetting", "second_light", "highlights", "noise", "depth_rounding")
TISSUE = ("breathing", "pulsation")
KINDS: dict[str, tuple[str, ...]] = {
    "rigid": (),
    "breathing": TISSUE,
    "breathing, pull, instrument": (*TISSUE, "pull", "instrument"),
    "rigid, jumps of the exposure": ("auto_exposure", "exposure"),
}
REAL = ("sinus_endoscopy", "surgt_davinci")
OURS, SLOW = "`endotsr poses`", "pycolmap"  # pycolmap is tried with one seed
SINUS_SCALE, DAVINCI_SCALE = "0.16667", "0.25"
STEREO = ("--stereo", "side_by_side")


@lru_cache(maxsize=1)
def simulated(
    kind: str, size: tuple[int, int], seed: int, frames: int = FRAMES, shift: float = SHIFT, cycles: float = CYCLES
) -> Sequence:
    """A simulated hand-held clip with true poses."""
    from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
    from endotsr.clips.simulator.simulate import simulate

    plain = SimulatorSettings(width=size[0], height=size[1], frames=frames, seed=seed)
    settings = with_effects(plain, *SEEN, *KINDS[kind])
    path = {"path": "hand", "amplitude": shift, "cycles": cycles}
    return simulate(with_settings(settings, camera_motion=path)).sequence


@lru_cache(maxsize=1)
def recorded(name: str, data: Path) -> Sequence:
    """A real clip, prepared from its original files. Raises SystemExit if a command fails."""
    import endotsr

    with tempfile.TemporaryDirectory() as root:
        clip = Path(root) / "clip"
        if name == "sinus_endoscopy":
            said("prepare", data / name, "--out", clip, "--scale", SINUS_SCALE)
        else:
            source, calibration = data / name / "video.mp4", data / name / "calibration.yaml"
            said("prepare", source, *STEREO, "--calibration", calibration, "--out", clip, "--scale", DAVINCI_SCALE)
            said("depth", clip)
        return endotsr.load_sequence(clip, allow_tissue_fraction=True, depth_percentiles=(0.0, 100.0))


def measured(key: str, clips: dict[str, tuple[str, tuple[int, int], int, str]], data: Path) -> dict[str, Any]:
    """Errors and processor time of one method on one clip; `missing` for a program that is not installed."""
    import cv2
    import numba

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    kind, size, seed, name = clips[key]
    print(key, flush=True)
    sequence = simulated(kind, size, seed) if kind in KINDS else recorded(kind, data)
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


def plan(seeds: int) -> dict[str, tuple[str, tuple[int, int], int, str]]:
    """Every measurement: the clip, its size, its seed and the method."""
    quick = [name for name in METHODS if name != SLOW]
    rows = [(kind, SMALL, seed, name) for seed in range(seeds) for kind in KINDS for name in quick]
    rows += [(name, (0, 0), 0, method) for name in REAL for method in METHODS]
    rows += [("rigid", LARGE, seed, name) for seed in range(seeds) for name in quick]
    rows += [(kind, SMALL, 0, SLOW) for kind in KINDS]
    return {f"{kind}, {size[0]}x{size[1]}, seed {seed}, {name}": (kind, size, seed, name)
            for kind, size, seed, name in rows}  # fmt: skip


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
    answers = result["answers"]
    rows: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for key, (kind, size, _, name) in plan(result["seeds"]).items():
        if key in answers and not answers[key].get("missing"):
            rows.setdefault((kind, f"{size[0]}x{size[1]}", name), []).append(answers[key])
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
        f" thread of {result['machine']['processor']}, {result['date']}; OpenCV"
        f" {result['versions']['opencv-contrib-python-headless']}, pycolmap {result['versions']['pycolmap']}."
    )
    return {
        "simulated": markdown(head, made) + "\n\n" + about,
        "sinus": markdown(["Clip", "Method", "error", *head[3:4], "step", *head[5:-1]], [row[:-1] for row in real]),
        "davinci": markdown(["Method", "pixels of the flow left", "s per frame", "registered"], view),
    }


def _row(kind: str, size: str, name: str, runs: list[dict[str, Any]]) -> list[str]:
    """A row of one method: means over the seeds."""
    place = f"{kind}, {size}" if size else f"`{kind}`"
    total = sum(run["frames"] for run in runs)
    cells = [place, name, *(shown([run[key] for run in runs if key in run], digits) for key, digits in COLUMNS)]
    of_path = [100 * run["of_path"] for run in runs if "of_path" in run]
    cells[3] = f"{shown(of_path, 2)} %" if of_path else "-"
    return [*cells, f"{sum(run['registered'] for run in runs)} of {total}", str(len(runs))]


COLUMNS = (("error", 3), ("of_path", 4), ("step", 3), ("step_degrees", 3), ("seconds", 3))


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=DOCS.parents[1] / "shared" / "data")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--so-far", action="store_true")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    if not options.table:
        wanted = plan(options.seeds)
        about = {
            "sources": kept.sources("clips/poses", beside=("recordings/odometries", "recordings/path_errors")),
            "frames": FRAMES, "shift": SHIFT, "cycles": CYCLES, "kinds": KINDS, "seen": SEEN, "versions": versions(),
        }  # fmt: skip
        keys = [] if options.so_far else wanted
        answers = kept.measured(FILE, about, keys, partial(measured, clips=wanted, data=options.data))
        found = {"seeds": options.seeds, "date": date.today().isoformat(), "machine": machine()}
        write_json(
            FILE, found | {"versions": versions(), "answers": {key: answers[key] for key in wanted if key in answers}}
        )
        if not options.so_far:
            kept.finished(FILE)
    write_marked(PAGE, tables(read_json(FILE, "docs/pages/recordings/hand_held.py")), "hand_held")
