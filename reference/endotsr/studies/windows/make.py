"""Training of the windows of a recording: cold windows independently, each warm window after its neighbour.

In: a folder with windows.json and config.toml, and a function that executes runs (`sweeps.place`). Out: one run folder
per window. A chain is a cold window and the warm windows that follow it. The first windows of all chains are trained
together, then the second, and so on. A failed window is reported and stops no other; a warm window whose neighbour
failed starts cold. Finished windows are kept; unfinished ones continue from their checkpoints.
"""

import contextlib
from pathlib import Path

from endotsr.clips.sequences.splits import split_frames
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import Config, config_to_toml, lengthened, load_config, with_iterations, with_settings
from endotsr.errors import InputError
from endotsr.studies.sweeps.execute import FAILED, FINISHED, Outcome
from endotsr.studies.sweeps.jobs import Job, finished_folder
from endotsr.studies.sweeps.locks import file_lock
from endotsr.studies.sweeps.place import Size
from endotsr.studies.sweeps.sweep import Outcomes, Reporter, Watch, as_they_end
from endotsr.studies.windows.carry import CarriedStart
from endotsr.studies.windows.evaluation import WindowCost
from endotsr.studies.windows.plan import Wanted, check_wanted, planned_windows
from endotsr.studies.windows.record import FOLDER, Window, WindowsRecord, read_record, write_record
from endotsr.studies.windows.survey import survey
from endotsr.training.runs.folder import open_run, refuse_existing, resume_command
from endotsr.training.runs.log import last_entry, last_iteration
from endotsr.untrusted.writing import replacing_folder

LOCK = "windows.lock"
SETTINGS = "config.toml"
VISITS = 36  # minimum iterations of a cold window per training frame, unless the length is given
WARM = 0.4  # iterations of a warm window as a fraction of a cold one; its schedule is compressed


def plan_recording(source: Path, config: Config, wanted: Wanted, out: Path) -> WindowsRecord:
    """Survey a recording and write the run folder with its window plan; train nothing.

    Raises: InputError for unusable settings, recording or folder, and if no window remains.
    """
    refuse_existing(out)
    check_wanted(wanted, config.sequence)
    found = survey(source, config.sequence)
    windows, left_out = planned_windows(found, wanted, config.sequence)
    if not windows:
        raise InputError(f"{source}: no window remains: {left_out[0].reason}")
    record = WindowsRecord(
        source=str(source.resolve()), frames=len(found), overlap=wanted.overlap, chain=wanted.chain,
        windows=windows, left_out=left_out,
    )  # fmt: skip
    out.absolute().parent.mkdir(parents=True, exist_ok=True)
    with replacing_folder(out, replace=False) as folder:
        (folder / SETTINGS).write_text(config_to_toml(config), encoding="utf-8", newline="\n")
        write_record(folder, record)
    return record


def with_visits(config: Config) -> Config:
    """The settings with at least 36 iterations per training frame.

    Preset `demo` trains a window of 48 frames with 36 per frame. With 14 per frame such a window is underfitted (B18).
    """
    return with_settings(config, training={"visits_per_frame": max(VISITS, config.training.visits_per_frame)})


def window_length(config: Config, training_frames: int) -> Config:
    """The settings with the length of a window: `lengthened`, but at least min(36, visits) iterations per frame.

    `lengthened` grows more slowly beyond 64 frames; a window keeps this minimum per frame (B18).
    """
    found, least = lengthened(config, training_frames), min(VISITS, config.training.visits_per_frame) * training_frames
    return found if found.training.iterations >= least else with_iterations(config, least)


def recording_settings(run: Path) -> Config:
    """The settings of a run of windows; `window_job` adds the frames and length of each window."""
    return load_config(run / SETTINGS)


def window_folder(run: Path, window: Window) -> Path:
    """The run folder of a window."""
    return Path(run).absolute() / FOLDER / window.name


def make_windows(run: Path, outcomes: Outcomes, reporter: Reporter) -> list[Outcome]:
    """Train every unfinished window; returns one outcome per window, in order.

    The job of a warm window is created after its neighbour's training, because the neighbour's final number of
    Gaussians is its `density.maximum`.

    outcomes   executes jobs
    Raises:    InputError for an unusable folder, one that another process trains, and a full disk; KeyboardInterrupt
               with a line on how to continue.
    """
    run = Path(run)
    record, config = read_record(run), recording_settings(run)
    found: dict[str, Outcome] = {}
    (run / FOLDER).mkdir(exist_ok=True)
    with file_lock(run / LOCK, f"{run}: another process trains these windows; wait until it ends, or stop it"):
        jobs = [window_job(run, record, k, config) for k in range(len(record.windows))]
        watch = Watch([job for job in jobs if finished_folder(job) is None])
        reporter.begin(watch.total)
        try:
            for wave in waves(record):
                todo = [window_job(run, record, k, config, cold=_starts_cold(jobs[k], found, reporter)) for k in wave]
                _made(record, todo, outcomes, reporter, watch, found)
        except KeyboardInterrupt:
            done = sum(outcome.status == FINISHED for outcome in found.values())
            raise KeyboardInterrupt(
                f"{done} of {len(jobs)} windows are finished; continue with `{resume_command(run)}`"
            ) from None
    return [found[job.name] for job in jobs]


def waves(record: WindowsRecord) -> list[list[int]]:
    """Window numbers grouped by position in their chains; windows of one wave are independent."""
    found: list[list[int]] = []
    place = 0
    for k, window in enumerate(record.windows):
        place = place + 1 if window.start == "warm" else 0
        found += [[]] if place == len(found) else []
        found[place].append(k)
    return found


def window_job(run: Path, record: WindowsRecord, k: int, config: Config, *, cold: bool = False) -> Job:
    """The job of window k.

    cold   start cold although the plan is warm; a window that was begun cold stays cold
    """
    window, folder = record.windows[k], window_folder(run, record.windows[k])
    config = with_settings(config, sequence={"frames": frame_range(config.sequence.frames, window)})
    train, _ = split_frames(window.count, config.sequence.split, config.sequence.block_length)
    own, start = window_length(config, len(train)), None
    begun_cold = (folder / "run.json").exists() and "start" not in open_run(folder).record()
    if window.start == "warm" and not cold and not begun_cold:
        own, start = _carried(run, record, k, own)
    return Job(
        window.name, Path(record.source).name, record.source, "", "window", own.training.seed, own, SimulatorSettings(),
        str(folder), start, measured=False,
    )  # fmt: skip


def _carried(run: Path, record: WindowsRecord, k: int, cold: Config) -> tuple[Config, CarriedStart]:
    """The settings of warm window k, from those of a cold start, and what it takes from its neighbour."""
    window, neighbour, shorter = record.windows[k], record.windows[k - 1], warm_settings(cold)
    source, saved = window_folder(run, neighbour), cold.training.iterations - shorter.training.iterations
    start = CarriedStart(str(source), window.first - neighbour.first, record.shared(k), saved)
    ended = last_entry(source / "log.jsonl")
    return no_larger(shorter, ended["gaussians"] if ended else None), start


def warm_settings(cold: Config) -> Config:
    """The settings of a warm window: a compressed schedule, with residuals and all harmonic degrees from the start."""
    shorter = with_iterations(cold, max(1, round(WARM * cold.training.iterations)))
    whole = {"residual_activation": 0, "harmonics_interval": 1, "coarse_start": False}
    return with_settings(shorter, training=whole)


def no_larger(config: Config, gaussians: int | None) -> Config:
    """The settings with at most `gaussians` Gaussians, the neighbour's final number; unchanged if it is None.

    Without this bound each window of a chain would add Gaussians, and memory and time would grow along the chain.
    """
    if gaussians is None or gaussians >= config.density.maximum:
        return config
    return with_settings(config, density={"maximum": max(1, gaussians)})


def size_of(job: Job) -> Size:
    """The size of a window; reads the first picture of the folder."""
    from endotsr.clips.sequences.layouts import describe

    first, end, step = (int(word) for word in job.config.sequence.frames.split(":"))
    intrinsics, scale = describe(Path(job.source)).intrinsics, job.config.sequence.scale
    assert intrinsics is not None
    return Size(len(range(first, end, step)), round(intrinsics.width * scale), round(intrinsics.height * scale))


def frame_range(selected: str, window: Window) -> str:
    """The frames of a window as a range of the whole sequence; `selected` is the range of the recording.

    Raises: InputError if `selected` begins with a negative frame: the length of the folder is not known here.
    """
    words = [int(word) if word.strip() else None for word in selected.split(":")] if selected.strip() else []
    first, _, step = (*words, None, None, None)[:3]
    if (first or 0) < 0:
        raise InputError(f"train: --frames {selected!r} with --windows: use a first frame that is not negative")
    first, step = first or 0, step or 1
    return f"{first + window.first * step}:{first + (window.end - 1) * step + 1}:{step}"


def _starts_cold(job: Job, found: dict[str, Outcome], reporter: Reporter) -> bool:
    """Whether a warm window that is not begun has no finished neighbour; reports it."""
    if not isinstance(job.start, CarriedStart) or Path(job.folder).exists():
        return False
    neighbour = Path(job.start.folder).name
    if found[neighbour].status == FINISHED:
        return False
    reporter.say(f"window {job.name}: window {neighbour} is not finished; starting cold")
    return True


def _made(
    record: WindowsRecord,
    jobs: list[Job],
    outcomes: Outcomes,
    reporter: Reporter,
    watch: Watch,
    found: dict[str, Outcome],
) -> None:
    """Execute the jobs of one wave; add their outcomes to `found`."""
    left = []
    for job in jobs:
        if finished_folder(job) is None:
            left.append(job)
        else:
            found[job.name] = Outcome(job.name, FINISHED)
    advice = lambda: "the same command with --resume continues"
    with contextlib.closing(as_they_end(left, outcomes, reporter, watch, advice)) as made:
        for outcome in made:
            found[outcome.name] = outcome
            job = next(job for job in left if job.name == outcome.name)
            reporter.say(_line(record.windows[int(job.name)], job, outcome))
    for job in left:  # a stopped pool yields no outcome
        found.setdefault(job.name, Outcome(job.name, FAILED, "not executed"))


def _line(window: Window, job: Job, outcome: Outcome) -> str:
    frames = f"{window.first}:{window.end}"  # of the recording, as in the plan
    if outcome.status != FINISHED:
        return f"window {job.name} (frames {frames}): {outcome.status}: {outcome.reason}"
    trained = window_cost(Path(job.folder))
    return f"window {job.name} (frames {frames}): {trained['iterations']} iterations in {trained['seconds']:.0f} s"


def window_cost(folder: Path) -> WindowCost:
    """Start, iterations, iterations saved, seconds and peak memory in bytes (None: unknown) of a window's training."""
    record = open_run(folder).record()
    start = record.get("start") or {}
    return {
        "start": "warm" if start else "cold",
        "iterations": last_iteration(folder / "log.jsonl"),
        "saved": int(start.get("iterations_saved", 0)),
        "seconds": float(record.get("seconds") or 0.0),
        "peak_memory_bytes": record.get("peak_memory_bytes"),
    }
