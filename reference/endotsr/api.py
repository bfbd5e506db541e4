"""The Python interface: load a sequence, train, render, measure, save, open.

    import endotsr
    sequence = endotsr.load_sequence("my_sequence", scale=0.5)
    run = endotsr.train(sequence, preset="paper", iterations=2000)
    view = run.render(time=0.37)
    metrics = run.evaluate()
    run.save("runs/mine")
    run = endotsr.open_run("runs/mine")

Every function calls the code that the command of the same purpose calls, so that the numbers are the same, bit for
bit: `train` gives those of `endotsr train`, `Run.render` those of `endotsr render`, `Run.evaluate` those of
`endotsr evaluate`. The commands read a run folder that `Run.save` writes, and `open_run` reads one that a command
writes.

Import the names from `endotsr` itself; `endotsr.__all__` lists those that are stable. Input that cannot be used raises
an `InputError` that names the argument and the allowed values.
"""

import shutil
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import msgspec

from endotsr.config import (
    PAPER,
    Config,
    SequenceConfig,
    checked,
    config_from_dict,
    lengthened,
    merged,
    refuse_unknown_keys,
    with_iterations,
)
from endotsr.errors import InputError
from endotsr.fitting.records import LogEntry
from endotsr.runs import folder as run_folders
from endotsr.runs import sources
from endotsr.runs.log import RunLog, log_until
from endotsr.runs.machine import now, peak_memory_bytes
from endotsr.runs.model import Model, load_model, load_training, save_training
from endotsr.runs.records import ResumedEntry, RunRecord
from endotsr.sequences.record import SequenceRecord, record_of
from endotsr.sequences.sequence import Sequence
from endotsr.simulator.settings import SimulatorSettings
from endotsr.splatting.camera import Camera
from endotsr.splatting.render import RenderOut
from endotsr.untrusted.toml import read_toml

if TYPE_CHECKING:
    from endotsr.evaluation.records import EvaluationRecord
    from endotsr.export.scene import MovingScene
    from endotsr.fitting.state import TrainingState
    from endotsr.windows.run import WindowedRun

Component = Literal["appearance", "spectral_motion"]
OnIteration = Callable[[LogEntry], object]
OnRun = Callable[["Run"], object]
OnMessage = Callable[[str], object]


class StopTraining(Exception):
    """Raised by a callback, `on_iteration` or `on_run`: the training ends after this iteration; the run is returned."""


@dataclass(frozen=True, eq=False)
class LoadedSequence(Sequence):
    """A sequence of `load_sequence`, with the source and the settings that a run folder records."""

    source: str = sources.IN_MEMORY  # folder, or `simulated`
    settings: SequenceConfig = PAPER.sequence
    simulator: SimulatorSettings = field(default_factory=SimulatorSettings)


def make_config(
    preset: str | None = None,
    *,
    file: str | Path | None = None,
    iterations: int | None = None,
    **sections: Mapping[str, Any],
) -> Config:
    """All settings of a run: preset, then TOML file, then `iterations`, then the sections.

    preset       paper (default), sharp or demo
    file         TOML file, as `endotsr train --config`
    iterations   exact length of the run; every milestone keeps its fraction of the run. training={"iterations": n}
                 changes the length and leaves the milestones where they are. training={"visits_per_frame": v} makes a
                 run with more than n / v training frames longer
    sections     changes by section: model={"appearance": False}, training={"seed": 3, "threads": 2}

    Raises: InputError naming the file or the key, the value and what is allowed.
    """
    data = read_toml(Path(file)) if file is not None else {}
    if preset is not None:
        data = data | {"preset": preset}
    return _changed(config_from_dict(data, str(file or "configuration")), iterations, sections)


def load_sequence(
    source: str | Path,
    config: Config | None = None,
    *,
    simulator: Mapping[str, Any] | None = None,
    **settings: Any,
) -> LoadedSequence:
    """The whole sequence in memory, fully checked.

    source      sequence folder, or the word "simulated"
    config      settings to start from (section `sequence`, and the near plane); default: preset `paper`
    simulator   settings of "simulated": {"frames": 16, "width": 96, "pull": {"on": False}}
    settings    keys of the section `sequence`: scale=0.5, frames="0:60", masks="gt_masks", split="blocks"

    returns     images (n, 3, H, W) uint8; masks (n, H, W), True = tissue; depth (n, H, W) in scene units, 0 = none;
                times (n,) in [0, 1); cameras, split, and notes that state what was assumed

    Raises: InputError naming the file, the frame or the key, and what is allowed.
    """
    config = _changed(PAPER if config is None else config, None, {"sequence": settings})
    wanted = dict(simulator or {})
    refuse_unknown_keys(wanted, SimulatorSettings, "simulator")
    shown = checked(wanted, SimulatorSettings, "simulator")
    sequence = sources.load_sequence(str(source), config, shown)
    arrays = {entry.name: getattr(sequence, entry.name) for entry in fields(Sequence) if entry.init}
    return LoadedSequence(**arrays, source=str(source), settings=config.sequence, simulator=shown)


def train(
    sequence: Sequence,
    config: Config | None = None,
    *,
    preset: str | None = None,
    iterations: int | None = None,
    on_iteration: OnIteration | None = None,
    on_run: OnRun | None = None,
    on_message: OnMessage = print,
    effects: Literal["everything", "auto"] = "everything",
    **sections: Mapping[str, Any],
) -> "Run":
    """Train on a sequence; returns the trained run. The numbers are those of `endotsr train` with these settings.

    sequence       from `load_sequence`, whose settings apply; or a `Sequence` made of arrays
    config         from `make_config`; without it, preset, iterations and sections make the settings as there.
                   With it, iterations and sections are applied on top of it
    on_iteration   called after every iteration with its log entry: iteration, frame, loss, the terms of the loss,
                   gaussians, seconds, and every tenth time psnr. `raise StopTraining` in it ends the training. What it
                   returns is ignored
    on_run         called after it with the run, whose `model` and `render` are those of this iteration. Its arrays
                   change with the next one: copy what is kept, and write to none of them
    on_message     called with a line when kernels are compiled or the weight of equation (7) is calibrated
    effects        "auto" trains only what the clip needs, as `train --effects auto`; keys in `sections` stay

    The number of kernel threads of the calling thread is set to `training.threads` (0 = all cores).
    A KeyboardInterrupt ends the training at once, without a run; `StopTraining` keeps it.
    Raises: InputError for settings or a sequence that cannot be used; FloatingPointError naming iteration, frame and
            terms if the loss is not finite; CalibrationError if equation (7) has no answer.
    """
    from endotsr.fitting.state import new_training
    from endotsr.kernels.threads import use_threads

    if not isinstance(sequence, Sequence):
        raise InputError(f"train: sequence is {type(sequence).__name__}; allowed: a Sequence, as from load_sequence")
    if config is None:
        config = make_config(preset, file=None, iterations=iterations, **sections)
    elif preset is not None:
        raise InputError(f"train: preset = {preset!r} with a config is not allowed; allowed: one of the two")
    else:
        config = _changed(config, iterations, sections)
    loaded = isinstance(sequence, LoadedSequence)
    source, simulator = (sequence.source, sequence.simulator) if loaded else (sources.IN_MEMORY, SimulatorSettings())
    if loaded:
        config = msgspec.structs.replace(config, sequence=sequence.settings)
    config = lengthened(config, len(sequence.train_index))
    config, found = _called_for(sequence, config, effects, sections, on_message)
    state = new_training(sequence, config)
    threads = use_threads(config.training.threads)
    record = sources.start_record(["endotsr.train"], source, sequence, config, simulator, threads) | found
    seen = record_of(sequence)
    run = Run(config, record, seen, [], _model_of(state, config, seen), "", _sequence=sequence, _state=state)
    return run.resume(on_iteration, on_message, on_run)


def _called_for(
    sequence: Sequence, config: Config, effects: str, sections: Mapping[str, Mapping[str, Any]], say: OnMessage
) -> tuple[Config, RunRecord]:
    """The settings that the clip calls for, and verdicts and plan for the record; with "everything", as they are."""
    if effects not in ("everything", "auto"):
        raise InputError(f"train: effects = {effects!r} is not allowed; allowed: everything, auto")
    if effects == "everything":
        return config, {}
    from endotsr.effects.auto import planned_settings

    explicit = frozenset(f"{section}.{key}" for section, values in sections.items() for key in values)
    config, lines, effects_found = planned_settings(sequence, config, explicit)
    for line in lines:
        say(line)
    return config, {"effects": effects_found}


def inspect(sequence: Sequence, config: Config | None = None, *, frame_rate: float | None = None) -> dict[str, Any]:
    """What a clip shows and which components it calls for, as `endotsr inspect --json` writes it.

    config       settings that the plan is relative to; default: preset `paper`
    frame_rate   frames per second; default: those of the sequence. If known, rates are also given per minute

    returns      "noise", "verdicts" by effect (present, kind, statistic, threshold, reason, ...), "rates", and "plan"
                 with its changes, their reasons and the expected savings

    Raises: InputError for a frame rate that is not positive and finite.
    """
    from endotsr.effects.inspect import inspect_sequence, inspection_record
    from endotsr.effects.plan import make_plan, plan_record

    found = inspect_sequence(sequence, frame_rate)
    return inspection_record(found) | {"plan": plan_record(make_plan(found, PAPER if config is None else config))}


def open_run(path: str | Path, sequence: str | Path | None = None) -> "Run | WindowedRun":
    """The run of a run folder at its latest checkpoint, whether a command or `Run.save` wrote it.

    A folder of `endotsr train --windows` gives a `WindowedRun`, which renders and evaluates as a `Run` does.

    sequence   current location of the sequence of the run; default: the recorded location. It is read at first use

    Raises: InputError if there is no run or no checkpoint, or if a file is damaged or of other settings.
    """
    from endotsr.windows.record import is_windowed
    from endotsr.windows.run import WindowedRun

    if is_windowed(Path(path)):
        return WindowedRun(Path(path), None if sequence is None else str(sequence))
    folder = run_folders.open_run(Path(path))
    model = load_model(folder)
    log = log_until(folder.log, model.iteration)
    given = "" if sequence is None else str(sequence)
    return Run(model.config, folder.record(), folder.sequence_record(), log, model, given, _folder=folder)


@dataclass(eq=False, repr=False)
class Run:
    """A model with its settings, its log and the sequence it was trained on. Made by `train` and `open_run`."""

    config: Config  # all settings
    record: RunRecord  # what run.json holds: versions, machine, input hashes, status, seconds
    sequence_record: SequenceRecord  # sequence.json: times, names, split, cameras
    log: list[LogEntry]  # one entry an iteration, as the lines of log.jsonl
    model: Model  # Gaussians, spectral constants, settings and iteration: all that rendering reads
    _source: str  # where the sequence is; "" = where the record says
    _folder: run_folders.RunFolder | None = None  # of an opened run: what the next two are read from at their first use
    _sequence: Sequence | None = None
    _state: "TrainingState | None" = None

    def __repr__(self) -> str:
        planned = self.config.training.iterations
        return f"Run(iteration {self.model.iteration} of {planned}, {self.model.gaussians.count} Gaussians)"

    @property
    def iteration(self) -> int:
        """Completed iterations."""
        return self.model.iteration

    @property
    def sequence(self) -> Sequence:
        """The sequence the run was trained on. An opened run reads it at the first access.

        Raises: InputError if it cannot be found or is not the one that the run was trained on.
        """
        if self._sequence is None:
            assert self._folder is not None
            self._sequence = sources.load_run_sequence(self._folder, self._source)
        return self._sequence

    def render(
        self, time: float, camera: Camera | int | None = None, *, without: tuple[Component, ...] = ()
    ) -> RenderOut:
        """Colour (3, H, W) in display units, depth (H, W) in scene units and opacity (H, W) in [0, 1].

        time      normalised, in [0, 1]; frame i of n is at i / n
        camera    a Camera, or the number of the frame whose camera is meant; default: the frame nearest in time
        without   spectral components to leave out of the picture: "appearance", "spectral_motion"

        Depth is view-space z, not normalised by opacity. Colour is not clipped to [0, 1].
        Raises: InputError for a time, frame or component that does not exist.
        """
        return self._scene().picture(time, camera, without)

    def film(
        self,
        path: str | Path,
        *,
        count: int | None = None,
        camera: str = "observed",
        rate: float | None = None,
        slow: float | None = None,
    ) -> Path:
        """Write a film, as `endotsr render --film`; returns its path. .mp4 holds H.264, .webm VP9; or .gif.

        count    number of pictures, evenly spaced over the clip; default: the frames
        camera   "observed", "orbit", "sway", the number of a frame, or a file of cameras
        rate     pictures per second; default: the speed of the recording, 15 if it is unknown
        slow     instead of `rate`: the film takes this many times as long as the recording

        Raises: InputError for a name, rate, count or camera that is not allowed.
        """
        from endotsr.export.times import Times
        from endotsr.views import film, pictures
        from endotsr.views.plan import ViewRequest

        path, look, scene = Path(path), pictures.Look(), self._scene()
        pictures.check_outputs(None, path, rate, slow)
        views = pictures.requested_views(scene, ViewRequest(Times(count=count), camera), "all")
        chosen = rate or film.film_rate(path, [view.time for view in views], scene.record.duration, slow)
        film.write_film(path, pictures.film_pictures(pictures.rendered(scene, views, look), look), chosen)
        return path

    def view(self, path: str | Path) -> Path:
        """Write the page that plays and turns the scene in a browser, as `endotsr export`; returns its path.

        Raises: InputError for a name that is not that of a page.
        """
        from endotsr.views.page import KEYS, check_page, write_page

        path = Path(path)
        check_page(path, KEYS)
        write_page(path, self._scene(), path.stem, KEYS)
        return path

    def export(self, path: str | Path, *, times: tuple[float, ...] = ()) -> str:
        """Write Gaussians for other programs, as `endotsr export`; returns a line on what was written.

        path    .ply of one time, .glb with points that move, .npz of the whole scene, or a folder to create
        times   normalised, in [0, 1]

        Raises: InputError for a name or a time that is not allowed.
        """
        from endotsr.export.files import GAUSSIANS, export
        from endotsr.export.times import Times

        return export(self._scene(), Path(path), Times(tuple(times)), GAUSSIANS)

    def evaluate(self, *, lpips: str | Path | None = None) -> "EvaluationRecord":
        """Metrics of the held-out frames beside those of training frames and of baselines that need no model.

        lpips     AlexNet LPIPS weights (.npz); without them the LPIPS values are None
        returns   the keys of metrics.json that `measure_model` lists. For example
                  result["held_out"]["mean"]["psnr_tissue"], in dB; a metric without a finite value is None

        Raises: InputError if the sequence or the weights cannot be used.
        """
        from endotsr.evaluation.lpips import load_lpips_weights
        from endotsr.evaluation.run import measure_model

        weights = load_lpips_weights(lpips)
        sequence, about = self.sequence, self.record.get("input", {})
        simulator = checked(about.get("simulator", {}), SimulatorSettings, "run.json", "input.simulator.")
        truth = sources.true_positions_of(self._source or str(about.get("source")), simulator, self.config, sequence)
        return measure_model(self.model, sequence, weights, truth)[0]

    def resume(
        self, on_iteration: OnIteration | None = None, on_message: OnMessage = print, on_run: OnRun | None = None
    ) -> "Run":
        """Train on to the planned number of iterations; returns this run. A finished run stays as it is.

        The result is that of an uninterrupted training, bit for bit. Callbacks and errors are those of `train`.
        """
        from endotsr.fitting.compile_ahead import compile_ahead
        from endotsr.fitting.trainer import train as train_to_the_end
        from endotsr.kernels.threads import use_threads

        state, sequence = self._training(), self.sequence
        threads = use_threads(self.config.training.threads)
        if 0 < state.iteration < self.config.training.iterations:
            entry: ResumedEntry = {"after_iteration": state.iteration, "started": now(), "threads": threads}
            self.record["resumed"] = [*self.record.get("resumed", []), entry]
        self.record["threads"], before = threads, self.record.get("seconds") or 0.0
        began = last = clock.monotonic()

        def each(entry: LogEntry) -> None:
            nonlocal last
            tick = clock.monotonic()
            self.log.append({**entry, "seconds": round(tick - last, 5)})
            last = tick
            if on_iteration is not None:
                on_iteration(self.log[-1])
            if on_run is not None:
                self.model = self.model._replace(
                    gaussians=state.gaussians, iteration=state.iteration, frames=state.frames
                )
                on_run(self)

        try:
            compile_ahead(self.config, on_message)
            train_to_the_end(state, sequence, self.config, each, lambda _: None, on_message=on_message)
        except StopTraining:
            pass
        finally:
            self.model = _model_of(state, self.config, self.sequence_record)
            seconds = before + clock.monotonic() - began
            self.record |= self._reached(state) | {"seconds": round(seconds, 2)}
        return self

    def save(self, path: str | Path) -> Path:
        """Write a run folder that `open_run` and the commands read; returns its path.

        The folder holds the settings, the log, the checkpoint and the records. `endotsr evaluate` adds the metrics, the
        renders and the report to it, and `endotsr train --resume` continues it.
        Raises: InputError if something exists at `path` or the file system refuses.
        """
        state = self._training()
        folder = run_folders.create_run(Path(path), self.config, self.record, self.sequence_record)
        try:
            log = RunLog(folder.log, 0)
            for entry in self.log:
                log.append(entry)
            log.close()
            save_training(folder, state, self.config)
        except BaseException:
            shutil.rmtree(folder.path, ignore_errors=True)
            raise
        return folder.path

    def _scene(self) -> "MovingScene":
        """What renders, and what the writers of films and files take."""
        from endotsr.export.scene import MovingScene

        return MovingScene(self.sequence_record, self.model)

    def _training(self) -> "TrainingState":
        state = self._state
        if state is None:
            assert self._folder is not None
            state = self._state = load_training(self._folder, self.config)
        return state

    def _reached(self, state: "TrainingState") -> RunRecord:
        finished = state.iteration >= self.config.training.iterations
        return {
            "status": "finished" if finished else "interrupted",
            "finished": (self.record.get("finished") or now()) if finished else None,
            "iterations_done": state.iteration,
            "lambda_lap": state.lambda_lap,
            "peak_memory_bytes": peak_memory_bytes(),
        }


def _model_of(state: "TrainingState", config: Config, record: SequenceRecord) -> Model:
    """The model of a state; `record` is that of the sequence."""
    from endotsr.fitting.model import spectral_from

    spectral = spectral_from(config.model, record.train_times)
    return Model(state.gaussians, spectral, config, state.iteration, state.frames)


def _changed(config: Config, iterations: int | None, sections: Mapping[str, Mapping[str, Any]]) -> Config:
    """The settings with the schedule stretched to `iterations` and the sections changed, all checked."""
    if iterations is not None:
        if isinstance(iterations, bool) or not isinstance(iterations, int) or iterations < 1:
            raise InputError(f"iterations = {iterations!r} is not allowed; allowed: an integer >= 1")
        config = with_iterations(config, iterations)
    changes = {name: dict(values) if isinstance(values, Mapping) else values for name, values in sections.items()}
    return config_from_dict(merged(msgspec.to_builtins(config), changes), "arguments")
