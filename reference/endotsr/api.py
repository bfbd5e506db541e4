"""The Python interface: load a sequence, train, render, measure, save, open.

    import endotsr
    sequence = endotsr.load_sequence("my_sequence", scale=0.5)
    run = endotsr.train(sequence, preset="paper", iterations=2000)
    view = run.render(time=0.37)
    metrics = run.evaluate()
    run.save("runs/mine")
    run = endotsr.open_run("runs/mine")

Functions and commands share their code and give bitwise equal results: `train` and `endotsr train`, `Run.render` and
`endotsr render`, `Run.evaluate` and `endotsr evaluate`. They also share run folders: the commands read those of
`Run.save`, and `open_run` reads those of the commands.

Import the names from `endotsr`; `endotsr.__all__` lists the stable ones. Invalid input raises an `InputError` that
names the argument and the allowed values.
"""

import shutil
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import msgspec

from endotsr.clips.sequences.record import SequenceRecord, record_of
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import PAPER, Config, SequenceConfig, config_from_dict, lengthened, merged, with_iterations
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.training.fitting.records import LogEntry
from endotsr.training.runs import folder as run_folders
from endotsr.training.runs import sources
from endotsr.training.runs.files import os_error_line, refuse_replacing
from endotsr.training.runs.log import RunLog, log_until
from endotsr.training.runs.machine import now, peak_memory_bytes
from endotsr.training.runs.model import Model, load_model, load_training, save_training
from endotsr.training.runs.records import ResumedEntry, RunRecord
from endotsr.untrusted.sections import checked, refuse_unknown_keys
from endotsr.untrusted.toml import read_toml

if TYPE_CHECKING:
    from endotsr.results.evaluation.records import EvaluationRecord
    from endotsr.results.export.scene import MovingScene
    from endotsr.studies.windows.run import WindowedRun
    from endotsr.training.fitting.state import TrainingState

Component = Literal["appearance", "spectral_motion"]
OnIteration = Callable[[LogEntry], object]
OnRun = Callable[["Run"], object]
OnMessage = Callable[[str], object]


class StopTraining(Exception):
    """Raise it in `on_iteration` or `on_run` to end the training after this iteration; `train` returns the run."""


def make_config(
    preset: str | None = None,
    *,
    file: str | Path | None = None,
    iterations: int | None = None,
    **sections: Mapping[str, Any],
) -> Config:
    """All settings of a run. Later sources override earlier ones: preset, TOML file, `iterations`, sections.

    preset       a name in `endotsr.config.PRESETS`; default: paper
    file         TOML file, as `endotsr train --config`
    iterations   exact length of the run; milestones keep their fraction of the run. training={"iterations": n} changes
                 the length but not the milestones. training={"visits_per_frame": v} lengthens a run with more than
                 n / v training frames; if n / v is above 64, with more than about (n / v)^2 / 64
    sections     changes by section: model={"appearance": False}, training={"seed": 3, "threads": 2}

    Raises: InputError naming the file or the key, the value and the allowed values.
    """
    data = read_toml(Path(file)) if file is not None else {}
    if preset is not None:
        data = data | {"preset": preset}
    return _changed(config_from_dict(data, str(file or "configuration")), iterations, sections)


def load_sequence(
    source: str | Path,
    config: Config | None = None,
    *,
    preset: str | None = None,
    simulator: Mapping[str, Any] | None = None,
    **settings: Any,
) -> Sequence:
    """The complete sequence, checked; kept in a file if it needs more than half of `sequence.memory`.

    source      sequence folder, or the word "simulated"
    config      initial settings (section `sequence` and the near plane are used); default: those of `preset`
    preset      a name in `endotsr.config.PRESETS`; default: paper. The others remove outliers of the prior depth
    simulator   settings of "simulated": {"frames": 16, "width": 96, "pull": {"on": False}}
    settings    keys of section `sequence`: scale=0.5, frames="0:60", masks="gt_masks", split="blocks"

    returns     images (n, 3, H, W) uint8; masks (n, H, W), True = tissue; depth (n, H, W) in scene units, 0 = none;
                times (n,) in [0, 1); cameras, split, and notes on assumptions

    Raises: InputError naming the file, the frame or the key, and the allowed values.
    """
    if config is not None and preset is not None:
        raise InputError(f"load_sequence: preset = {preset!r} with a config is not allowed; use one of the two")
    config = _changed(make_config(preset) if config is None else config, None, {"sequence": settings})
    wanted = dict(simulator or {})
    refuse_unknown_keys(wanted, SimulatorSettings, "simulator")
    shown = checked(wanted, SimulatorSettings, "simulator")
    if wanted and str(source) != sources.SIMULATED:
        raise InputError(f"load_sequence: simulator with the folder {source} is not allowed; use 'simulated'")
    sequence = sources.load_sequence(str(source), config, shown)
    return replace(sequence, source=str(source), settings=config.sequence, simulator=shown)


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
    """Train on a sequence; returns the trained run. Bitwise equal to `endotsr train` with these settings.

    sequence       from `load_sequence`, which keeps its settings; or a `Sequence` made of arrays
    config         from `make_config`; iterations and sections are applied to it. Without it, the settings are
                   make_config(preset, iterations=iterations, **sections)
    on_iteration   called after every iteration with its log entry: iteration, frame, loss, terms of the loss,
                   gaussians, seconds, and psnr at the first and every tenth iteration. May raise StopTraining. Its
                   result is ignored
    on_run         called next, with the run at this iteration, to use its `model` or `render`. The next iteration
                   changes the arrays in place: copy those to keep, and do not modify them
    on_message     called with each line on what is done: compilation, calibration (7), coarse start, plan of `effects`,
                   advice
    effects        "auto" trains only the components that the clip needs, as `train --effects auto`; keys in `sections`
                   take precedence

    Sets the number of kernel threads of the calling thread to `training.threads` (0 = all cores).
    A KeyboardInterrupt ends the training without a run; use `StopTraining` to keep it.
    Raises: InputError for invalid settings or an unusable sequence; FloatingPointError naming iteration, frame and
            terms if the loss is not finite; CalibrationError if equation (7) has no solution.
    """
    from endotsr.method.kernels.threads import use_threads
    from endotsr.training.fitting.state import new_training

    if not isinstance(sequence, Sequence):
        raise InputError(f"train: sequence is {type(sequence).__name__}; use a Sequence, as from load_sequence")
    if config is None:
        config = make_config(preset, file=None, iterations=iterations, **sections)
    elif preset is not None:
        raise InputError(f"train: preset = {preset!r} with a config is not allowed; use one of the two")
    else:
        config = _changed(config, iterations, sections)
    if sequence.settings is not None:
        if said := _outliers_kept(sequence, config):
            on_message(said)
        config = msgspec.structs.replace(config, sequence=sequence.settings)
    simulator = sequence.simulator if isinstance(sequence.simulator, SimulatorSettings) else SimulatorSettings()
    config = lengthened(config, len(sequence.train_index))
    config, found = _called_for(sequence, config, effects, sections, on_message)
    state = new_training(sequence, config)
    threads = use_threads(config.training.threads)
    record = sources.start_record(["endotsr.train"], sequence.source, sequence, config, simulator, threads) | found
    seen = record_of(sequence)
    run = Run(config, record, seen, [], _model_of(state, config, seen), "", _sequence=sequence, _state=state)
    return run.resume(on_iteration, on_message, on_run)


def _outliers_kept(sequence: Sequence, config: Config) -> str:
    """A sentence if the settings would have removed wrong depth that the sequence was loaded with; "" if not."""
    loaded, name = sequence.settings, config.preset
    kept = isinstance(loaded, SequenceConfig) and loaded.depth_outliers == "kept" != config.sequence.depth_outliers
    if not kept or not any("depth-outliers" in note for note in sequence.notes):
        return ""
    return f"the prior depth has outliers, which load_sequence(..., preset={name!r}) removes"


def _called_for(
    sequence: Sequence, config: Config, effects: str, sections: Mapping[str, Mapping[str, Any]], say: OnMessage
) -> tuple[Config, RunRecord]:
    """The settings for the effects found in the clip, with verdicts and plan for the record; unchanged by default."""
    if effects not in ("everything", "auto"):
        raise InputError(f"train: effects = {effects!r} is not allowed; use everything or auto")
    if effects == "everything":
        return config, {}
    from endotsr.clips.effects.auto import planned_settings

    explicit = frozenset(f"{section}.{key}" for section, values in sections.items() for key in values)
    config, lines, effects_found = planned_settings(sequence, config, explicit)
    for line in lines:
        say(line)
    return config, {"effects": effects_found}


def inspect(sequence: Sequence, config: Config | None = None, *, frame_rate: float | None = None) -> dict[str, Any]:
    """The effects found in a clip and the components that it needs, as written by `endotsr inspect --json`.

    config       settings to which the plan applies; default: preset `paper`
    frame_rate   frames per second; default: that of the sequence. If known, rates are also given per minute

    returns      "noise", "verdicts" by effect (present, kind, statistic, threshold, reason, ...), "rates", and "plan"
                 with changes, reasons and expected savings

    Raises: InputError for a frame rate that is not positive and finite.
    """
    from endotsr.clips.effects.inspect import inspect_sequence, inspection_record
    from endotsr.clips.effects.plan import make_plan, plan_record

    found = inspect_sequence(sequence, frame_rate)
    return inspection_record(found) | {"plan": plan_record(make_plan(found, PAPER if config is None else config))}


def estimate_poses(sequence: Sequence) -> Sequence:
    """The sequence with a camera for each frame, estimated from its pictures, masks and depth, as `endotsr poses`.

    The camera of the first frame stays as it is. A note names the frames whose pose is interpolated between
    others, or is that of the first or last pose. Motion that the whole tissue has in common, as in breathing, is part
    of the estimated motion.

    Raises: InputError for a single frame, without depth, if too few points match, or if more than 8 frames in a row
            have no pose.
    """
    from endotsr.clips.prepare.make_poses import estimate_poses as estimated

    found = estimated(sequence)
    interpolated = sorted(found.interpolated + found.held)
    note = "poses: estimated from pictures and depth" + (f"; interpolated: {interpolated}" if interpolated else "")
    return replace(sequence, cameras=found.cameras, static_camera=False, notes=[*sequence.notes, note])


def open_run(path: str | Path, sequence: str | Path | None = None) -> "Run | WindowedRun":
    """A run at its latest checkpoint, from a folder of a command or of `Run.save`.

    A folder of `endotsr train --windows` is opened as a `WindowedRun`, which renders and evaluates like a `Run`.

    sequence   current location of the run's sequence, read on first use; default: the recorded location

    Raises: InputError without a run or checkpoint, or if a file is damaged or has other settings.
    """
    from endotsr.studies.windows.record import is_windowed
    from endotsr.studies.windows.run import WindowedRun

    if is_windowed(Path(path)):
        return WindowedRun(Path(path), None if sequence is None else str(sequence))
    folder = run_folders.open_run(Path(path))
    model = load_model(folder)
    log = log_until(folder.log, model.iteration)
    given = "" if sequence is None else str(sequence)
    return Run(model.config, folder.record(), folder.sequence_record(), log, model, given, _folder=folder)


@dataclass(eq=False, repr=False)
class Run:
    """A model with its settings, log and training sequence, from `train` or `open_run`."""

    config: Config  # all settings
    record: RunRecord  # run.json: versions, machine, input hashes, status, seconds
    sequence_record: SequenceRecord  # sequence.json: times, names, split, cameras
    log: list[LogEntry]  # one entry per iteration, as in log.jsonl
    model: Model  # Gaussians, spectral constants, settings and iteration
    _source: str  # location of the sequence; "" = as recorded
    _folder: run_folders.RunFolder | None = None  # of an opened run; the next two are read from it on first use
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
        """The training sequence. An opened run reads it on first access.

        Raises: InputError if it is missing or differs from the recorded one.
        """
        if self._sequence is None:
            assert self._folder is not None
            self._sequence = sources.load_run_sequence(self._folder, self._source)
        return self._sequence

    def render(
        self, time: float, camera: Camera | int | None = None, *, without: tuple[Component, ...] = ()
    ) -> RenderOut:
        """Colour (3, H, W) in display units, depth (H, W) in scene units and opacity (H, W) in [0, 1].

        time      normalised, in [0, 1]; frame i of n evenly spaced ones is at i / n
        camera    a Camera, or the number of a frame to use its camera; default: the nearest frame in time
        without   spectral components to leave out: "appearance", "spectral_motion"

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
        replace: bool = False,
    ) -> Path:
        """Write a film, .mp4 (H.264), .webm (VP9) or .gif, as `endotsr render --film`; returns its path.

        count    number of evenly spaced pictures; default: one per frame
        camera   "observed", "orbit", "sway", the number of a frame, or a camera file
        rate     pictures per second; default: real time, or 15 if the frame rate is unknown
        slow     slow-down relative to the recording, instead of `rate`
        replace  replace an existing film that endotsr did not write

        Raises: InputError for an invalid name, rate, count or camera, and for such a film.
        """
        from endotsr.results.export.times import Times
        from endotsr.results.views import film, pictures
        from endotsr.results.views.plan import ViewRequest

        path, look, scene = Path(path), pictures.Look(), self._scene()
        pictures.check_outputs(None, path, rate, slow, replace, option="")
        views = pictures.requested_views(scene, ViewRequest(Times(count=count), camera), "all")
        pictures.check_panels(look.panels, views)
        chosen = rate or film.film_rate(path, [view.time for view in views], scene.record.duration, slow)
        film.write_film(path, pictures.film_pictures(pictures.rendered(scene, views, look), look), chosen)
        return path

    def view(self, path: str | Path, *, replace: bool = False) -> Path:
        """Write the interactive viewer page, as `endotsr export --out PAGE.html`; returns its path.

        replace  replace an existing file that endotsr did not write

        Raises: InputError if `path` is no .html name, and for such a file.
        """
        from endotsr.results.views.page import KEYS, check_page, write_page

        path = Path(path)
        check_page(path, KEYS)
        refuse_replacing(path, replace)
        write_page(path, self._scene(), path.stem, KEYS)
        return path

    def export(self, path: str | Path, *, times: tuple[float, ...] = (), replace: bool = False) -> str:
        """Write files for other programs, as `endotsr export`; returns one line on the result.

        path    .ply (one time), .glb (animated points), .npz (slim model), or a folder of .ply files to create
        times   normalised, in [0, 1]
        replace replace an existing file that endotsr did not write; a folder is never replaced

        Raises: InputError for an invalid name or time, and for such a file.
        """
        from endotsr.results.export.files import GAUSSIANS, export
        from endotsr.results.export.times import Times

        return export(self._scene(), Path(path), Times(tuple(times)), GAUSSIANS, replace)

    def evaluate(self, *, lpips: str | Path | None = None) -> "EvaluationRecord":
        """Metrics of the held-out frames, of training frames, and of baselines without a model.

        lpips     AlexNet LPIPS weights (.npz); without them LPIPS is None
        returns   the keys of metrics.json listed in `measure_model`, for example
                  result["held_out"]["mean"]["psnr_tissue"] in dB; a metric without a finite value is None

        Raises: InputError if the sequence or the weights cannot be used.
        """
        from endotsr.results.evaluation.lpips import load_lpips_weights
        from endotsr.results.evaluation.run import measure_model

        weights = load_lpips_weights(lpips)
        sequence, about = self.sequence, self.record.get("input", {})
        simulator = checked(about.get("simulator", {}), SimulatorSettings, "run.json", "input.simulator.")
        truth = sources.true_positions_of(self._source or str(about.get("source")), simulator, self.config, sequence)
        return measure_model(self.model, sequence, weights, truth)[0]

    def resume(
        self, on_iteration: OnIteration | None = None, on_message: OnMessage = print, on_run: OnRun | None = None
    ) -> "Run":
        """Continue the training to the planned number of iterations; returns this run. No effect on a finished run.

        The result is bitwise equal to an uninterrupted training. Callbacks and errors as in `train`.
        """
        from endotsr.method.kernels.threads import use_threads
        from endotsr.training.fitting.compile_ahead import compile_ahead
        from endotsr.training.fitting.trainer import train as train_to_the_end

        state = self._training()
        if state.iteration >= self.config.training.iterations and self.record.get("status") == "finished":
            return self
        sequence = self.sequence
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
        """Write a run folder for `open_run` and the commands; returns its path.

        The folder contains settings, log, checkpoint and records. `endotsr evaluate` adds metrics, renders and report;
        `endotsr train --resume` continues the run.
        Raises: InputError if `path` exists or on an error of the file system.
        """
        state = self._training()
        folder = run_folders.create_run(Path(path), self.config, self.record, self.sequence_record)
        try:
            log = RunLog(folder.log, 0)
            for entry in self.log:
                log.append(entry)
            log.close()
            save_training(folder, state, self.config)
        except BaseException as error:
            shutil.rmtree(folder.path, ignore_errors=True)
            if isinstance(error, OSError):
                raise InputError(os_error_line(error, folder.path)) from None
            raise
        return folder.path

    def _scene(self) -> "MovingScene":
        """The scene for renders, films and exports."""
        from endotsr.results.export.scene import MovingScene

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
    """The model of a training state; `record` belongs to the sequence."""
    from endotsr.training.fitting.model import spectral_from

    spectral = spectral_from(config.model, record.train_times)
    return Model(state.gaussians, spectral, config, state.iteration, state.frames)


def _changed(config: Config, iterations: int | None, sections: Mapping[str, Mapping[str, Any]]) -> Config:
    """The checked settings with the schedule stretched to `iterations` and the sections changed."""
    if iterations is not None:
        if isinstance(iterations, bool) or not isinstance(iterations, int) or iterations < 1:
            raise InputError(f"iterations = {iterations!r} is not allowed; use an integer >= 1")
        config = with_iterations(config, iterations)
    changes = {name: dict(values) if isinstance(values, Mapping) else values for name, values in sections.items()}
    return config_from_dict(merged(msgspec.to_builtins(config), changes), "arguments")
