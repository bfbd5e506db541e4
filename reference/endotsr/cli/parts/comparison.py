"""`endotsr evaluate` with several methods: runs and pictures in one table, with paired differences."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from endotsr.cli.parts.shown import ShownSettings, shown_sequence
from endotsr.errors import InputError
from endotsr.runs.files import read_json, write_json
from endotsr.untrusted.writing import replace_text
from endotsr.windows.record import is_windowed

if TYPE_CHECKING:
    from endotsr.evaluation.records import EvaluationRecord
    from endotsr.sequences.sequence import Sequence


class Comparison(NamedTuple):
    """What is compared, and where the table goes."""

    methods: tuple[str, ...]  # run folders, JSON files, folders of pictures and videos, each PATH or NAME=PATH
    baselines: bool  # of the first method
    seed: int  # of the resampling
    sequence: str | None  # that folders of pictures show; None = that of the first run
    settings: ShownSettings  # of that sequence
    lpips: Path | None
    json: Path | None
    csv: Path | None


def compare_methods(asked: Comparison) -> None:
    """Print the means of every method and their differences to the first one frame by frame, with intervals."""
    from endotsr.evaluation.compare import compare, methods_of
    from endotsr.report.comparison import METRICS, comparison_csv, comparison_table

    if asked.seed < 0:
        raise InputError(f"evaluate: --seed {asked.seed} is not allowed; allowed: an integer >= 0")
    named = [_named(word) for word in asked.methods]
    methods, sequence = [], None
    for label, path in named:
        metrics, sequence = _metrics(label, path, asked, [p for _, p in named], sequence)
        methods += methods_of(metrics, label, path, baselines=asked.baselines and not methods)
    methods[1:] = sorted(methods[1:], key=lambda method: method.label not in dict(named))  # baselines at the end
    rows = compare(methods, tuple(METRICS), asked.seed)
    print(comparison_table(rows))
    if asked.json:
        write_json(asked.json, {"against": methods[0].label, "rows": [_as_dict(row) for row in rows]})
    if asked.csv:
        replace_text(asked.csv, comparison_csv(rows))


def _named(word: str) -> tuple[str, Path]:
    """Label and path of an argument: NAME=PATH, or the name of the file or folder."""
    name, equals, path = word.partition("=")
    if equals and not Path(word).exists():
        return name, Path(path)
    return Path(word).absolute().name, Path(word)


def _metrics(
    label: str, path: Path, asked: Comparison, paths: list[Path], sequence: "Sequence | None"
) -> tuple["EvaluationRecord", "Sequence | None"]:
    """The metrics of one argument, and the sequence if it had to be read."""
    if (path / "run.json").exists() or is_windowed(path):
        if not (path / "metrics.json").exists():
            raise InputError(f"{path}: not evaluated yet; `endotsr evaluate {path}` writes its metrics.json")
        return cast("EvaluationRecord", read_json(path / "metrics.json")), sequence
    from endotsr.evaluation.lpips import load_lpips_weights
    from endotsr.evaluation.pictures import find_pictures, is_video, measure_pictures

    if not path.is_dir() and not is_video(path):
        return cast("EvaluationRecord", read_json(path)), sequence

    if sequence is None:
        run = next((p for p in paths if (p / "run.json").exists()), None) if asked.sequence is None else None
        sequence = shown_sequence("evaluate", run, asked.sequence, asked.settings)
    return measure_pictures(find_pictures(path, sequence), sequence, label, load_lpips_weights(asked.lpips)), sequence


def _as_dict(row: Any) -> dict[str, Any]:
    return row._asdict() | {"difference": row.difference and row.difference._asdict()}
