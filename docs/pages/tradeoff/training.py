"""Held-out quality against training seconds and iterations, with one setting changed at a time.

Every configuration is one training, measured at milestones; the evaluation time is excluded. The schedule of the
learning rates spans the whole training, so a milestone shows an unfinished training. A shorter training of that length
ends with a slightly higher quality.
"""

import hashlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numba
import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config, config_from_dict, config_to_toml, with_iterations
from endotsr.errors import InputError
from endotsr.results.evaluation.evaluate import evaluate_frames
from endotsr.results.evaluation.lpips import LpipsWeights
from endotsr.studies.tradeoff.results import FORMAT, read_format
from endotsr.training.fitting.compile_ahead import rehearse
from endotsr.training.fitting.model import render_at, spectral_from, with_corrected_cameras
from endotsr.training.fitting.records import LogEntry
from endotsr.training.fitting.state import TrainingState, new_training, training_constants
from endotsr.training.fitting.trainer import train, training_step
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine, now, versions

METRICS = ("psnr_full", "psnr_tissue", "ssim_full", "ssim_tissue", "lpips")
MILESTONES = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)  # fractions of the iterations
LPIPS_FROM = 1 / 2  # LPIPS takes several times as long as all other metrics together
PROBE_WARM, PROBE = 5, 15  # iterations
GROWTH = 2.0  # mean cost of an iteration relative to the first ones: Gaussians, residuals and losses are added


class StudyTraining(NamedTuple):
    """One training of the study."""

    name: str
    dial: str  # title of the question that it answers
    changes: dict[str, dict[str, Any]]  # settings that differ from the base
    cost: float  # estimated seconds relative to the base; used to plan the study, not in results

    def words(self) -> list[str]:
        """The options of `endotsr train` for the changes."""
        return [
            word
            for section, values in self.changes.items()
            for key, value in values.items()
            for word in (f"--{section}.{key.replace('_', '-')}", _plain(value))
        ]


def _plain(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:.6g}" if isinstance(value, float) else str(value)


def configurations(base: Config) -> list[StudyTraining]:
    """The base first, then the cheap and informative ones: a shortened study gives the main results."""
    first, other = base.initialisation.first_frame_points, base.initialisation.other_frame_points

    def points(factor: float) -> dict[str, dict[str, Any]]:
        counts = {"first_frame_points": round(first * factor), "other_frame_points": round(other * factor)}
        return {"initialisation": counts}

    return [
        StudyTraining("base", "base", {}, 1.0),
        StudyTraining("no residuals", "residuals", {"model": {"appearance": False, "spectral_motion": False}}, 0.85),
        StudyTraining("no Laplacian loss", "Laplacian loss", {"model": {"laplacian": False}}, 0.9),
        StudyTraining("half size", "image scale", {"sequence": {"scale": base.sequence.scale / 2}}, 0.5),
        StudyTraining("N / 2", "Gaussians", points(1 / 2), 0.75),
        StudyTraining("cutoff 1/64", "cutoffs", {"raster": {"alpha_cutoff": 1 / 64}}, 0.9),
        StudyTraining("cutoff 1e-4", "cutoffs", {"raster": {"alpha_cutoff": 1e-4}}, 1.2),
        StudyTraining("stop 1e-2", "cutoffs", {"raster": {"transmittance_stop": 1e-2}}, 1.0),
        StudyTraining("quarter size", "image scale", {"sequence": {"scale": base.sequence.scale / 4}}, 0.35),
        StudyTraining("N / 4", "Gaussians", points(1 / 4), 0.6),
        StudyTraining("float64", "precision", {"training": {"precision": "float64"}}, 1.8),
        StudyTraining("2 N", "Gaussians", points(2), 1.6),
    ]


def changed(base: Config, configuration: StudyTraining) -> Config:
    """The settings of a configuration."""
    data = msgspec.to_builtins(base)
    for section, values in configuration.changes.items():
        data[section] |= values
    return config_from_dict(data, f"configuration {configuration.name!r}")


def planned_iterations(base: Config, sequence: Sequence, seconds: float, weights: LpipsWeights | None) -> int:
    """Length of every training for which all of them, measured at their milestones, take about `seconds`.

    A few iterations and one evaluation are timed first.
    """
    constants, state = training_constants(sequence, base), new_training(sequence, base)
    for _ in range(PROBE_WARM):
        training_step(state, constants)
    began = time.monotonic()
    for _ in range(PROBE):
        training_step(state, constants)
    iteration = (time.monotonic() - began) / PROBE * GROWTH
    chosen = configurations(base)
    left = seconds
    for fraction in MILESTONES:
        began = time.monotonic()
        measured(state, base, sequence, sequence, weights if fraction >= LPIPS_FROM else None)
        left -= (time.monotonic() - began) * len(chosen)
    trainings = sum(c.cost for c in chosen)
    return int(np.clip(left / (iteration * trainings), 16, base.training.iterations))


def measured(
    state: TrainingState, config: Config, sequence: Sequence, full: Sequence, weights: LpipsWeights | None
) -> dict[str, float | None]:
    """Held-out means at full size, independent of the image scale of the training.

    sequence   sequence of the training; its training times define the atoms
    full       the predicted frames
    """
    spectral = spectral_from(config.model, sequence.times[sequence.train_index])
    seen = with_corrected_cameras(full, state.frames)

    def render(index: int) -> Any:
        at = (seen.cameras[index], float(full.times[index]))
        return render_at(state.gaussians, spectral, config, *at, frames=state.frames).colour

    found = evaluate_frames(full, full.test_index, render, weights)["mean"]
    return {name: found[name] for name in METRICS}


def run_configuration(
    configuration: StudyTraining,
    config: Config,
    sequence: Sequence,
    full: Sequence,
    weights: LpipsWeights | None,
    step: Callable[[], None],
) -> dict[str, Any]:
    """Train once; the entry of training.json.

    Seconds count from the initialisation to the end of a milestone's iteration, without compilation and evaluations.
    """
    rehearse(config)
    total = config.training.iterations
    stops = {max(1, round(fraction * total)) for fraction in MILESTONES}
    rows: list[dict[str, Any]] = []
    began, away = time.monotonic(), 0.0
    state = new_training(sequence, config)

    def on_iteration(entry: LogEntry) -> None:
        nonlocal away
        step()
        if entry["iteration"] in stops:
            reached = time.monotonic()
            row = {"iteration": entry["iteration"], "seconds": reached - began - away, "gaussians": entry["gaussians"]}
            used = weights if entry["iteration"] >= round(LPIPS_FROM * total) else None
            rows.append(row | measured(state, config, sequence, full, used))
            away += time.monotonic() - reached

    train(state, sequence, config, on_iteration, lambda reached: None, on_message=lambda message: None)
    return {
        "name": configuration.name,
        "dial": configuration.dial,
        "change": configuration.words(),
        "milestones": rows,
        "seconds": rows[-1]["seconds"],
        "evaluation_seconds": away,
        "lambda_lap": state.lambda_lap,
    }


def run_training_study(
    file: Path,
    base: Config,
    load: Callable[[Config], Sequence],
    name: str,
    *,
    minutes: float,
    iterations: int | None = None,
    weights: LpipsWeights | None = None,
    say: Callable[[str], None] = print,
    begin: Callable[[int], None] = lambda steps: None,
    step: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Train every configuration that the time allows, and write `file` after each; stored ones are kept.

    load         settings -> sequence, which depends on the image scale
    iterations   of every training; None = as many as fit the minutes (a resumed study keeps its number)
    returns      training.json
    """
    full = load(base)
    result = _begun(file, base, full, name, minutes, iterations, weights)
    file.parent.mkdir(parents=True, exist_ok=True)  # only now: a rejected sequence leaves no file
    base = with_iterations(base, result["iterations"])
    done = {entry["name"]: entry for entry in result["configurations"]}
    left = [c for c in configurations(base) if c.name not in done]
    begin(len(left) * base.training.iterations)
    ends = time.monotonic() + 60 * minutes
    result["left_out"] = {}
    for configuration in left:
        if time.monotonic() + _expected_seconds(configuration, done.get("base")) > ends:
            result["left_out"][configuration.name] = "no time left for it"
            continue
        config = changed(base, configuration)
        sequence = full if config.sequence == base.sequence else load(config)
        entry = run_configuration(configuration, config, sequence, full, weights, step)
        done[configuration.name] = entry
        result |= {"configurations": list(done.values()), "date": now()}
        write_json(file, result)
        say(f"{configuration.name}: {entry['milestones'][-1]['psnr_full']:.2f} dB after {entry['seconds']:.1f} s")
    write_json(file, result)
    return result


def _expected_seconds(configuration: StudyTraining, base: dict[str, Any] | None) -> float:
    """Seconds of training and evaluation of a configuration, scaled from the base; 0 before the base is measured."""
    return configuration.cost * base["seconds"] + base["evaluation_seconds"] if base else 0.0


def _begun(
    file: Path,
    base: Config,
    full: Sequence,
    name: str,
    minutes: float,
    iterations: int | None,
    weights: LpipsWeights | None,
) -> dict[str, Any]:
    """The study in `file` if it has the same sequence and settings, else a new one without trainings."""
    digest = hashlib.sha256(config_to_toml(base).encode() + full.images.tobytes() + full.depth.tobytes()).hexdigest()
    if file.exists():
        found = read_format(file)
        if found.get("input_sha256") == digest and iterations in (None, found["iterations"]):
            return found
        raise InputError(f"{file}: holds trainings of another sequence, length or settings; choose another --out")
    length = iterations or planned_iterations(base, full, 60 * minutes, weights)
    return {
        "format": FORMAT,
        "sequence": name,
        "frames": full.count,
        "width": full.width,
        "height": full.height,
        "preset": base.preset,
        "iterations": length,
        "input_sha256": digest,
        "configurations": [],
        "left_out": {},
        "date": now(),
        "machine": machine(),
        "versions": versions(),
        "threads": numba.get_num_threads(),
    }
