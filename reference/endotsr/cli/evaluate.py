"""`endotsr evaluate`: held-out metrics of a run, or of any pictures, with baselines; comparison of methods."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from endotsr.cli.parts.comparison import EvaluateOptions, compare_methods, shown_sequence
from endotsr.cli.parts.evaluating import evaluating
from endotsr.cli.parts.parser import given_names, parse
from endotsr.cli.parts.related_options import EVALUATE
from endotsr.cli.parts.relations import check_relations
from endotsr.errors import InputError
from endotsr.studies.windows.record import is_windowed
from endotsr.training.runs.files import read_json, refuse_read_only, write_json
from endotsr.training.runs.folder import RunFolder, open_run
from endotsr.untrusted.names import counted
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
    of = "of windows" if options.run is not None and is_windowed(options.run) else "of one training"
    check_relations("evaluate", EVALUATE, options, given, {"run": of})
    if len(options.methods) > 1 or options.compare:
        compare_methods(options)
        return 0
    metrics = _pictures(options) if options.pictures else _run(options)
    if options.json:
        write_json(options.json, metrics)
    if options.csv:
        replace_text(options.csv, frames_csv(metrics, metrics.get("label", "this model")))
    return 0


def _run(options: EvaluateOptions) -> "EvaluationRecord":
    """Metrics of the run, written to its folder."""
    from endotsr.training.runs.model import load_model
    from endotsr.training.runs.sources import load_run_sequence

    if options.run is None:
        raise InputError("evaluate: RUN is missing: a run folder, or --pictures FOLDER with --sequence SEQUENCE")
    if is_windowed(options.run):
        from endotsr.cli.parts.windows import evaluate_windows

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
    from endotsr.results.evaluation.pictures import find_renders, measure_pictures
    from endotsr.results.report.run_text import held_out_table

    assert options.pictures is not None
    weights = load_lpips_weights(options.lpips)
    sequence = shown_sequence(options.run, options.sequence, options.settings)
    found = find_renders(options.pictures, sequence)
    print(f"{options.pictures}: {counted(len(found.files), 'picture')}, paired {found.pairing}")
    metrics = measure_pictures(found, sequence, options.label, weights)
    if said := metrics["pictures"]["doubt"]:
        print(f"{options.pictures}: {said}")
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

    The viewer page comes first: it needs no metrics, which take most of the time.

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
    from endotsr.training.runs.model import load_model
    from endotsr.training.runs.sources import run_source

    check_measures(measures, "--measures")
    refuse_read_only(folder.path)
    weights, source = load_lpips_weights(lpips), source or run_source(folder)[0]
    with evaluating(folder, wait=wait):
        before = _earlier(folder)
        model = load_model(folder)
        scene = MovingScene(folder.sequence_record(), model, folder)
        write_run_page(folder.path, scene, sequence if view else None)
        if view:
            print(f"viewer: {folder.path / RUN_PAGE}", flush=True)
        metrics, held_out = measure_folder(folder, model, sequence, source, weights=weights, measures=measures)
        write_evaluation(folder, sequence, metrics, held_out, preview(scene), RUN_PAGE if view else "")
    print(held_out_table(metrics))
    for line in measure_lines(metrics.get("measures", {})):
        print(line)
    if gone := sorted(before - _optional(metrics)):
        print(f"of the earlier evaluation, metrics.json does not contain any more: {', '.join(gone)}")
    print(f"report: {folder.path / 'report.html'}", flush=True)
    return metrics


def _earlier(folder: RunFolder) -> set[str]:
    """`_optional` of the metrics.json in the folder of a run; empty without a readable file."""
    try:
        return _optional(read_json(folder.path / "metrics.json", ("held_out.mean",)))
    except InputError:
        return set()


def _optional(metrics: Mapping[str, Any]) -> set[str]:
    """What metrics of a run contain by an option: LPIPS and measures."""
    mean, measures = metrics["held_out"]["mean"], metrics.get("measures")
    perceived = isinstance(mean, dict) and mean.get("lpips") is not None
    names = {f"{name} (--measures {name})" for name in measures} if isinstance(measures, dict) else set()
    return names | ({"LPIPS (--lpips FILE)"} if perceived else set())
