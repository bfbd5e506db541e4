"""`endotsr train --calibrate-only`: evaluate equation (7) on the checkpoint of a run, without changing the run."""

from pathlib import Path

from endotsr.cli.parts.options import differences
from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.training.runs.files import write_json
from endotsr.training.runs.folder import RunFolder
from endotsr.untrusted.names import choice, counted

# Settings that affect equation (7).
REPLACEABLE = (
    "loss.ssim_weight",
    "loss.upsampling",
    "loss.gradient_ratio",
    "loss.calibration_views",
    "raster",
    "training.threads",
)


def calibrate_run(folder: RunFolder, config: Config, source: str | None, json: Path | None) -> None:
    """Print the table of the calibration views and the weight, and optionally write them to `json`.

    config   settings of the run, with changes only to `REPLACEABLE`
    source   current location of the sequence; None = the recorded one

    Raises:  InputError for a change of another setting; CalibrationError if no view gives a ratio.
    """
    from endotsr.method.kernels.threads import use_threads
    from endotsr.training.fitting.objective import calibrate_on
    from endotsr.training.runs.model import load_model
    from endotsr.training.runs.sources import load_run_sequence

    replaced = differences(config, folder.config(), "run")
    _refuse_fixed(replaced, folder.path)
    model = load_model(folder)
    use_threads(config.training.threads)
    sequence = load_run_sequence(folder, source)
    found = calibrate_on(model.gaussians, model.spectral, sequence, config, model.frames)
    for line in replaced:
        print(f"setting replaced: {line}")
    print(f"equation (7) at iteration {model.iteration}, r = {config.loss.gradient_ratio:g}")
    print(found.table)
    print(f"lambda_lap = {found.lambda_lap:.6g} ({counted(len(found.ratios), 'view')})")
    if json:
        write_json(json, {"iteration": model.iteration, **found._asdict()})


def _refuse_fixed(replaced: list[str], run_path: Path) -> None:
    """Raises InputError for changed settings that do not affect equation (7)."""
    fixed = [line for line in replaced if not line.split(" = ")[0].startswith(REPLACEABLE)]
    if fixed:
        raise InputError(
            f"--calibrate-only: {', '.join(fixed)}: fixed by the run {run_path}; use {choice(REPLACEABLE)}"
        )
