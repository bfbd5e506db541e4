"""Measure the detections of `endotsr inspect` and the savings of `--effects auto`; write the tables of docs/effects.md.

    python docs/make.py effects measure detect [--seeds 5] [--first 200]    simulated clips: detections, false positives
    python docs/make.py effects measure train [NAME ...] [--seeds 5]        held-out PSNR and time, `auto` against
                                                         `everything`; a NAME is a scene, or an EndoNeRF folder
    python docs/make.py effects measure truth [--seeds 5] [--iterations 1000]    errors against the truth, leakage
                                                                             between light and motion
    python docs/make.py effects measure real FOLDER ...  verdicts on EndoNeRF folders and on `sinus_endoscopy`

An interrupted `detect`, `train` or `truth` continues when it is started again with the same arguments.
`python docs/make.py bench measure effects` measures the time of the parts.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import msgspec

from endotsr.config import DEMO, PAPER
from endotsr.errors import InputError
from endotsr.results.report.style import save
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import dated, now
from endotsr.untrusted.names import choice
from pages.effects import parts as effects_parts
from pages.effects import study
from pages.effects import truth as effects_truth
from pages.recordings.hand_held_clips import recorded
from pages.store import kept
from pages.store.commands import loaded
from pages.store.program import RESULTS, Program

FILES = {
    "detect": "effects_detect.json", "train": "effects_train.json", "real": "effects_real.json",
    "truth": "effects_truth.json", "bench": "bench_effects.json",
}  # fmt: skip
STUDY = ("effects/study",)  # makes the clips
THIRD = "0.33333"  # of the size of `sinus_endoscopy`
FRAMES, TRAIN_FRAMES, ITERATIONS, REAL_ITERATIONS = 40, 24, DEMO.training.iterations, 1000
SCENES = {
    "still": ("noise",),
    "breathing": ("noise", "breathing"),
    "pulsation": ("noise", "pulsation"),
    "pulling": ("noise", "pull", "instrument"),
    "light": ("noise", "exposure", "brightening"),
    "highlights": ("noise", "breathing", "highlights"),
    "moving camera": ("noise", "breathing", "camera_motion"),
    "everything": ("noise", "breathing", "pulsation", "pull", "exposure", "brightening", "highlights", "instrument"),
}


def detect(options: argparse.Namespace) -> dict[str, Any]:
    """The study of the tests, with seeds on which no threshold was tuned."""
    chosen = range(options.first, options.first + options.seeds)
    clips = {(trial.key,): trial for trial in study.trials(chosen)}
    about = {"frames": FRAMES, "sources": kept.sources("clips/effects", "clips/simulator", beside=STUDY)}
    answers = kept.measured(options.record, about, clips, lambda key: study.answer_of(clips[(key,)], FRAMES))
    return study.summary(chosen, FRAMES, {key: answer for (key,), answer in answers.items()})


def train(options: argparse.Namespace) -> dict[str, Any]:
    """Every named scene (none = all) and folder with both settings: tissue PSNR, processor time, size of a Gaussian.

    Raises: InputError for a name that is neither in SCENES nor a folder.
    """
    folders = {Path(name).name: Path(name) for name in options.names if Path(name).is_dir()}
    scenes = [name for name in options.names if Path(name).name not in folders] or list(SCENES)
    if unknown := [name for name in scenes if name not in SCENES]:
        raise InputError(f"scene {unknown[0]!r} is not allowed; use {choice(SCENES)}, or a folder")
    runs = [(name, seed) for seed in range(options.seeds) for name in (*scenes, *folders)]
    ready: list[bool] = []

    def measure(name: str, seed: int) -> dict[str, Any]:
        if not ready:
            _load_kernels()
            ready.append(True)
        folder = folders.get(name)
        return _pair(_clip(name, seed), seed, ITERATIONS) if folder is None else _real_pair(folder, seed)

    about = {"frames": TRAIN_FRAMES, "iterations": ITERATIONS, "real_iterations": REAL_ITERATIONS}
    sources = {"sources": kept.sources("", beside=STUDY)}
    found = kept.nested(kept.measured(options.record, about | sources, runs, measure))
    return {"seeds": options.seeds, **about, "scenes": found, "real": list(folders)}


def _real_pair(folder: Path, seed: int) -> dict[str, Any]:
    """Both settings on a real clip at half size."""
    return _pair(_read_endonerf(folder, 0.5), seed, REAL_ITERATIONS)


def _clip(name: str, seed: int) -> Any:
    from endotsr.clips.simulator.simulate import simulate

    return simulate(study.settings_of(SCENES[name], seed, TRAIN_FRAMES)).sequence


def _load_kernels() -> None:
    """A short training, to exclude compilation from the times."""
    from endotsr.api import make_config
    from endotsr.api import train as fit
    from endotsr.method.kernels.threads import use_threads

    use_threads(1)
    fit(_clip("everything", 0), make_config("demo", iterations=20, training={"threads": 1}), on_message=print)


def _pair(sequence: Any, seed: int, iterations: int) -> dict[str, Any]:
    """Both settings on one clip."""
    from endotsr.api import make_config
    from endotsr.api import train as fit
    from endotsr.clips.effects.auto import planned_settings
    from endotsr.clips.effects.savings import numbers_of_a_gaussian

    everything = make_config("demo", iterations=iterations, training={"seed": seed, "threads": 1})
    began = time.process_time()
    auto, lines, _ = planned_settings(sequence, everything)
    found: dict[str, Any] = {"inspect_s": time.process_time() - began, "changes": lines[1:]}
    for name, config in (("everything", everything), ("auto", auto)):
        began = time.process_time()
        run = fit(sequence, config, on_message=lambda line: None)
        seconds = time.process_time() - began
        mean = run.evaluate()["held_out"]["mean"]
        found[name] = {
            "psnr": mean["psnr_tissue"], "seconds": seconds, "numbers": numbers_of_a_gaussian(config),
            "gaussians": run.log[-1]["gaussians"],
        }  # fmt: skip
    return found


def real(options: argparse.Namespace) -> dict[str, Any]:
    """Verdicts and plans on folders; results of other clips are kept."""
    from endotsr.clips.effects.inspect import inspect_sequence, inspection_record
    from endotsr.clips.effects.plan import make_plan, plan_record

    found = loaded(options.record)["clips"] if options.record.exists() else {}
    for folder in map(Path, options.names):
        sinus = (folder / "cameras_points.npz").exists()
        clip = recorded("sinus_endoscopy", folder.parent, THIRD) if sinus else _read_endonerf(folder)
        inspection = inspect_sequence(clip)
        plan = plan_record(make_plan(inspection, PAPER))
        found[folder.name] = inspection_record(inspection) | {"plan": plan, "date": now()}
    return {"clips": found}


def _read_endonerf(folder: Path, scale: float = 1.0) -> Any:
    from endotsr.clips.sequences.read import read_sequence

    return read_sequence(folder, msgspec.structs.replace(PAPER.sequence, scale=scale), PAPER.raster.near)


def fragments(found: dict[str, dict[str, Any]]) -> dict[str, str]:
    """Every generated part of the page by name; a missing measurement is marked."""
    makers = {
        "answer": (lambda result: effects_parts.answer(result, found.get("real"), found.get("bench")), "train"),
        "costs": (effects_parts.costs, "bench"),
        "detections": (effects_parts.detections, "detect"),
        "amplitudes": (effects_parts.amplitudes, "detect"),
        "training": (effects_parts.training, "train"),
        "truth": (effects_truth.table, "truth"),
        "real": (effects_parts.real, "real"),
    }
    return {
        name: make(found[file]) if file in found else f"Not measured yet: `python docs/make.py effects measure {file}`."
        for name, (make, file) in makers.items()
    }


def read(folder: Path = RESULTS) -> dict[str, dict[str, Any]]:
    """The measurements that exist, by name. Raises: InputError if none exists."""
    found = {name: loaded(folder / file) for name, file in FILES.items() if (folder / file).exists()}
    if not found:
        raise InputError(f"{folder}: holds no measurement; made by `python docs/make.py effects measure`")
    return found


def draw(record: None) -> None:
    """The picture of the savings."""
    if "train" in (found := read()):
        save(effects_parts.answer_figure(found["train"]), RESULTS / "effects.svg")


COMMANDS = {"detect": detect, "train": train, "truth": effects_truth.truth, "real": real}


def measured(options: argparse.Namespace) -> None:
    """One of the measurements, to its own record."""
    options.record = RESULTS / FILES[options.what]
    write_json(options.record, dated(COMMANDS[options.what](options)))
    kept.finished(options.record)


PROGRAM = Program(
    __name__, "effects.md", lambda: fragments(read()), "", measured,
    {
        "what": {"choices": list(COMMANDS)},
        "names": {"nargs": "*", "metavar": "NAME", "help": "scenes or folders"},
        "--seeds": 5, "--first": study.FIRST_SEED, "--iterations": effects_truth.ITERATIONS,
    },
    draw,
)  # fmt: skip
