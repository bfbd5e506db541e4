"""`endotsr train --windows`, and the evaluation of such a run."""

from pathlib import Path
from typing import TYPE_CHECKING

from endotsr.cli.parts.progress import StepBar
from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.results.report.tables import duration
from endotsr.training.runs.files import refuse_inside, refuse_read_only, warn, write_json
from endotsr.training.runs.folder import RunFolder
from endotsr.training.runs.sources import SIMULATED
from endotsr.untrusted.writing import leftover_notes

if TYPE_CHECKING:
    from endotsr.studies.sweeps.place import Place
    from endotsr.studies.windows.evaluation import Flicker, Seams, WindowedEvaluation, WindowRow

AUTO = "auto"


def train_windows(out: Path, place: "Place") -> int:
    """Train the windows of a plan; returns 0, or 1 if a window failed."""
    from endotsr.studies.sweeps.execute import FINISHED
    from endotsr.studies.sweeps.place import outcomes_at
    from endotsr.studies.windows.make import make_windows, size_of
    from endotsr.studies.windows.record import read_record

    record = read_record(out)
    for gap in record.left_out:
        print(f"left out: frames {gap.first}:{gap.end}: {gap.reason}")
    for window in record.windows:
        print(f"window {window.name}: frames {window.first}:{window.end}, {window.start} start, {window.begins}")
    outcomes = lambda jobs: outcomes_at(place, jobs, out, size_of, what="windows")
    with StepBar("iterations") as bar:
        found = make_windows(out, outcomes, bar)
    return 0 if all(outcome.status == FINISHED for outcome in found) else 1


def plan_windows(source: str, out: Path, config: Config, windows: str, overlap: int, chain: int) -> None:
    """Survey a recording and write its window plan; `windows` is a number of frames or `auto`."""
    from endotsr.studies.windows.make import plan_recording
    from endotsr.studies.windows.plan import Wanted

    if source in ("", SIMULATED):
        raise InputError("train: --windows needs a sequence folder; use a folder of `prepare` or `simulate`")
    if windows != AUTO and not (windows.isascii() and windows.isdecimal()):
        raise InputError(f"train: --windows {windows!r} is not allowed; use auto, or a number of frames")
    refuse_inside(out, Path(source), "the sequence")
    print(f"reading every frame of {source} once", flush=True)
    wanted = Wanted(None if windows == AUTO else int(windows), overlap, chain)
    plan_recording(Path(source), config, wanted, out)


def evaluate_windows(
    run: Path, lpips: Path | None = None, source: str | None = None, *, wait: bool = False
) -> "WindowedEvaluation":
    """Evaluate a run of windows, write metrics.json to its folder, and print the tables; returns the metrics.

    wait   as in `RunFolder.evaluating`
    """
    from endotsr.results.evaluation.lpips import load_lpips_weights
    from endotsr.results.report.run_text import held_out_table
    from endotsr.studies.windows.measure import measure_windows
    from endotsr.studies.windows.scene import WindowFrames, open_windows

    scene = open_windows(run)
    refuse_read_only(run)
    with RunFolder(run).evaluating(wait=wait):
        for note in leftover_notes(run / "metrics.json"):
            warn(note)
        metrics = measure_windows(scene, WindowFrames(scene, source), load_lpips_weights(lpips))
        write_json(run / "metrics.json", metrics)
    for row in metrics["windows"]:
        print(_row(row))
    if "held_out" in metrics:
        print(held_out_table(metrics))
    print(seam_line(metrics["seams"]))
    for gap in metrics["left_out"]:
        print(f"left out: frames {gap['first']}:{gap['end']}: {gap['reason']}")
    return metrics


def _row(row: "WindowRow") -> str:
    memory, psnr = row["peak_memory_bytes"], row["psnr_tissue"]
    words = [f"window {row['name']}: frames {row['first']}:{row['end']}, {row['start']}"]
    words += [f"{row['iterations']} iterations in {duration(row['seconds'])}"]
    words += [f"{row['saved']} iterations saved"] if row["saved"] else []
    words += [] if memory is None else [f"peak memory {memory / 1e9:.2f} GB"]
    return ", ".join([*words, "no held-out frame" if psnr is None else f"PSNR tissue {psnr:.2f} dB"])


def seam_line(seams: "Seams") -> str:
    """Flicker of model and recording in one line, with the places that have frames."""

    def shown(values: "Flicker") -> str:
        places = (("at seams", values["seams"]), ("inside", values["inside"]))
        found = ", ".join(f"{value:.2f} {where}" for where, value in places if value is not None) or "not measured"
        return found if values["ratio"] is None else f"{found} (ratio {values['ratio']:.2f})"

    return f"flicker, grey levels: model {shown(seams['model'])}; recorded frames {shown(seams['recorded'])}"
