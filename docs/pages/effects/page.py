"""Measure the detections of `endotsr inspect` and the savings of `--effects auto`; write the tables of docs/effects.md.

    python docs/make.py effects detect [SEEDS [FIRST]]      simulated clips: detections, false positives
    python docs/make.py effects train [SEEDS [NAME ...]]    held-out PSNR and time, `auto` against `everything`;
                                                             NAME is a scene (none = all) or an EndoNeRF folder
    python docs/make.py effects truth [SEEDS [ITERATIONS]]  errors against the truth, leakage between light and motion
    python docs/make.py effects real FOLDER ...             verdicts on EndoNeRF folders and on `sinus_endoscopy`
    python docs/make.py effects                             write the page from docs/results

An interrupted `detect`, `train` or `truth` continues when it is started again with the same arguments.
`python docs/make.py bench measure effects` measures the time of the parts.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from endotsr.config import DEMO, PAPER
from endotsr.errors import InputError
from endotsr.results.report.style import save
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import dated, now
from pages.effects import parts as effects_parts
from pages.effects import sinus as effects_sinus
from pages.effects import truth as effects_truth
from pages.store import kept
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
PAGE, RESULTS = DOCS / "effects.md", DOCS / "results"
FILES = {
    "detect": "effects_detect.json", "train": "effects_train.json", "real": "effects_real.json",
    "truth": "effects_truth.json", "bench": "bench_effects.json",
}  # fmt: skip
STUDY = ("effects/study",)  # makes the clips
SEEDS, FRAMES, TRAIN_FRAMES, ITERATIONS, REAL_ITERATIONS = 5, 40, 24, DEMO.training.iterations, 1000
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


def detect(seeds: int, first: int | None = None) -> dict[str, Any]:
    """The study of the tests, with seeds on which no threshold was tuned."""
    from pages.effects.study import FIRST_SEED, answer_of, summary, trials, wrong

    chosen = range(FIRST_SEED if first is None else first, (FIRST_SEED if first is None else first) + seeds)
    clips = {trial.key: trial for trial in trials(chosen)}

    def measure(key: str) -> dict[str, Any]:
        answer = answer_of(clips[key], FRAMES)
        print(f"{key}: {', '.join(wrong(clips[key], answer['said'])) or 'right'}", flush=True)
        return answer

    about = {"frames": FRAMES, "sources": kept.sources("clips/effects", "clips/simulator", beside=STUDY)}
    return summary(chosen, FRAMES, kept.measured(RESULTS / FILES["detect"], about, clips, measure))


def train(seeds: int, names: list[str]) -> dict[str, Any]:
    """Every named scene (none = all) and folder with both settings: tissue PSNR, processor time, size of a Gaussian.

    Raises: InputError for a name that is neither in SCENES nor a folder.
    """
    folders = {Path(name).name: Path(name) for name in names if Path(name).is_dir()}
    scenes = [name for name in names if Path(name).name not in folders] or list(SCENES)
    unknown = [name for name in scenes if name not in SCENES]
    if unknown:
        raise InputError(f"scene {unknown[0]!r} is not allowed; allowed: {', '.join(SCENES)}, or a folder")
    every = {name: None for name in scenes} | folders
    pairs = {f"{name} {seed}": (name, seed) for seed in range(seeds) for name in every}
    ready: list[bool] = []

    def measure(key: str) -> dict[str, Any]:
        if not ready:
            _load_kernels()
            ready.append(True)
        name, seed = pairs[key]
        folder = every[name]
        found = _pair(_clip(name, seed), seed, ITERATIONS) if folder is None else _real_pair(folder, seed)
        print(key, found, flush=True)
        return found

    about = {"frames": TRAIN_FRAMES, "iterations": ITERATIONS, "real_iterations": REAL_ITERATIONS}
    answers = kept.measured(
        RESULTS / FILES["train"], about | {"sources": kept.sources("", beside=STUDY)}, pairs, measure
    )
    found = {name: [answers[f"{name} {seed}"] for seed in range(seeds)] for name in every}
    return {"seeds": seeds, **about, "scenes": found, "real": list(folders)}


def _real_pair(folder: Path, seed: int) -> dict[str, Any]:
    """Both settings on a real clip at half size."""
    return _pair(_read_endonerf(folder, 0.5), seed, REAL_ITERATIONS)


def _clip(name: str, seed: int) -> Any:
    from endotsr.clips.simulator.simulate import simulate
    from pages.effects.study import settings_of

    return simulate(settings_of(SCENES[name], seed, TRAIN_FRAMES)).sequence


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


def real(folders: list[Path]) -> dict[str, Any]:
    """Verdicts and plans on folders; results of other clips are kept."""
    from endotsr.clips.effects.inspect import inspect_sequence, inspection_record
    from endotsr.clips.effects.plan import make_plan, plan_record

    file = RESULTS / FILES["real"]
    found = read_json(file, "docs/pages/effects/page.py real")["clips"] if file.exists() else {}
    for folder in folders:
        sinus = effects_sinus.is_sinus(folder)
        read_clip = effects_sinus.read_sinus if sinus else _read_endonerf
        inspection = inspect_sequence(read_clip(folder))
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
        name: make(found[file]) if file in found else f"Not measured yet: `python docs/make.py effects {file}`."
        for name, (make, file) in makers.items()
    }


def read(folder: Path = RESULTS) -> dict[str, dict[str, Any]]:
    """The measurements that exist, by name. Raises: InputError if a file cannot be read, or if none exists."""
    found = {name: folder / file for name, file in FILES.items() if (folder / file).exists()}
    if not found:
        raise InputError(f"{folder}: holds no measurement; made by docs/pages/effects/page.py")
    return {name: read_json(path, f"docs/pages/effects/page.py {name}") for name, path in found.items()}


def main(words: list[str], page: Path = PAGE) -> None:
    """The command."""
    what, rest = (words[0], words[1:]) if words else ("", [])
    if what not in COMMANDS and what:
        sys.exit(__doc__)
    try:
        if what:
            file = RESULTS / FILES[what]
            write_json(file, dated(COMMANDS[what](rest)))
            kept.finished(file)
        else:
            found = read()
            write_marked(page, fragments(found), "effects")
            if "train" in found:
                save(effects_parts.answer_figure(found["train"]), RESULTS / "effects.svg")
    except InputError as error:
        sys.exit(f"error: {error}")


def _number(words: list[str], place: int, usual: int | None) -> Any:
    """The number at an index of the words. Raises: InputError unless it is a whole number of at least 0."""
    if len(words) <= place:
        return usual
    if not words[place].isdigit():
        raise InputError(f"{words[place]!r} is not allowed; allowed: a whole number")
    return int(words[place])


COMMANDS: dict[str, Callable[[list[str]], dict[str, Any]]] = {
    "detect": lambda words: detect(_number(words, 0, SEEDS), _number(words, 1, None)),
    "train": lambda words: train(_number(words, 0, SEEDS), words[1:]),
    "truth": lambda words: effects_truth.truth(
        RESULTS / FILES["truth"], _number(words, 0, SEEDS), _number(words, 1, effects_truth.ITERATIONS)
    ),
    "real": lambda words: real([Path(word) for word in words]),
}
