"""`endotsr train`: train on a sequence and write a run folder."""

import math
import shlex
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.options import (
    asked_settings,
    base_settings,
    differences,
    explicit_settings,
)
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.progress import Progress
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.config import PAPER, PRESETS, Config, lengthened, with_fixed_length
from endotsr.errors import InputError
from endotsr.studies.windows.record import is_windowed
from endotsr.training.runs.files import refuse_read_only
from endotsr.training.runs.folder import RunFolder, open_run, refuse_existing
from endotsr.training.runs.records import RunRecord
from endotsr.untrusted.names import counted

if TYPE_CHECKING:
    from endotsr.clips.sequences.forecast.work import Standing
    from endotsr.clips.sequences.sequence import Sequence

SHORT = ("sequence.scale", "sequence.frames", "sequence.masks", "training.seed", "training.threads")
RESUMABLE = {"training.threads"}  # settings that may differ in a resumed run: they do not affect results


@dataclass
class TrainOptions:
    """Train on a sequence folder, evaluate, and write a run folder.

    Later settings override earlier ones: preset, TOML file, command line. `--resume` continues the run in --out from
    its last checkpoint, with a bitwise equal result; with --iterations N it also extends a finished run.
    """

    sequence: Annotated[str, Option("SEQUENCE", positional=True)] = ""
    """sequence folder, or `simulated` for the scene of `demo` (with --resume, default: the recorded sequence)"""
    out: Annotated[Path | None, Option("RUN")] = None
    """run folder to create (required)"""
    config: Annotated[Path | None, Option("FILE.toml")] = None
    """initial settings"""
    iterations: Annotated[int | None, Option("N")] = None
    """exact length of the run; stretches the schedule. With --resume, a larger number extends the run"""
    minutes: Annotated[float | None, Option("M")] = None
    """choose length, points and Gaussians for M minutes of training on this machine"""
    schedule: Literal["stretched", "absolute"] = "stretched"
    """with --iterations: milestones keep their fraction of the run, or stay at their iterations"""
    effects: Literal["everything", "auto"] = "everything"
    """train all components of the settings, or only those that the clip needs (see `endotsr inspect`)"""
    windows: Annotated[str | None, Option("auto|N")] = None
    """divide a recording into windows of about N frames, or by motion and cuts; each is a run in RUN/windows"""
    overlap: int = 8
    """with --windows: number of frames shared by neighbours"""
    chain: int = 1
    """with --windows: length of a chain, whose windows except the first start from their neighbour; 1 = none do"""
    workers: Annotated[int | None, Option("N")] = None
    """with --windows: concurrent windows (default: as many as cores and free memory allow)"""
    scheduler: Annotated[str | None, Option("ADDRESS")] = None
    """with --windows: send them to the workers of this Dask scheduler; RUN and SEQUENCE must be on a shared disk"""
    resume: bool = False
    """continue the run in --out"""
    calibrate_only: bool = False
    """only compute the weight of equation (7) on the run in --out; settings that affect it, such as
    --loss.ssim-weight, may be changed"""
    evaluate: bool = True
    """evaluate, render and write the report after training"""
    lpips: Annotated[Path | None, Option("FILE")] = None
    """AlexNet LPIPS weights for the evaluation"""
    json: JsonFile = None
    """also write the metrics of the evaluation, or the calibration, as JSON"""
    settings: Annotated[Config, Option(flat=True, short=SHORT)] = PAPER


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.results.evaluation.lpips import load_lpips_weights

    base, schedule_note = base_settings(words)
    options = parse(TrainOptions, words, "train", TrainOptions(settings=base))
    if options.out is None:
        wanted = "the run that --resume continues" if options.resume else "the run folder to create"
        raise InputError(f"train: --out RUN is missing: {wanted}")
    if options.calibrate_only:
        return _calibrate(options, words)
    if options.evaluate:
        load_lpips_weights(options.lpips)  # raises for unusable weights before the training
    if options.resume:
        refuse_read_only(options.out)
    if options.windows is not None or (options.resume and is_windowed(options.out)):
        return _train_windows(options, words)
    if options.resume:
        folder, sequence, shown = _resume(options, words)
    else:
        folder, sequence, shown = _train_new(options, words, schedule_note)
    if options.evaluate:
        from endotsr.cli.evaluate import evaluate_run

        try:
            found = evaluate_run(folder, sequence, options.lpips, source=options.sequence or None, wait=True)
        except KeyboardInterrupt:
            command = shlex.join(["endotsr", "evaluate", str(folder.path), *_evaluation_words(options)])
            raise KeyboardInterrupt(f"the training is finished, its evaluation is not: `{command}` makes it") from None
        shown.remember_evaluation()
        write_result(options.json, **found)
    return 0


def _evaluation_words(options: TrainOptions) -> list[str]:
    """The options of the evaluation. They are no settings of the run, and a command that continues it needs them."""
    if not options.evaluate:
        return ["--no-evaluate"]
    files = (("--lpips", options.lpips), ("--json", options.json))
    return [word for name, file in files if file is not None for word in (name, str(file))]


def _train_windows(options: TrainOptions, words: list[str]) -> int:
    """Train the missing windows of a recording, and evaluate it."""
    from endotsr.cli.parts.windows import evaluate_windows, plan_windows, train_windows
    from endotsr.studies.sweeps.place import Place, check_place
    from endotsr.studies.windows.make import recording_settings, with_visits

    assert options.out is not None
    place = Place(options.workers, options.settings.training.threads or None, options.scheduler)
    check_place("train", place)
    if options.resume:
        _accepted_settings(options.out, words, recording_settings(options.out))
    else:
        named, config = explicit_settings(TrainOptions, words), options.settings
        if options.iterations is None and not named & {"training.iterations", "training.visits_per_frame"}:
            config = with_visits(config)
        plan_windows(options.sequence, options.out, config, options.windows or "", options.overlap, options.chain)
    code = train_windows(options.out, place)
    if options.evaluate and code == 0:
        write_result(options.json, **evaluate_windows(options.out, options.lpips, options.sequence or None, wait=True))
    return code


def _accepted_settings(out: Path, words: list[str], kept: Config, frames: int | None = None) -> Config:
    """The settings of a resumed run: `kept`, with the changes in the words.

    frames   number of training frames of the run; None: the run cannot be extended
    Raises:  InputError for changes that would affect results.
    """
    options = parse(TrainOptions, words, "train", TrainOptions(settings=base_settings(words)[0]))
    wanted = options.settings if frames is None else lengthened(options.settings, frames)
    asked = asked_settings(TrainOptions, words, wanted, kept)
    extended = frames is not None and asked.training.iterations > kept.training.iterations
    allowed = RESUMABLE | ({"training.iterations"} if extended else set())
    refused = [line for line in differences(asked, kept, "run") if line.split(" = ")[0] not in allowed]
    if refused:
        raise InputError(f"{out}: a resumed run keeps the settings of its config.toml; requested: {', '.join(refused)}")
    return asked


def _calibrate(options: TrainOptions, words: list[str]) -> int:
    """Evaluate equation (7) on the run in --out, with its settings except those changed in the words."""
    from endotsr.cli.parts.calibration import calibrate_run

    assert options.out is not None
    folder = open_run(options.out)
    config = parse(TrainOptions, words, "train", TrainOptions(settings=folder.config())).settings
    calibrate_run(folder, config, options.sequence or None, options.json)
    return 0


def _train_new(options: TrainOptions, words: list[str], schedule_note: str) -> tuple[RunFolder, "Sequence", Progress]:
    """Check everything, print the settings and the sequence, and train to the end."""
    from endotsr.clips.effects.auto import planned_settings
    from endotsr.clips.simulator.recorded import recorded_positions
    from endotsr.clips.simulator.settings import SimulatorSettings
    from endotsr.method.kernels.threads import use_threads
    from endotsr.training.runs.sources import SIMULATED, load_sequence, start_record
    from endotsr.training.runs.training import train_new_run

    _refuse_before_reading(options)
    assert options.out is not None
    config, source = options.settings, options.sequence
    sequence = load_sequence(source, config, SimulatorSettings())
    if options.evaluate and source != SIMULATED:
        recorded_positions(Path(source), sequence)  # raises for a damaged truth before the training
    threads = use_threads(config.training.threads)
    config, schedule_note = of_length(config, len(sequence.train_index), schedule_note)
    unit = None
    if options.minutes is not None:
        unit = _timed_unit(sequence, config)
        config, schedule_note = config_of_minutes(options.minutes, sequence, config, unit, threads)
    found: RunRecord = {}
    lines = ["effects: everything; `--effects auto` trains only the components that the clip needs"]
    if options.effects == "auto":
        config, lines, effects = planned_settings(sequence, config, explicit_settings(TrainOptions, words))
        found["effects"] = effects
    _print_settings(config, schedule_note)
    _print_sequence(source, sequence)
    for line in lines:
        print(line)
    shown = _progress(RunFolder(options.out), source, sequence, config, options, unit=unit)
    record = start_record(["endotsr", "train", *words], source, sequence, config, SimulatorSettings(), threads)
    again = shlex.join(_evaluation_words(options))
    folder = train_new_run(options.out, {**record, **found}, sequence, config, shown, again)
    shown.remember_speed()
    return folder, sequence, shown


def _refuse_before_reading(options: TrainOptions) -> None:
    """Raise InputError for options with which no new training can begin."""
    from endotsr.training.runs.files import refuse_inside
    from endotsr.training.runs.sources import SIMULATED

    if not options.sequence:
        raise InputError("train: SEQUENCE is missing: a sequence folder, or the word `simulated`")
    assert options.out is not None
    if options.minutes is not None and not 0 < options.minutes < math.inf:
        raise InputError(f"train: --minutes {options.minutes:g}: use a number > 0")
    refuse_existing(options.out)
    if options.sequence != SIMULATED:
        refuse_inside(options.out, Path(options.sequence), "the sequence")


def config_of_minutes(
    minutes: float, sequence: "Sequence", config: Config, unit: float, threads: int
) -> tuple[Config, str]:
    """The settings for the requested minutes, and a line on them; unit: seconds per unit of work with these threads."""
    from endotsr.clips.sequences.forecast.seconds import vector_factor
    from endotsr.clips.sequences.forecast.work import GAUSSIANS, at_start, iteration_work
    from endotsr.training.runs.pace import paced_for

    found = paced_for(minutes, sequence, config, unit, threads)
    pixels = sequence.width * sequence.height
    late = unit * float(iteration_work(GAUSSIANS, pixels, 1.0, vector_factor()))
    gaussians = max(found.density.maximum, at_start(found, pixels).gaussians)
    return found, (
        f"minutes: {minutes:g}; an iteration of 60 000 Gaussians takes {1e3 * late:.0f} ms: "
        f"{found.training.iterations} iterations, {gaussians} Gaussians"
    )


def _timed_unit(sequence: "Sequence", config: Config) -> float:
    """Seconds per unit of work, from a few iterations; compiles the kernels first, if that was not done."""
    from endotsr.training.fitting.compile_ahead import compile_ahead
    from endotsr.training.runs.pace import seconds_of_unit

    compile_ahead(config, print)
    return seconds_of_unit(sequence, config)


def _resume(options: TrainOptions, words: list[str]) -> tuple[RunFolder, "Sequence", Progress]:
    """Check the settings, and train a run from its last checkpoint to the end."""
    from endotsr.method.kernels.threads import use_threads
    from endotsr.training.runs.sources import check_same_input, current_source, load_sequence
    from endotsr.training.runs.training import extend_run, resume_run

    assert options.out is not None
    folder = open_run(options.out)
    kept = folder.config()
    source, simulator = current_source(folder, options.sequence)
    if options.workers is not None or options.scheduler is not None:
        raise InputError(f"{options.out}: --workers and --scheduler have no effect: it is no run of windows; omit them")
    asked = _accepted_settings(options.out, words, kept, len(folder.sequence_record().train_index))
    sequence = load_sequence(source, kept, simulator)
    check_same_input(folder, sequence, source)
    threads = use_threads(asked.training.threads)
    if asked.training.iterations > kept.training.iterations:
        extend_run(folder, asked.training.iterations)
        print(f"extended from {kept.training.iterations} to {asked.training.iterations} iterations")
    config = folder.config()
    shown = _progress(folder, source, sequence, config, options, _reached(folder, config))
    resume_run(folder, sequence, threads, shown, shlex.join(_evaluation_words(options)))
    return folder, sequence, shown


def _reached(folder: RunFolder, config: Config) -> "Standing":
    """The progress of a run, as far as its records tell it."""
    from endotsr.clips.sequences.forecast.work import at_start
    from endotsr.training.runs.log import last_entry

    first, entry = at_start(config), last_entry(folder.log) or {}
    done, count = folder.record().get("iterations_done") or 0, entry.get("gaussians")
    if not done or not isinstance(count, int):
        return first
    return first._replace(iteration=min(done, config.training.iterations), gaussians=max(count, 0))


def _progress(
    folder: RunFolder,
    source: str,
    sequence: "Sequence",
    config: Config,
    options: TrainOptions,
    at: "Standing | None" = None,
    unit: float | None = None,
) -> Progress:
    """The progress of a training, on standard error and as a page in its folder; prints what the command will take.

    at     progress of a run that is resumed; None = a new one
    unit   seconds per unit of work, if this command has timed it
    """
    import numba

    from endotsr.cli.parts.waiting import waiting_line
    from endotsr.clips.formats.files import has_truth
    from endotsr.clips.sequences.forecast.seconds import TimedCommand, frames_of, vector_factor
    from endotsr.results.evaluation.lpips import lpips_file
    from endotsr.results.report.live_page import LIVE_PAGE, LivePage
    from endotsr.training.fitting.compile_ahead import done_before
    from endotsr.training.runs.sources import SIMULATED
    from endotsr.training.runs.speed import ASSUMED, LEAST_PIXELS, known_speed

    frames, threads = frames_of(sequence.train_index, sequence.test_index), numba.get_num_threads()
    if source == SIMULATED or has_truth(Path(source)):
        frames = frames.with_true_motion()
    perceived = lpips_file(options.lpips) is not None if options.evaluate else None
    pixels = sequence.width * sequence.height
    timed = partial(_timed_unit, sequence, config) if pixels >= LEAST_PIXELS else None
    speed = known_speed(threads, timed if unit is None else lambda: unit)
    before = None if speed.source == ASSUMED else speed.unit
    plan = TimedCommand(config, frames, pixels, threads, perceived, vector_factor(), speed.beside, before)
    print(waiting_line(plan, speed, done_before(config).exists(), at))
    print(f"progress page: {folder.path / LIVE_PAGE}", flush=True)
    return Progress(plan, LivePage(folder, sequence, config))


def of_length(config: Config, frames: int, note: str) -> tuple[Config, str]:
    """The settings with the length of a run on `frames` training frames, and the line on its schedule."""
    found, before = lengthened(config, frames), config.training.iterations
    if (after := found.training.iterations) > before:
        note = (
            f"schedule: stretched from {before} to {after} iterations, {after / frames:.0f} per training frame "
            "(--iterations N trains exactly N)"
        )
    return found, note


def _print_settings(config: Config, schedule_note: str) -> None:
    from endotsr.training.fitting.schedules import phases_never_reached

    changed = differences(config, with_fixed_length(PRESETS[config.preset]), config.preset)
    print(f"settings: preset {config.preset}{', except' if changed else ''}")
    for line in changed:
        print(f"  {line}")
    if schedule_note:
        print(schedule_note)
    for phase in phases_never_reached(config):
        print(f"not in these {config.training.iterations} iterations: {phase}")


def _print_sequence(source: str, sequence: "Sequence") -> None:
    print(
        f"sequence: {source}, {counted(sequence.count, 'frame')} of {sequence.width}x{sequence.height}, "
        f"{len(sequence.train_index)} for training, {len(sequence.test_index)} held out"
    )
    for note in (*sequence.notes, *sequence.not_read):
        print(f"  {note}")
    print(end="", flush=True)
