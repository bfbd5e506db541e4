"""Measure what `endotsr inspect` finds and what `--effects auto` saves, and write the tables of docs/effects.md.

    python docs/pages/effects.py detect [SEEDS]              simulated clips: detections, false positives
    python docs/pages/effects.py train [SEEDS [SCENE ...]]   held-out PSNR and time, `auto` against `everything`
    python docs/pages/effects.py real FOLDER ...             verdicts on EndoNeRF folders and on `sinus_endoscopy`
    python docs/pages/effects.py                             write the page from docs/results

`endotsr bench effects --json docs/results/bench_effects.json` measures the time of the parts.
"""

import sys
import time
from pathlib import Path
from typing import Any

import effects_parts
import effects_sinus
from marks import read_json, write_marked

from endotsr.bench.suite import dated
from endotsr.errors import InputError
from endotsr.runs.files import write_json

DOCS = Path(__file__).parents[1]
PAGE, RESULTS = DOCS / "effects.md", DOCS / "results"
FILES = {
    "detect": "effects_detect.json", "train": "effects_train.json", "real": "effects_real.json",
    "bench": "bench_effects.json",
}  # fmt: skip
SEEDS, FRAMES, TRAIN_FRAMES, ITERATIONS = 5, 40, 24, 400
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


def detect(seeds: int) -> dict[str, Any]:
    """The study of the tests."""
    from endotsr.effects.study import run_study

    return run_study(seeds, FRAMES, print)


def train(seeds: int, names: list[str]) -> dict[str, Any]:
    """Every named scene (none = all) with both settings: tissue PSNR, processor time, numbers of a Gaussian."""
    from endotsr.api import make_config
    from endotsr.api import train as fit
    from endotsr.effects.study import settings_of
    from endotsr.kernels.threads import use_threads
    from endotsr.simulator.simulate import simulate

    use_threads(1)
    first = simulate(settings_of(SCENES["everything"], 0, TRAIN_FRAMES)).sequence
    fit(first, make_config("demo", iterations=20, training={"threads": 1}), on_message=print)  # loads the kernels
    scenes: dict[str, list[dict[str, Any]]] = {}
    for seed in range(seeds):
        for name in names or SCENES:
            sequence = simulate(settings_of(SCENES[name], seed, TRAIN_FRAMES)).sequence
            scenes.setdefault(name, []).append(_pair(sequence, seed))
            print(name, seed, scenes[name][-1], flush=True)
    return {"seeds": seeds, "frames": TRAIN_FRAMES, "iterations": ITERATIONS, "scenes": scenes}


def _pair(sequence: Any, seed: int) -> dict[str, Any]:
    """Both settings on one clip."""
    from endotsr.api import make_config
    from endotsr.api import train as fit
    from endotsr.effects.auto import planned_settings
    from endotsr.effects.savings import numbers_of_a_gaussian

    everything = make_config("demo", iterations=ITERATIONS, training={"seed": seed, "threads": 1})
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
    """Verdicts and plans on folders; a folder that cannot be read is an error."""
    from endotsr.config import PAPER
    from endotsr.effects.inspect import inspect_sequence, inspection_record
    from endotsr.effects.plan import make_plan, plan_record

    found = {}
    for folder in folders:
        sinus = effects_sinus.is_sinus(folder)
        read_clip = effects_sinus.read_sinus if sinus else _read_endonerf
        inspection = inspect_sequence(read_clip(folder))
        found[folder.name] = inspection_record(inspection) | {"plan": plan_record(make_plan(inspection, PAPER))}
    return {"clips": found}


def _read_endonerf(folder: Path) -> Any:
    from endotsr.config import PAPER
    from endotsr.sequences.endonerf import read_endonerf

    return read_endonerf(folder, PAPER.sequence, PAPER.raster.near)


def fragments(found: dict[str, dict[str, Any]]) -> dict[str, str]:
    """Every generated part of the page by name; a part without its measurement says so."""
    makers = {
        "costs": (effects_parts.costs, "bench"),
        "detections": (effects_parts.detections, "detect"),
        "amplitudes": (effects_parts.amplitudes, "detect"),
        "training": (effects_parts.training, "train"),
        "real": (effects_parts.real, "real"),
    }
    return {
        name: make(found[file]) if file in found else f"Not measured yet: `python docs/pages/effects.py {file}`."
        for name, (make, file) in makers.items()
    }


def read(folder: Path = RESULTS) -> dict[str, dict[str, Any]]:
    """The measurements that exist, by name. Raises: InputError if a file cannot be read, or if none exists."""
    found = {name: folder / file for name, file in FILES.items() if (folder / file).exists()}
    if not found:
        raise InputError(f"{folder}: holds no measurement; made by docs/pages/effects.py")
    return {name: read_json(path, f"docs/pages/effects.py {name}") for name, path in found.items()}


def main(words: list[str], page: Path = PAGE) -> None:
    """The command."""
    what, rest = (words[0], words[1:]) if words else ("", [])
    if what not in ("", "detect", "train", "real"):
        sys.exit(__doc__)
    if what == "real":
        write_json(RESULTS / FILES[what], dated(real([Path(word) for word in rest])))
    elif what:
        seeds = int(rest[0]) if rest else SEEDS
        result = detect(seeds) if what == "detect" else train(seeds, rest[1:])
        write_json(RESULTS / FILES[what], dated(result))
    else:
        try:
            write_marked(page, fragments(read()), "effects")
        except InputError as error:
            sys.exit(f"error: {error}")


if __name__ == "__main__":
    main(sys.argv[1:])
