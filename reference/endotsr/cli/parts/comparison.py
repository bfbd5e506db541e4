"""`endotsr evaluate`: options, the sequence of a folder of pictures, and the comparison of methods."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import msgspec

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.result import JsonFile
from endotsr.config import PAPER, SequenceConfig
from endotsr.errors import InputError
from endotsr.studies.windows.record import is_windowed
from endotsr.training.runs.files import read_json, write_json
from endotsr.training.runs.folder import open_run
from endotsr.untrusted.json import Keys
from endotsr.untrusted.sections import Section
from endotsr.untrusted.writing import replace_text

if TYPE_CHECKING:
    from endotsr.clips.sequences.sequence import Sequence
    from endotsr.results.evaluation.records import EvaluationRecord


class ShownSettings(Section, frozen=True, kw_only=True):
    """The settings of a sequence, as options such as `--sequence.scale`."""

    sequence: SequenceConfig = SequenceConfig()


SHOWN = ShownSettings()


@dataclass
class EvaluateOptions:
    """Evaluate a run on its held-out frames; write metrics, pictures, report.html and view.html to its folder.

    Several METHODs are compared on the same held-out frames, with means and with differences to the first method,
    paired by frame. A METHOD is an evaluated run folder, a JSON file from --json, or pictures; NAME=PATH renames it.
    Intervals of differences are bootstrapped over the frames of this clip; they do not cover other clips.

    With --pictures, the renders of any method are evaluated by the same code and with the same baselines, on the
    sequence of the run or on --sequence. Required is one picture per held-out frame: .png, .tiff or .bmp (8 or 16 bit)
    or .npy (float, display units) in a folder, paired by frame names, by frame numbers, or in order; or a video of all
    frames or of the held-out ones. The run is not changed.
    """

    methods: Annotated[tuple[str, ...], Option("[METHOD ...]", positional=True)] = ()
    """run folder, or several methods to compare; optional with --pictures"""
    pictures: Annotated[Path | None, Option("FOLDER|VIDEO")] = None
    """evaluate the pictures of this folder or video instead of the run"""
    label: Annotated[str, Option("TEXT")] = ""
    """name of the method in the tables (default: the name of the folder)"""
    sequence: Annotated[str | None, Option("SEQUENCE")] = None
    """sequence folder, or `simulated`; for a run: its current location (default: the recorded one)"""
    json: JsonFile = None
    """also write the metrics as JSON"""
    csv: Annotated[Path | None, Option("FILE", written=True)] = None
    """also write the metrics of every held-out frame, or the table of a comparison, as CSV"""
    lpips: Annotated[Path | None, Option("FILE")] = None
    """AlexNet LPIPS weights (.npz)"""
    measures: Annotated[tuple[str, ...], Option("NAME ...")] = ()
    """additional measurements, each with reference rows: depth, flicker, right_view"""
    view: bool = True
    """write the viewer page view.html, linked from the report"""
    compare: bool = False
    """compare a single METHOD with its baselines"""
    baselines: bool = True
    """include the baselines of the first METHOD in a comparison"""
    seed: int = 0
    """seed of the resampling of a comparison"""
    threads: int = 0
    """threads, 0 = all cores"""
    settings: Annotated[ShownSettings, Option(flat=True)] = SHOWN

    @property
    def run(self) -> Path | None:
        """The run folder of a single method."""
        return Path(self.methods[0]) if self.methods else None


def shown_sequence(run: Path | None, source: str | None, settings: ShownSettings) -> "Sequence":
    """The sequence of `run` (at `source`, if it has moved), or the sequence `source` with these settings.

    Raises: InputError if neither is given, or for settings together with a run.
    """
    from endotsr.clips.simulator.settings import SimulatorSettings
    from endotsr.training.runs.sources import load_run_sequence, load_sequence

    if run is not None:
        if settings != SHOWN:
            raise InputError(f"evaluate: --sequence.* with {run} is not allowed: the settings of a run are fixed")
        return load_run_sequence(open_run(run), source)
    if source is None:
        raise InputError("evaluate: --sequence is missing: the sequence of the pictures, or a run folder")
    return load_sequence(source, msgspec.structs.replace(PAPER, sequence=settings.sequence), SimulatorSettings())


def compare_methods(asked: EvaluateOptions) -> None:
    """Print the means of every method, and the paired differences to the first one with intervals.

    A method is a run folder, a JSON file, a folder of pictures or a video, as PATH or NAME=PATH.
    """
    from endotsr.results.evaluation.compare import compare, methods_of
    from endotsr.results.report.comparison import METRICS, comparison_csv, comparison_table

    if asked.seed < 0:
        raise InputError(f"evaluate: --seed {asked.seed} is not allowed; use an integer >= 0")
    named = [_named(word) for word in asked.methods]
    methods, sequence = [], None
    for label, path in named:
        metrics, sequence = _metrics(label, path, asked, [p for _, p in named], sequence)
        methods += methods_of(metrics, label, path, baselines=asked.baselines and not methods)
    if sequence is None:
        _refuse_options_of_pictures(asked)
    methods[1:] = sorted(methods[1:], key=lambda method: method.label not in dict(named))  # baselines at the end
    rows = compare(methods, tuple(METRICS), asked.seed)
    print(comparison_table(rows))
    if asked.json:
        write_json(asked.json, {"against": methods[0].label, "rows": [_as_dict(row) for row in rows]})
    if asked.csv:
        replace_text(asked.csv, comparison_csv(rows))


def _refuse_options_of_pictures(asked: EvaluateOptions) -> None:
    """Raises InputError for an option that only pictures need, because every METHOD has its metrics already."""
    unused = [name for name, given in (("lpips", asked.lpips), ("sequence", asked.sequence)) if given is not None]
    unused += ["sequence.*"] if asked.settings != SHOWN else []
    if unused:
        raise InputError(
            f"evaluate: --{unused[0]} has no effect: no METHOD is a folder of pictures or a video; `endotsr evaluate"
            f" RUN` measures a run again, or omit --{unused[0]}"
        )


def _named(word: str) -> tuple[str, Path]:
    """Label and path of an argument: NAME=PATH, or the name of the file or folder."""
    name, equals, path = word.partition("=")
    if equals and not Path(word).exists():
        return name, Path(path)
    return Path(word).absolute().name, Path(word)


def _metrics(
    label: str, path: Path, asked: EvaluateOptions, paths: list[Path], sequence: "Sequence | None"
) -> tuple["EvaluationRecord", "Sequence | None"]:
    """The metrics of one method, and the sequence, if it was read for this or an earlier method."""
    if (path / "run.json").exists() or is_windowed(path):
        if not (path / "metrics.json").exists():
            raise InputError(f"{path}: not evaluated yet; `{_evaluate(path)}` writes its metrics.json")
        metrics = read_json(path / "metrics.json")
        if not is_windowed(path):
            _refuse_earlier(path, metrics)
        return cast("EvaluationRecord", metrics), sequence
    from endotsr.clips.formats.video_file import is_video
    from endotsr.results.evaluation.lpips import load_lpips_weights
    from endotsr.results.evaluation.pictures import find_renders, measure_pictures

    if not path.is_dir() and not is_video(path):
        return cast("EvaluationRecord", read_json(path)), sequence

    if sequence is None:
        run = next((p for p in paths if (p / "run.json").exists()), None) if asked.sequence is None else None
        sequence = shown_sequence(run, asked.sequence, asked.settings)
    weights = load_lpips_weights(asked.lpips)
    metrics = measure_pictures(find_renders(path, sequence), sequence, label, weights)
    if said := metrics["pictures"]["doubt"]:
        print(f"{path}: {said}")
    return metrics, sequence


def _refuse_earlier(path: Path, metrics: Keys) -> None:
    """Raises InputError for metrics of an earlier iteration than the checkpoint of a run that was continued."""
    about = metrics.get("run")
    measured = about.get("iteration") if isinstance(about, dict) else None
    done = read_json(path / "run.json").get("iterations_done")
    if isinstance(measured, int) and isinstance(done, int) and measured != done:
        raise InputError(
            f"{path}: its metrics.json is of iteration {measured}, its checkpoint of {done}; `{_evaluate(path)}`"
            " measures it again"
        )


def _evaluate(run: Path) -> str:
    """The command that evaluates a run, as a shell takes it."""
    return f"endotsr evaluate {shlex.quote(str(run))}"


def _as_dict(row: Any) -> dict[str, Any]:
    return row._asdict() | {"difference": row.difference and row.difference._asdict()}
