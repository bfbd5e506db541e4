"""`endotsr evaluate`: held-out metrics of a run, or of any pictures, with baselines; comparison of methods."""

from pathlib import Path
from typing import TYPE_CHECKING, cast

from endotsr.cli.parts.comparison import EvaluateOptions, compare_methods, shown_sequence
from endotsr.cli.parts.evaluating import evaluating
from endotsr.cli.parts.parser import given_names, parse
from endotsr.errors import InputError
from endotsr.training.runs.files import refuse_read_only, write_json
from endotsr.training.runs.folder import RunFolder, open_run
from endotsr.untrusted.writing import replace_text

if TYPE_CHECKING:
    from endotsr.clips.sequences.sequence import Sequence
    from endotsr.results.evaluation.records import EvaluationRecord, RunEvaluation


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.method.kernels.threads import use_threads
    from endotsr.results.report.comparison import frames_csv

    options, given = parse(EvaluateOptions, words, "evaluate"), given_names(EvaluateOptions, words)
    use_threads(options.threads)
    if len(options.methods) > 1 or options.compare:
        return _compare(options, given)
    _refuse_without_effect(options, given)
    if options.pictures and options.measures:
        raise InputError("evaluate: --measures with --pictures is not allowed: measures render views of a run")
    metrics = _pictures(options) if options.pictures else _run(options)
    if options.json:
        write_json(options.json, metrics)
    if options.csv:
        replace_text(options.csv, frames_csv(metrics, metrics.get("label", "this model")))
    return 0


def _refuse_without_effect(options: EvaluateOptions, given: frozenset[str]) -> None:
    """Raises InputError for an option that changes nothing where a single method is evaluated."""
    for name, shown in (("seed", "--seed"), ("baselines", "--no-baselines")):
        if name in given:
            raise InputError(f"evaluate: {shown} has no effect without a comparison; add --compare, or omit {shown}")
    if options.label and options.pictures is None:
        raise InputError(
            "evaluate: --label has no effect without --pictures; a comparison takes NAME=PATH, or omit --label"
        )
    if options.run is not None and any(name.startswith("sequence.") for name in given):
        raise InputError(f"evaluate: --sequence.* with {options.run} is not allowed: the settings of a run are fixed")
    if "view" in given and options.pictures is not None:
        raise InputError("evaluate: --no-view has no effect with --pictures: no view.html is written; omit --no-view")


def _compare(options: EvaluateOptions, given: frozenset[str]) -> int:
    """Compare several methods."""
    if not options.methods:
        raise InputError("evaluate: METHOD is missing: run folders, JSON files or folders of pictures to compare")
    for name in ("pictures", "label", "measures"):
        if getattr(options, name):
            raise InputError(f"evaluate: --{name} with several methods is not allowed; allowed: evaluate one first")
    if "view" in given:
        raise InputError("evaluate: --no-view has no effect in a comparison: no view.html is written; omit --no-view")
    compare_methods(options)
    return 0


def _run(options: EvaluateOptions) -> "EvaluationRecord":
    """Metrics of the run, written to its folder."""
    from endotsr.studies.windows.record import is_windowed
    from endotsr.training.runs.model import load_model
    from endotsr.training.runs.sources import load_run_sequence

    if options.run is None:
        raise InputError("evaluate: RUN is missing: a run folder, or --pictures FOLDER with --sequence SEQUENCE")
    if is_windowed(options.run):
        from endotsr.cli.parts.windows import evaluate_windows

        if options.measures:
            raise InputError(f"evaluate: --measures with {options.run} is not allowed: it is a run of windows")
        if not options.view:
            raise InputError(f"evaluate: --no-view has no effect with {options.run}: a run of windows has no view.html")
        return cast("EvaluationRecord", evaluate_windows(options.run, options.lpips, options.sequence))
    folder = open_run(options.run)
    load_model(folder)  # raises for a run without a usable checkpoint, before the sequence is read
    sequence = load_run_sequence(folder, options.sequence)
    return evaluate_run(
        folder,
        sequence,
        options.lpips,
        view=options.view,
        measures=options.measures,
        source=options.sequence,
    )


def _pictures(options: EvaluateOptions) -> "EvaluationRecord":
    """Metrics of a folder of pictures."""
    from endotsr.results.evaluation.lpips import load_lpips_weights
    from endotsr.results.evaluation.pictures import find_pictures, measure_pictures
    from endotsr.results.report.run_text import held_out_table

    assert options.pictures is not None
    weights = load_lpips_weights(options.lpips)
    sequence = shown_sequence("evaluate", options.run, options.sequence, options.settings)
    found = find_pictures(options.pictures, sequence)
    print(f"{options.pictures}: {len(found.files)} pictures, paired {found.pairing}")
    metrics = measure_pictures(found, sequence, options.label, weights)
    print(held_out_table(metrics))
    return metrics


def evaluate_run(
    folder: RunFolder,
    sequence: "Sequence",
    lpips: Path | None = None,
    *,
    view: bool = True,
    measures: tuple[str, ...] = (),
    source: str | None = None,
    wait: bool = False,
) -> "RunEvaluation":
    """Measure the latest checkpoint, write the files of an evaluation, and print the table; returns metrics.json.

    view       also write the viewer page linked from the report
    measures   names of `evaluation.measures.MEASURES`
    source     current location of the sequence; default: the recorded one
    wait       wait while another process evaluates the run, in place of refusing
    """
    from endotsr.results.evaluation.lpips import load_lpips_weights
    from endotsr.results.evaluation.measures import check_measures, measure_lines
    from endotsr.results.evaluation.run import measure_folder
    from endotsr.results.export.scene import MovingScene
    from endotsr.results.report.run_files import write_evaluation
    from endotsr.results.report.run_text import held_out_table
    from endotsr.results.views.page import RUN_PAGE, write_run_page
    from endotsr.results.views.preview import preview
    from endotsr.training.runs.sources import run_source

    check_measures(measures, "--measures")
    refuse_read_only(folder.path)
    weights, source = load_lpips_weights(lpips), source or run_source(folder)[0]
    with evaluating(folder, wait=wait):
        model, metrics, held_out = measure_folder(folder, sequence, source, weights=weights, measures=measures)
        scene = MovingScene(folder.sequence_record(), model, folder)
        write_run_page(folder.path, scene, sequence if view else None)
        write_evaluation(folder, sequence, metrics, held_out, preview(scene), RUN_PAGE if view else "")
    print(held_out_table(metrics))
    for line in measure_lines(metrics.get("measures", {})):
        print(line)
    print(f"report: {folder.path / 'report.html'}", flush=True)
    return metrics
