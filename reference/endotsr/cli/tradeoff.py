"""`endotsr tradeoff`: error against time, and the best setting within a budget."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import given_names, parse
from endotsr.cli.parts.progress import StepBar
from endotsr.cli.parts.related_options import TRADEOFF
from endotsr.cli.parts.relations import check_relations
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.errors import InputError
from endotsr.studies.windows.record import FOLDER, is_windowed
from endotsr.training.runs.files import refuse_folder, refuse_read_only, write_json
from endotsr.untrusted.marks import refuse_foreign
from endotsr.untrusted.writing import replace_text

if TYPE_CHECKING:
    from endotsr.studies.tradeoff.results import DatedMeasurement
    from endotsr.studies.tradeoff.scenes import StudyScene

RESULT, PAGE = "tradeoff.json", "tradeoff.html"  # in the folder of the measurement


@dataclass
class TradeoffOptions:
    """Measure error against time for many settings of the renderer; write the measurement to --out.

    The scene is simulated, a trained --run, or a file of --splats. With --budget, a setting is chosen from the
    measurement in --out; a missing measurement is made first.
    """

    out: Annotated[Path, Option("DIR")] = Path("tradeoff")
    """folder of the measurement"""
    run: Annotated[Path | None, Option("RUN")] = None
    """run folder with the scene"""
    splats: Annotated[Path | None, Option("FILE")] = None
    """file of trained Gaussians: .ply, or .npz with xyz, log_scale, quat_wxyz, rgb, opacity"""
    scale: float = 1.0
    """scale of the picture, relative to the scene's"""
    budget: str | None = None
    """print the best measured setting within a time per frame ("10 ms", "30 fps": the most accurate) or an error
    ("1/255", "1e-3": the fastest)"""
    json: JsonFile = None
    """also write the answer to --budget as JSON"""
    threads: int = 2
    """threads, 0 = all cores"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(TradeoffOptions, words, "tradeoff")
    file = options.out / RESULT
    _refuse(options, given_names(TradeoffOptions, words), file.exists())
    from endotsr.studies.tradeoff.budget import frame_advice, parse_budget
    from endotsr.studies.tradeoff.results import read_measurement

    budget = None if options.budget is None else parse_budget(options.budget)
    result = read_measurement(file) if file.exists() else _measure(options)
    if budget is not None:
        advice = frame_advice(result, budget)
        print("\n".join(advice.lines))
        write_result(options.json, budget=options.budget, point=advice.point, lines=advice.lines)
    return 0


def _refuse(options: TradeoffOptions, given: frozenset[str], measured: bool) -> None:
    """Raises InputError for options without effect, a wrong scale, and a measurement that would be replaced."""
    if options.run is not None and is_windowed(options.run):
        one = options.run / FOLDER / "000"
        raise InputError(f"{options.run}: is a run of windows, each with its scene; use a window, such as {one}")
    if not 0 < options.scale <= 8:
        raise InputError(f"tradeoff: --scale {options.scale:g} is not allowed; use a number > 0 and <= 8")
    folder = "with a measurement" if measured and options.budget is not None else "without a measurement"
    check_relations("tradeoff", TRADEOFF, options, given, {"folder": folder})
    if measured and options.budget is None:
        raise InputError(f"{options.out}: already contains a measurement; choose another --out, or use --budget")


def _measure(options: TradeoffOptions) -> "DatedMeasurement":
    from endotsr.method.kernels.threads import use_threads
    from endotsr.results.report.tables import plain
    from endotsr.studies.tradeoff.page import tradeoff_page
    from endotsr.studies.tradeoff.study import described, run_study
    from endotsr.studies.tradeoff.text import COLUMNS, front_rows, made

    use_threads(options.threads)
    out = options.out
    refuse_folder(out)
    if out.is_dir():
        refuse_read_only(out)
    refuse_foreign(out / PAGE, beside=out / RESULT)
    scene = chosen_scene(options)
    out.mkdir(parents=True, exist_ok=True)
    with StepBar("settings") as bar:
        result = described(run_study(scene, begin=bar.begin, step=bar.step))
    write_json(out / RESULT, result)
    replace_text(out / PAGE, tradeoff_page(result))
    print(made(result), plain(COLUMNS, front_rows(result)), f"page: {out / PAGE}", f"figures: {out / RESULT}", sep="\n")
    return result


def chosen_scene(options: TradeoffOptions) -> "StudyScene":
    """The scene selected by the options."""
    from endotsr.studies.tradeoff import scenes

    if options.splats is not None:
        return scenes.splat_scene(options.splats, max(1, round(scenes.SIDE * options.scale)))
    if options.run is not None:
        return scenes.run_scene(options.run, options.scale)
    with StepBar("simulated scene") as bar:
        bar.begin(scenes.ITERATIONS)
        width = max(16, round(scenes.SIMULATED_WIDTH * options.scale))
        return scenes.simulated_scene(width=width, step=bar.step)
