"""`endotsr train`: a sequence in, a run folder out."""

import contextlib
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.options import asked_settings, base_settings, differences, parse, with_short_names
from endotsr.cli.parts.stopping import finishing, stop_asked
from endotsr.config import PAPER, PRESETS, Config
from endotsr.errors import InputError
from endotsr.runs.files import os_error_line
from endotsr.runs.folder import RunFolder, create_run, open_run, refuse_existing
from endotsr.runs.log import RunLog
from endotsr.runs.machine import now, peak_memory_bytes
from endotsr.simulator.settings import SimulatorSettings

if TYPE_CHECKING:
    from endotsr.sequences.sequence import Sequence

RESUMABLE = {"training.threads"}  # settings that may differ in a resumed run: they change no number
DEMONSTRATION = SimulatorSettings()


class RunStopped(InputError):
    """The file system refused in the middle of a run."""


@dataclass
class TrainOptions:
    """Train on an EndoNeRF folder (or on the word `simulated`), evaluate, and write a run folder.

    Settings come from the preset, then the TOML file, then the command line. `--resume` continues the run in --out
    from its last checkpoint to the same result, bit for bit.
    """

    sequence: Annotated[str, Option("SEQUENCE", positional=True)] = ""
    """EndoNeRF folder, or `simulated`; with --resume the default is the sequence of the run"""
    out: Annotated[Path | None, Option("RUN")] = None
    """run folder to create (required)"""
    config: Annotated[Path | None, Option("FILE.toml")] = None
    """settings to start from"""
    iterations: Annotated[int | None, Option("N")] = None
    """length of the run; stretches the schedule"""
    schedule: Literal["stretched", "absolute"] = "stretched"
    """with --iterations: milestones keep their fraction of the run, or stay at their iterations"""
    scale: float | None = None
    """image scale (= --sequence.scale)"""
    frames: Annotated[str | None, Option("A:B[:S]")] = None
    """frame range (= --sequence.frames)"""
    masks: Annotated[str | None, Option("{masks,gt_masks}")] = None
    """mask folder (= --sequence.masks)"""
    seed: int | None = None
    """seed of every random draw (= --training.seed)"""
    threads: int | None = None
    """threads, 0 = all cores (= --training.threads)"""
    resume: bool = False
    """continue the run in --out"""
    evaluate: bool = True
    """measure, render and report when training is done"""
    lpips: Annotated[Path | None, Option("FILE")] = None
    """AlexNet LPIPS weights for the evaluation"""
    settings: Annotated[Config, Option(flat=True)] = PAPER
    simulator: SimulatorSettings = DEMONSTRATION
    """what `simulated` shows"""


def run(words: list[str]) -> int:
    """The command."""
    base, schedule_note = base_settings(words)
    options = parse(TrainOptions, words, "train", TrainOptions(settings=base))
    if options.out is None:
        raise InputError("train: --out RUN is missing: the run folder to create")
    if options.evaluate:
        check_lpips(options.lpips)
    if options.resume:
        folder, sequence = _resume(options.out, options.sequence, words)
    else:
        if not options.sequence:
            raise InputError("train: SEQUENCE is missing: an EndoNeRF folder, or the word `simulated`")
        folder, sequence = train_new(
            options.out, options.sequence, _settings(options), options.simulator, words, schedule_note
        )
    if options.evaluate:
        from endotsr.cli.evaluate import evaluate_run

        evaluate_run(folder, sequence, lpips=options.lpips)
    return 0


def check_lpips(path: Path | None) -> None:
    """Raises InputError for LPIPS weights that cannot be used: before a training, not after it."""
    from endotsr.evaluation.lpips import load_lpips_weights

    load_lpips_weights(path)


def _settings(options: TrainOptions) -> Config:
    names = ("scale", "frames", "masks", "seed", "threads")
    return with_short_names(options.settings, {name: getattr(options, name) for name in names})


def train_new(
    out: Path, source: str, config: Config, simulator: SimulatorSettings, words: list[str], schedule_note: str = ""
) -> tuple[RunFolder, "Sequence"]:
    """Check everything, create the run folder, train to the end."""
    from endotsr.fitting.state import new_training
    from endotsr.kernels.threads import use_threads
    from endotsr.runs.record import new_record
    from endotsr.runs.sources import input_record, load_sequence, sequence_record

    refuse_existing(out)
    sequence = load_sequence(source, config, simulator)
    _say_settings(config, schedule_note)
    _say_sequence(source, sequence)
    threads = use_threads(config.training.threads)
    print("starting", flush=True)
    state = new_training(sequence, config)
    about = input_record(source, sequence, config, simulator)
    record = new_record(["endotsr", "train", *words], config, threads, about)
    folder = create_run(out, config, record, sequence_record(sequence))
    try:
        with folder.locked():
            train_on(folder, state, sequence, config)
    except RunStopped as stopped:
        if folder.checkpoint.exists():
            raise
        shutil.rmtree(folder.path, ignore_errors=True)  # nothing of use was written
        raise InputError(str(stopped).split(";")[0]) from None
    return folder, sequence


def _resume(out: Path, source: str, words: list[str]) -> tuple[RunFolder, "Sequence"]:
    from endotsr.fitting.state import new_training
    from endotsr.kernels.threads import use_threads
    from endotsr.runs.model import load_training
    from endotsr.runs.sources import check_same_input, load_sequence, run_source

    folder = open_run(out)
    kept = folder.config()
    base = asked_settings(words, kept)
    remembered, simulator = run_source(folder)
    options = parse(TrainOptions, words, "train", TrainOptions(settings=base, simulator=simulator))
    asked = _settings(options)
    refused = [line for line in differences(asked, kept, "run") if line.split(" = ")[0] not in RESUMABLE]
    if refused:
        raise InputError(f"{out}: a resumed run keeps the settings of its config.toml; asked: {', '.join(refused)}")
    source = source or remembered
    sequence = load_sequence(source, kept, options.simulator)
    check_same_input(folder, sequence, source)
    threads = use_threads(asked.training.threads)
    with folder.locked():
        folder.remove_leftovers()
        state = load_training(folder, kept) if folder.checkpoint.exists() else new_training(sequence, kept)
        print(f"resuming {out} after iteration {state.iteration} of {kept.training.iterations}", flush=True)
        if state.iteration < kept.training.iterations:
            entry = {"after_iteration": state.iteration, "started": now(), "threads": threads}
            folder.update(status="running", resumed=[*folder.record().get("resumed", []), entry])
            train_on(folder, state, sequence, kept)
    return folder, sequence


def train_on(folder: RunFolder, state: Any, sequence: "Sequence", config: Config) -> Any:
    """Train from `state` to the end, with log, checkpoints and progress; returns the last state.

    A signal lets the iteration in hand end and writes a checkpoint, so that nothing is lost; a second signal, or an
    iteration that takes too long, falls back to the last checkpoint.

    Raises:  KeyboardInterrupt or RunStopped (a full disk) with a line that says how to go on; the last checkpoint
             and the log up to it are whole in both cases. FloatingPointError if the loss is not finite.
    """
    from endotsr.cli.parts.progress import Progress
    from endotsr.fitting.compile_ahead import compile_ahead
    from endotsr.fitting.trainer import train
    from endotsr.runs.model import save_training

    log = RunLog(folder.log, state.iteration)
    progress = Progress(config.training.iterations, state.iteration)
    offset, began = log.seconds, time.monotonic()
    last_tick = began
    saved = state.iteration if folder.checkpoint.exists() else None
    whole = False  # whether the run was stopped between two iterations

    def on_iteration(entry: dict[str, Any]) -> None:
        nonlocal last_tick, whole
        tick = time.monotonic()
        log.append(entry | {"seconds": round(tick - last_tick, 5)})
        last_tick = tick
        progress.update(entry)
        if stop_asked():
            whole = True
            raise KeyboardInterrupt

    def on_checkpoint(reached: Any) -> None:
        nonlocal saved
        save_training(folder, reached, config)
        saved = reached.iteration
        folder.update(iterations_done=saved, lambda_lap=reached.lambda_lap, **_costs(offset, began))

    try:
        with finishing():
            compile_ahead(config, progress.say)
            last = train(state, sequence, config, on_iteration, on_checkpoint, on_message=progress.say)
        if saved != last.iteration:
            on_checkpoint(last)
        folder.update(status="finished", finished=now(), iterations_done=last.iteration, **_costs(offset, began))
    except (KeyboardInterrupt, Exception) as error:
        if isinstance(error, KeyboardInterrupt) or stop_asked():
            if whole:
                with contextlib.suppress(OSError, KeyboardInterrupt):  # the checkpoint before is still there
                    progress.say(f"stopping after iteration {state.iteration}, writing a checkpoint")
                    on_checkpoint(state)
            _mark(folder, "interrupted")
            raise KeyboardInterrupt(_way_on(folder, saved)) from None
        _mark(folder, "failed")
        if isinstance(error, OSError):
            raise RunStopped(f"{os_error_line(error, folder.path)}; {_way_on(folder, saved)}") from None
        raise
    finally:
        progress.close()
        log.close()
    return last


def _way_on(folder: RunFolder, saved: int | None) -> str:
    kept = f"the checkpoint of iteration {saved} is kept" if saved else "no checkpoint yet, it starts again"
    return f"{kept}; continue with `endotsr train --out {folder.path} --resume`"


def _mark(folder: RunFolder, status: str) -> None:
    try:
        folder.update(status=status)
    except OSError:
        pass  # a full disk cannot take the note either


def _costs(offset: float, began: float) -> dict[str, Any]:
    return {"seconds": round(offset + time.monotonic() - began, 2), "peak_memory_bytes": peak_memory_bytes()}


def _say_settings(config: Config, schedule_note: str) -> None:
    changed = differences(config, PRESETS[config.preset], config.preset)
    print(f"settings: preset {config.preset}{', except' if changed else ''}")
    for line in changed:
        print(f"  {line}")
    if schedule_note:
        print(schedule_note)


def _say_sequence(source: str, sequence: "Sequence") -> None:
    print(
        f"sequence: {source}, {sequence.count} frames of {sequence.width}x{sequence.height}, "
        f"{len(sequence.train_index)} for training, {len(sequence.test_index)} held out"
    )
    for note in sequence.notes:
        print(f"  {note}")
    print(end="", flush=True)
