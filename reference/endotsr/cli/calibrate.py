"""`endotsr calibrate`: equation (7) on the checkpoint of a run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.options import differences, with_short_names
from endotsr.cli.parts.parser import parse
from endotsr.config import PAPER, Config
from endotsr.errors import InputError
from endotsr.runs.files import refuse_unwritable, write_json
from endotsr.runs.folder import open_run

# Settings that equation (7) reads; no other setting would change the result.
REPLACEABLE = (
    "loss.ssim_weight",
    "loss.upsampling",
    "loss.gradient_ratio",
    "loss.calibration_views",
    "raster",
    "training.threads",
)


@dataclass
class CalibrateOptions:
    """Compute the Laplacian weight of equation (7) on the checkpoint of a run, with a table of its views.

    The run is not changed. The settings that equation (7) reads can be replaced: --loss.ssim-weight, --loss.upsampling,
    --loss.gradient-ratio, --loss.calibration-views and the settings of --raster. All others are fixed by the run.
    """

    run: Annotated[Path | None, Option("RUN", positional=True)] = None
    """run folder"""
    sequence: Annotated[str | None, Option("SEQUENCE")] = None
    """current location of the sequence of the run (default: the recorded one)"""
    json: Annotated[Path | None, Option("FILE")] = None
    """also write weight, ratios and table as JSON"""
    threads: int | None = None
    """threads, 0 = all cores"""
    settings: Annotated[Config, Option(flat=True)] = PAPER


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.fitting.objective import calibrate_on
    from endotsr.kernels.threads import use_threads
    from endotsr.runs.model import load_model
    from endotsr.runs.sources import load_run_sequence

    first = parse(CalibrateOptions, words, "calibrate")
    if first.run is None:
        raise InputError("calibrate: RUN is missing: a run folder")
    folder = open_run(first.run)
    kept = folder.config()
    options = parse(CalibrateOptions, words, "calibrate", CalibrateOptions(settings=kept))
    refuse_unwritable(options.json)
    config = with_short_names(options.settings, {"threads": options.threads})
    replaced = differences(config, kept, "run")
    _refuse_fixed(replaced, folder.path)
    model = load_model(folder)
    use_threads(config.training.threads)
    sequence = load_run_sequence(folder, options.sequence)
    found = calibrate_on(model.gaussians, model.spectral, sequence, config, model.frames)
    for line in replaced:
        print(f"setting replaced: {line}")
    print(f"equation (7) at iteration {model.iteration}, r = {config.loss.gradient_ratio:g}")
    print(found.table)
    print(f"lambda_lap = {found.lambda_lap:.6g} ({len(found.ratios)} views)")
    if options.json:
        write_json(options.json, {"iteration": model.iteration, **found._asdict()})
    return 0


def _refuse_fixed(replaced: list[str], run_path: Path) -> None:
    """Raises InputError for settings that the trained run has fixed: they would be named and then not used."""
    fixed = [line for line in replaced if not line.split(" = ")[0].startswith(REPLACEABLE)]
    if fixed:
        raise InputError(
            f"calibrate: {', '.join(fixed)}: fixed by the run {run_path}; allowed: {', '.join(REPLACEABLE)}"
        )
