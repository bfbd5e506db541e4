"""The runs of a sweep and the state of their folders.

In: a checked spec, the folder of the sweep and its sequences. Out: one `Job` per run with its settings, name and
folder. A job is self-contained: another process or machine can execute it.
"""

import contextlib
from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

import msgspec

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import Config, lengthened, with_settings
from endotsr.errors import InputError
from endotsr.studies.sweeps.spec import Configuration, Spec, Start, split_name, split_settings
from endotsr.training.runs.files import read_json
from endotsr.training.runs.folder import RunFolder, open_run
from endotsr.training.runs.records import StartPart
from endotsr.training.runs.sources import SIMULATED, check_same_input, load_sequence
from endotsr.untrusted.json import Keys
from endotsr.untrusted.sections import checked
from endotsr.untrusted.toml import by_key

if TYPE_CHECKING:
    from endotsr.clips.sequences.sequence import Sequence
    from endotsr.training.fitting.state import TrainingState

RUNS, SHARED = "runs", "shared"  # folders of the runs, and of shared initial checkpoints
STOP = "sweep.stop"  # a file that stops the workers of a sweep


class Beginning(Protocol):
    """An initial state other than the initialisation; the process that executes the run creates it."""

    def about(self) -> StartPart:
        """The entry `start` of run.json."""
        ...

    def state(self, sequence: "Sequence", config: Config) -> "TrainingState":
        """The state. Raises InputError if it cannot be created."""
        ...


class Job(NamedTuple):
    """One run of a sweep."""

    name: str  # unique in the sweep; also the name of its folder
    sequence: str  # name of the sequence in tables
    source: str  # folder of the sequence, or `simulated`
    split: str
    configuration: str
    seed: int
    config: Config
    simulator: SimulatorSettings
    folder: str  # absolute path of the run folder
    start: Start | Beginning | None = None
    measures: tuple[str, ...] = ()
    lpips: str | None = None
    keep_checkpoints: bool = True
    measured: bool = True  # False: the run ends with its training

    @property
    def input_key(self) -> str:
        """Key that is equal for jobs with the same sequence and reader settings."""
        return f"{self.source} {msgspec.json.encode([self.config.sequence, self.config.raster.near]).decode()}"

    @property
    def shared_checkpoint(self) -> Path:
        """The checkpoint of `start`, for a run that starts from another configuration."""
        assert isinstance(self.start, Start)
        parts = (self.sequence, self.split, self.start.configuration, f"seed{self.seed}", str(self.start.iteration))
        return Path(self.folder).parents[1] / SHARED / f"{file_word('-'.join(parts))}.npz"


def file_word(name: str) -> str:
    """A name as part of a file name."""
    return name.replace(" ", "_")


def sequence_names(sources: tuple[str, ...]) -> dict[str, str]:
    """Source -> folder name, used in tables. Raises InputError if two folders have the same name."""
    names = {source: source if source == SIMULATED else Path(source).name for source in sources}
    for source, name in names.items():
        twice = [other for other in sources if other != source and names[other] == name]
        if twice:
            raise InputError(f"{source} and {twice[0]}: two sequences are called {name}; use different names")
    return names


def jobs_of(spec: Spec, out: Path, training_frames: Callable[[Job], int]) -> list[Job]:
    """Every run of a sweep. Runs with the first seed come first: a sweep stopped early covers every configuration.

    training_frames   number of training frames of a job's sequence; the length of a run can depend on it
    Raises:           InputError for an unusable sequence, or two runs of the same name.
    """
    names, jobs = sequence_names(spec.sequences), []
    for seed, source, split, configuration in product(
        spec.seeds, spec.sequences, spec.splits or ("",), spec.configurations
    ):
        job = _job(spec, configuration, names[source], source, split, seed, out)
        jobs.append(_lengthened(job, training_frames(job)))
    seen: set[str] = set()
    for job in jobs:
        if job.name.lower() in seen:
            raise InputError(f"{job.name}: two runs have this name; use names that differ in more than case")
        seen.add(job.name.lower())
    return jobs


def _job(spec: Spec, configuration: Configuration, name: str, source: str, split: str, seed: int, out: Path) -> Job:
    config = _of_run(configuration.config, split, seed)
    shown = split_name(config.sequence)
    run = file_word(f"{name}-{shown}-{configuration.name}-seed{seed}")
    start = None
    if configuration.start is not None:
        other, iteration = configuration.start.configuration, configuration.start.iteration
        found = next(c for c in spec.configurations if c.name == other)
        start = Start(_of_run(found.config, split, seed), other, iteration)
    return Job(
        run, name, source, shown, configuration.name, seed, config, spec.simulator,
        str(out.absolute() / RUNS / run), start, spec.measures, spec.lpips, spec.keep_checkpoints,
    )  # fmt: skip


def _of_run(config: Config, split: str, seed: int) -> Config:
    """The settings with the split and seed of a run."""
    return with_settings(config, sequence=split_settings(split) if split else {}, training={"seed": seed})


def _lengthened(job: Job, training_frames: int) -> Job:
    start = job.start
    if isinstance(start, Start):
        start = start._replace(config=lengthened(start.config, training_frames))
    return job._replace(config=lengthened(job.config, training_frames), start=start)


def finished_folder(job: Job) -> RunFolder | None:
    """The folder of a run that is fully trained and evaluated; None if work is left.

    Raises: InputError if the folder contains a run with other settings, or no run.
    """
    path = Path(job.folder)
    if not path.exists():
        return None
    folder = open_run(path)
    refuse_other_settings(job, folder)
    with contextlib.suppress(InputError):  # a record that cannot be read
        if folder.record().get("status") == "finished" and (not job.measured or measured_at_the_end(job)):
            return folder
    return None


def measured_at_the_end(job: Job) -> bool:
    """Whether metrics.json is of the last iteration, not of an earlier checkpoint."""
    with contextlib.suppress(InputError):
        found = read_json(Path(job.folder) / "metrics.json", ("run.iteration",))
        return found["run"]["iteration"] == job.config.training.iterations
    return False


def refuse_other_clip(finished: list[Job]) -> None:
    """Raises InputError if a finished run was trained on other frames than its sequence has today.

    The arrays are read and compared only where a file differs: a comment in sequence.toml changes no array.
    """
    from endotsr.clips.sequences.read import file_hashes

    files: dict[str, dict[str, str]] = {}  # by input_key
    frames: dict[str, Sequence] = {}  # the latest clip alone: each is whole in memory
    for job in finished:
        run, key = open_run(Path(job.folder)), job.input_key
        before = run.record().get("input", {}).get("files_sha256")
        if job.source == SIMULATED or not before:
            continue
        if key not in files:
            files[key] = file_hashes(Path(job.source), job.config.sequence)
        if before != files[key]:
            if key not in frames:
                frames = {key: load_sequence(job.source, job.config, job.simulator)}
            check_same_input(run, frames[key], job.source)


def refuse_other_settings(job: Job, folder: RunFolder) -> None:
    """Raises InputError if the folder contains a run with other settings than the job, beside preset and threads."""
    theirs, ours = by_key(msgspec.to_builtins(folder.config())), by_key(msgspec.to_builtins(job.config))
    with contextlib.suppress(InputError):  # a record that cannot be read ends this run alone, when it continues
        recorded, wanted = _beside_settings(job, folder)
        theirs, ours = theirs | recorded, ours | wanted
    for key, value in ours.items():
        if theirs[key] != value and key not in ("preset", "training.threads"):
            raise InputError(
                f"{folder.path}: contains a run with {key} = {theirs[key]!r}, but the sweep has {value!r}; use the"
                " original settings of the sweep, or another --out"
            )


def _beside_settings(job: Job, folder: RunFolder) -> tuple[Keys, Keys]:
    """Simulator and start of the run in a folder, and of the job. They are in run.json and not in config.toml."""
    record, start = folder.record(), job.start._asdict() if isinstance(job.start, Start) else {}
    simulator = checked(record.get("input", {}).get("simulator", {}), SimulatorSettings, str(folder.path))
    return _as_keys(job, record.get("start") or {}, simulator), _as_keys(job, start, job.simulator)


def _as_keys(job: Job, start: Mapping[str, object], simulator: SimulatorSettings) -> Keys:
    found = {f"start.{key}": start.get(key) for key in ("configuration", "iteration")}
    used = by_key(msgspec.to_builtins(simulator)) if job.source == SIMULATED else {}
    return found | {f"simulator.{key}": value for key, value in used.items()}
