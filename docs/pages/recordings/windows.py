"""Measure recordings in windows: quality, minutes, memory and the flicker at seams.

    python docs/make.py recordings.windows measure WORDS, where WORDS is one of

    recording --frames 240 --size 160x128 --windows 48          raw recording -> film, by commands
    recording --frames 2000 --size 320x256 --windows auto --chain 4 --preset quick
    clip SEQUENCE --windows 64 36 27 --preset quick             one clip in 1, 2 and 3 windows
    warm RUN                                                    iterations saved by warm starts

`recording` simulates breathing, pulsation, a moving camera, an instrument and a drift of the light as a StereoMIS
recording, and renders the film with the commands of the guide; with `--keep` an interrupted command continues. `warm`
retrains the warm windows of a run from a cold start, on the whole schedule, and finds the iteration at which the cold
run reaches the final training loss of the warm one. Results are added to docs/results/windows.json; the tables are in
docs/guides/recording.md.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from endotsr.clips.simulator.recorded import recorded_positions
from endotsr.results.report.tables import markdown
from endotsr.studies.sweeps.execute import execute
from endotsr.studies.windows.make import WARM, recording_settings, window_job
from endotsr.studies.windows.record import read_record
from endotsr.studies.windows.scene import WindowFrames, open_windows
from endotsr.training.runs.files import write_json
from endotsr.training.runs.log import log_until
from endotsr.training.runs.machine import dated
from pages.recordings.seam_errors import seam_errors
from pages.store.commands import loaded
from pages.store.program import Program

EFFECTS = "breathing,pulsation,camera_motion,exposure,instrument,highlights,noise"
FRAMES_A_BREATH, FRAMES_A_BEAT, FRAMES_A_SWING = 80, 24, 160
LONGEST = 10**9  # iterations: the whole log
LAST = 0.1  # last fraction of the log of a run, with the compared mean loss


def command(*words: str) -> tuple[float, float]:
    """Run a command of endotsr; returns seconds, and the largest peak memory of any process so far, bytes."""
    begun = time.monotonic()
    subprocess.run([sys.executable, "-m", "endotsr", *words], check=True)
    return time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024.0


def row_of(run: Path, name: str, seconds: float, preset: str) -> dict[str, Any]:
    """Results of a trained and measured run of windows."""
    metrics = loaded(run / "metrics.json")
    means = {"model": metrics["held_out"]["mean"]} | {k: v["mean"] for k, v in metrics["baselines"].items()}
    found = {
        "name": name,
        "preset": preset,
        "windows": len(metrics["windows"]),
        "warm": sum(row["start"] == "warm" for row in metrics["windows"]),
        "frames": read_record(run).frames,
        "seconds": seconds,
        "training_seconds": sum(row["seconds"] for row in metrics["windows"]),
        "iterations": sum(row["iterations"] for row in metrics["windows"]),
        "peak_memory_bytes": max(row["peak_memory_bytes"] or 0 for row in metrics["windows"]),
        "psnr_tissue": {key: mean["psnr_tissue"] for key, mean in means.items()},
        "psnr_full": {key: mean["psnr_full"] for key, mean in means.items()},
        "lpips": means["model"]["lpips"],
        "seams": metrics["seams"],
    }
    return dict(dated(found))


def trained(source: Path, run: Path, name: str, options: argparse.Namespace, windows: str) -> dict[str, Any]:
    """One training in windows, with its evaluation; an interrupted run is continued."""
    words = ["train", str(source), "--out", str(run), "--windows", windows, "--preset", options.preset]
    words += ["--chain", str(options.chain), "--sequence.split", options.split]
    words += ["--iterations", str(options.iterations)] if options.iterations else []
    words += ["--scale", str(options.scale)] if options.scale < 1 else []
    words = ["train", "--out", str(run), "--resume"] if run.exists() else words
    words += ["--workers", str(options.workers)]
    words += ["--lpips", str(options.lpips)] if options.lpips else []
    seconds, _ = command(*words)
    name += "" if options.scale == 1 else f" at scale {options.scale:g}"
    return row_of(run, name if options.split == "every_eighth" else f"{name}, {options.split}", seconds, options.preset)


class Steps:
    """The seconds of commands, stored in a folder: a command with existing output is not repeated."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "steps.json"
        self.seconds = loaded(self._file) if self._file.exists() else {}

    def make(self, name: str, out: Path, *words: str) -> None:
        """Run a command unless its output exists."""
        if not out.exists():
            self.keep(name, command(*words)[0])

    def keep(self, name: str, seconds: float) -> None:
        """Add seconds to the recorded time of a step."""
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        write_json(self._file, self.seconds)


def followed_errors(run: Path, raw: Path) -> dict[str, Any]:
    """Errors of points followed across seams and inside windows, against the truth of the raw recording."""
    scene = open_windows(run)
    frames, place = WindowFrames(scene), {g: i for i, g in enumerate(scene.frames)}
    camera = scene.cameras[0]
    read = SimpleNamespace(names=scene.record.names, width=camera.width, height=camera.height)
    positions = recorded_positions(raw, read)  # pyright: ignore[reportArgumentType]
    assert positions is not None

    def masks(g: int) -> np.ndarray:
        k = scene.owner(g)
        return frames.of_window(k).masks[g - scene.plan.windows[k].first]

    return seam_errors(scene, masks, lambda g, other: positions(place[g], place[other]))._asdict()


def recorded_clip(steps: Steps, folder: Path, frames: int, size: str) -> Path:
    """A raw recording, and the folder `clip` that `prepare` and `depth` make of it; returns the raw folder."""
    raw, clip = folder / "raw", folder / "clip"
    width, height = size.split("x")
    cycles = {"breathing": FRAMES_A_BREATH, "pulsation": FRAMES_A_BEAT, "camera-motion": FRAMES_A_SWING}
    words = ["simulate", "--effects", EFFECTS, "--layout", "stereomis", "--out", str(raw), "--width", width]
    words += ["--height", height, "--frames", str(frames)]
    for effect, length in cycles.items():
        words += [f"--{effect}.cycles", f"{frames / length:g}"]
    steps.make("simulate", raw, *words)
    steps.make("prepare", clip, "prepare", str(raw), "--out", str(clip))
    steps.make("depth", clip / "depth", "depth", str(clip), "--nearest", "25", "--farthest", "120")
    return raw


def recording(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Raw recording to film."""
    steps, clip, run = Steps(folder), folder / "clip", folder / "run"
    raw = recorded_clip(steps, folder, options.frames, options.size)
    found = trained(clip, run, f"simulated {options.frames} frames {options.size}", options, options.windows[0])
    steps.keep("train", found["seconds"])
    film, page = folder / "film.mp4", folder / "page.html"
    steps.make("film", film, "render", str(run), "--film", str(film))
    steps.make("page", page, "export", str(run), "--out", str(page))
    largest = max(file.stat().st_size for file in (folder / "page_windows").iterdir())
    return found | {
        "steps": steps.seconds,
        "followed": followed_errors(run, raw),
        "page_bytes": {"page": page.stat().st_size, "largest_window": largest},
    }


def warm(run: Path, most: int) -> list[dict[str, Any]]:
    """For the first warm windows: their iterations, and the iterations of a cold run with the same loss."""
    record, config, found = read_record(run), recording_settings(run), []
    for k in [k for k, window in enumerate(record.windows) if window.start == "warm"][:most]:
        window = record.windows[k]
        job = window_job(run, record, k, config)
        mine = losses(Path(job.folder))
        other = window_job(run, record, k, config, cold=True)._replace(
            folder=str(run.absolute() / "again" / window.name)
        )
        outcome = execute(other, 1)
        if outcome.status != "finished":
            raise SystemExit(f"{window.name}: {outcome.reason}")
        cold = losses(Path(other.folder))
        count = max(1, round(LAST * len(mine)))
        level, smooth = mine[-count:].mean(), np.convolve(cold, np.ones(count) / count, "valid")
        reached = np.flatnonzero(smooth <= level)
        equal = int(reached[0]) + count if reached.size else None
        found.append({"window": window.name, "warm_iterations": len(mine), "warm_loss": float(level),
                      "cold_iterations": len(cold), "cold_loss": float(cold[-count:].mean()),
                      "cold_reaches_it_after": equal})  # fmt: skip
    return found


def losses(folder: Path) -> np.ndarray:
    """The loss of every iteration of a run."""
    return np.array([entry["loss"] for entry in log_until(folder / "log.jsonl", LONGEST)])


def table(result: dict[str, Any]) -> str:
    """One row per run."""
    headings = ["Recording, preset", "Windows (warm)", "Steps", "Time, min", "Memory, GB",
                "PSNR, dB", "blend", "flow", "LPIPS", "Flicker"]  # fmt: skip
    cells = []
    for row in result["rows"]:
        psnr, ratio, lpips = row["psnr_tissue"], row["seams"]["model"]["ratio"], row["lpips"]
        cells.append([
            f"{row['name']}, `{row['preset']}`", f"{row['windows']} ({row['warm']})", f"{row['iterations']}",
            f"{row['training_seconds'] / 60:.1f}", f"{row['peak_memory_bytes'] / 1e9:.2f}", f"{psnr['model']:.2f}",
            f"{psnr['two_neighbours']:.2f}", f"{psnr['flow_interpolation']:.2f}",
            "-" if lpips is None else f"{lpips:.4f}", "-" if ratio is None else f"{ratio:.2f}",
        ])  # fmt: skip
    return markdown(headings, cells)


def seam_table(result: dict[str, Any]) -> str:
    """Points followed for 16 frames, and the minutes of the commands, for every raw recording."""
    headings = ["Recording", "Seams", "Across, of the motion", "Inside, of the motion",
                "Minutes: prepare, depth, train, film", "Page, largest window, MB"]  # fmt: skip
    cells = []
    for row in result["rows"]:
        if (f := row.get("followed")) is None:
            continue
        minutes = ", ".join(f"{row['steps'][name] / 60:.1f}" for name in ("prepare", "depth", "train", "film"))
        cells.append([
            row["name"], f"{f['seams']}", f"{f['across']:.2f} of {f['across_motion']:.2f} mm",
            f"{f['inside']:.2f} of {f['inside_motion']:.2f} mm", minutes,
            ", ".join(f"{size / 1e6:.1f}" for size in row["page_bytes"].values()),
        ])  # fmt: skip
    return markdown(headings, cells) if cells else "Not measured yet."


def warm_table(result: dict[str, Any]) -> str:
    """One row per warm window."""
    rows = result["warm"]
    if not rows:
        return "Not measured yet."
    headings = ["Window", "Iterations, warm", "Loss at the end", "A cold start reaches it after", "Its loss at the end"]
    return markdown(headings, [
        [row["window"], f"{row['warm_iterations']}", f"{row['warm_loss']:.4f}",
         f"{row['cold_reaches_it_after'] or 'never'} of {row['cold_iterations']}", f"{row['cold_loss']:.4f}"]
        for row in rows
    ])  # fmt: skip


def chain_table(result: dict[str, Any], windows: int = 64) -> str:
    """Work and time of chains, in schedules of a cold window, for 2 to 64 workers with equal windows."""
    rows = []
    for chain in (1, 4, 16):
        chains, length = windows // chain, 1 + WARM * (chain - 1)
        times = [-(-chains // workers) * length for workers in (2, 4, 16, 64)]
        rows.append([f"{chain}", *(f"{value:.3g}" for value in (chains * length, *times))])
    headings = ["`--chain`", "Work", *(f"Time, {workers} workers" for workers in (2, 4, 16, 64))]
    return markdown(headings, rows)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The record with one more measurement."""
    known = loaded(options.record) if options.record.exists() else {"rows": [], "warm": []}
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if options.what == "recording":
            known["rows"].append(recording(options, folder))
        elif options.what == "clip":
            for number in options.windows:
                run = folder / f"windows{number}"
                known["rows"].append(trained(options.source, run, options.source.name, options, number))
        else:
            known["warm"] = warm(options.source, options.most)
    return known


PROGRAM = Program(
    __name__, "guides/recording.md",
    {"runs": table, "seams": seam_table, "warm": warm_table, "chains": chain_table}, "windows.json", measured,
    {
        "what": {"choices": ["recording", "clip", "warm"]},
        "source": {"type": Path, "nargs": "?", "help": "a sequence (clip), or a run (warm)"},
        "--frames": 240, "--size": "160x128", "--chain": 1, "--workers": 1, "--preset": "quick",
        "--windows": {"nargs": "+", "default": ["auto"]},
        "--iterations": {"type": int},
        "--most": {"type": int, "default": 1000, "help": "warm windows that are trained again (warm)"},
        "--scale": {"type": float, "default": 1.0, "help": "of the pictures of a clip"},
        "--split": {"choices": ["every_eighth", "every_second", "blocks"], "default": "every_eighth"},
        "--lpips": {"type": Path},
        "--keep": {"type": Path, "help": "folder for what is made (default: a temporary one)"},
    },
    stamped=False,
)  # fmt: skip
