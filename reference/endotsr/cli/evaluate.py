"""`endotsr evaluate`: the held-out metrics of a run beside baselines, with renders and a report."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.runs.folder import RunFolder, open_run

if TYPE_CHECKING:
    from endotsr.sequences.sequence import Sequence


@dataclass
class EvaluateOptions:
    """Measure a run on its held-out frames; write metrics.json, renders/, curves.png and report.html in its folder."""

    run: Annotated[Path, Option("RUN", positional=True)]
    """run folder"""
    sequence: Annotated[str | None, Option("SEQUENCE")] = None
    """current location of the sequence of the run (default: the recorded one)"""
    lpips: Annotated[Path | None, Option("FILE")] = None
    """AlexNet LPIPS weights (.npz)"""
    paper_row: Literal["pulling"] | None = None
    """also show the published figures of this clip"""
    threads: int = 0
    """threads, 0 = all cores"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.evaluation.run import PUBLISHED
    from endotsr.kernels.threads import use_threads
    from endotsr.runs.model import load_model
    from endotsr.runs.sources import load_run_sequence

    options = parse(EvaluateOptions, words, "evaluate")
    folder = open_run(options.run)
    load_model(folder)  # refuses a run without a usable checkpoint before the sequence is read
    use_threads(options.threads)
    sequence = load_run_sequence(folder, options.sequence)
    evaluate_run(folder, sequence, options.lpips, (PUBLISHED[options.paper_row],) if options.paper_row else ())
    return 0


def evaluate_run(
    folder: RunFolder, sequence: "Sequence", lpips: Path | None = None, published: tuple[dict[str, Any], ...] = ()
) -> None:
    """Measure the latest checkpoint, write the files of an evaluation, and print the table."""
    from endotsr.evaluation.lpips import load_lpips_weights
    from endotsr.evaluation.run import measure_run
    from endotsr.report.run_files import write_evaluation
    from endotsr.report.run_text import held_out_table
    from endotsr.runs.model import load_model
    from endotsr.runs.records import REPORTED
    from endotsr.runs.sources import run_source, true_positions_of

    weights = load_lpips_weights(lpips)
    model, truth = load_model(folder), true_positions_of(*run_source(folder), folder.config())
    metrics, held_out = measure_run(model, sequence, folder.record(*REPORTED), weights, published, truth)
    write_evaluation(folder, sequence, metrics, held_out)
    print(held_out_table(metrics))
    print(f"report: {folder.path / 'report.html'}", flush=True)
