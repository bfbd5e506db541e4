"""`endotsr compare`: runs and folders of pictures in one table, with paired differences."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.shown import SHOWN, ShownSettings, shown_sequence
from endotsr.errors import InputError
from endotsr.runs.files import read_json, refuse_unwritable, replace_file, write_json

if TYPE_CHECKING:
    from endotsr.sequences.sequence import Sequence


@dataclass
class CompareOptions:
    """Compare methods on the same held-out frames: means, and differences to the first one frame by frame.

    Each argument is a run folder that was evaluated, a JSON file of `endotsr evaluate --json`, or a folder of pictures;
    NAME=PATH gives it another name in the table. Pictures are measured on the sequence of the first run, or on
    --sequence. The interval of a difference is a bootstrap over the frames of this clip; it says nothing about others.
    """

    methods: Annotated[tuple[str, ...], Option("METHOD", positional=True)]
    """run folders, JSON files and folders of pictures"""
    baselines: bool = True
    """also compare the baselines of the first method"""
    sequence: Annotated[str | None, Option("SEQUENCE")] = None
    """the sequence that folders of pictures show (default: that of the first run)"""
    lpips: Annotated[Path | None, Option("FILE")] = None
    """AlexNet LPIPS weights (.npz) for the pictures"""
    seed: int = 0
    """seed of the resampling"""
    json: Annotated[Path | None, Option("FILE")] = None
    """also write the table as JSON"""
    csv: Annotated[Path | None, Option("FILE")] = None
    """also write the table as CSV"""
    settings: Annotated[ShownSettings, Option(flat=True)] = SHOWN


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.evaluation.compare import compare, methods_of
    from endotsr.report.comparison_text import METRICS, comparison_table
    from endotsr.report.spreadsheet import comparison_csv

    options = parse(CompareOptions, words, "compare")
    refuse_unwritable(options.json, options.csv)
    if options.seed < 0:
        raise InputError(f"compare: --seed {options.seed} is not allowed; allowed: an integer >= 0")
    named = [_named(word) for word in options.methods]
    methods, sequence = [], None
    for label, path in named:
        metrics, sequence = _metrics(label, path, options, [p for _, p in named], sequence)
        methods += methods_of(metrics, label, path, baselines=options.baselines and not methods)
    methods[1:] = sorted(methods[1:], key=lambda method: method.label not in dict(named))  # baselines at the end
    rows = compare(methods, tuple(METRICS), options.seed)
    print(comparison_table(rows))
    if options.json:
        write_json(options.json, {"against": methods[0].label, "rows": [_as_dict(row) for row in rows]})
    if options.csv:
        text = comparison_csv(rows)
        replace_file(options.csv, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return 0


def _named(word: str) -> tuple[str, Path]:
    """Label and path of an argument: NAME=PATH, or the name of the file or folder."""
    name, equals, path = word.partition("=")
    if equals and not Path(word).exists():
        return name, Path(path)
    return Path(word).absolute().name, Path(word)


def _metrics(
    label: str, path: Path, options: CompareOptions, paths: list[Path], sequence: "Sequence | None"
) -> tuple[dict[str, Any], "Sequence | None"]:
    """The metrics of one argument, and the sequence if it had to be read."""
    if (path / "run.json").exists():
        if not (path / "metrics.json").exists():
            raise InputError(f"{path}: not evaluated yet; `endotsr evaluate {path}` writes its metrics.json")
        return read_json(path / "metrics.json"), sequence
    if not path.is_dir():
        return read_json(path), sequence
    from endotsr.evaluation.lpips import load_lpips_weights
    from endotsr.evaluation.pictures import find_pictures, measure_pictures

    if sequence is None:
        run = next((p for p in paths if (p / "run.json").exists()), None) if options.sequence is None else None
        sequence = shown_sequence("compare", run, options.sequence, options.settings)
    return measure_pictures(find_pictures(path, sequence), sequence, label, load_lpips_weights(options.lpips)), sequence


def _as_dict(row: Any) -> dict[str, Any]:
    return row._asdict() | {"difference": row.difference and row.difference._asdict()}
