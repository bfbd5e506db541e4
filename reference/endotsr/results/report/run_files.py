"""The files of an evaluation in a run folder: metrics.json, renders/, test/, curves.png and report.html.

In: the metrics of a run and the renders of its held-out frames. Files and folders are replaced atomically.
"""

import math
import os
import shutil
from collections.abc import Callable
from pathlib import Path

from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import config_to_toml
from endotsr.errors import InputError
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.coverage import times_seen
from endotsr.results.evaluation.records import FrameMetrics, RunEvaluation
from endotsr.results.report.curves import curves_png
from endotsr.results.report.data import FramePictures, Preview, ReportData
from endotsr.results.report.figures import bytes_image, triptych, triptych_picture
from endotsr.results.report.live_page import REPORT, lead_to_report
from endotsr.results.report.sections import report_html
from endotsr.training.runs.files import write_json
from endotsr.training.runs.folder import RunFolder
from endotsr.training.runs.log import log_until
from endotsr.untrusted.names import file_name
from endotsr.untrusted.writing import replace_file, replace_text, replacing_folder

MOST_SHOWN = 24  # the worst held-out frames, shown in the report


def write_evaluation(
    folder: RunFolder,
    sequence: Sequence,
    metrics: RunEvaluation,
    held_out: Callable[[int], RenderOut],
    preview: Preview | None = None,
    viewer: str = "",
) -> None:
    """Write the files of `endotsr evaluate` into a run folder.

    metrics     from `evaluation.run.measure_folder`
    held_out    number of a held-out frame -> render
    preview     animation for the report
    viewer      name of the viewer page in the folder, to link from the report; "" = none
    """
    _write_pictures(folder, metrics["run"]["iteration"], sequence, held_out)
    log = log_until(folder.log, metrics["run"]["iteration"])
    picture = curves_png(log, metrics)
    if picture:
        replace_file(folder.path / "curves.png", lambda path: path.write_bytes(picture))
    about = metrics["run"]["input"]
    data = ReportData(
        title=f"{Path(about.get('source', '')).name}: {folder.path.absolute().name}",
        evaluation=metrics,
        log=log,
        frames=worst_frames(sequence, metrics["held_out"]["per_frame"], held_out),
        configuration=config_to_toml(folder.config()),
        depth_unit=sequence.unit,
        preview=preview,
        viewer=viewer,
    )
    replace_text(folder.path / REPORT, report_html(data))
    write_json(folder.path / "metrics.json", metrics)  # last: a run with its metrics has all the others
    lead_to_report(folder.path)


def _write_pictures(
    folder: RunFolder, iteration: int, sequence: Sequence, held_out: Callable[[int], RenderOut]
) -> None:
    """renders/<name>.png and <name>_comparison.png; test/ours_<iteration>/{renders,gt,masks} with the peers' names."""
    peers = folder.path / "test" / f"ours_{iteration}"
    if peers.parent.is_symlink():
        raise InputError(f"{peers.parent}: is a link; use a folder of the run")
    peers.parent.mkdir(exist_ok=True)
    with replacing_folder(folder.path / "renders") as renders, replacing_folder(peers) as test:
        for name in ("renders", "gt", "masks"):
            (test / name).mkdir()
        for number, index in enumerate(map(int, sequence.test_index)):
            out, name = held_out(index), file_name(sequence.names[index], "names of the frames")
            truth, mask = sequence.frame(index).image, sequence.masks[index]
            write_png(renders / f"{name}.png", bytes_image(out.colour))
            write_png(renders / f"{name}_comparison.png", triptych_picture(triptych(out.colour, truth, mask)))
            _link(renders / f"{name}.png", test / "renders" / f"{number:05d}.png")
            write_png(test / "gt" / f"{number:05d}.png", bytes_image(truth))
            write_png(test / "masks" / f"{number:05d}.png", (mask * 255).astype("uint8"))  # white = tissue


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:  # a file system without hard links
        shutil.copyfile(source, target)


def worst_frames(
    sequence: Sequence, per_frame: list[FrameMetrics], held_out: Callable[[int], RenderOut]
) -> tuple[FramePictures, ...]:
    """The worst held-out frames in order of time; frames without tissue where no others are left."""
    rows, seen = {row["frame"]: row for row in per_frame}, times_seen(sequence)
    # A frame without tissue has no value either, and nothing to show.
    order = sorted(worst_first(rows), key=lambda frame: not sequence.masks[frame].any())
    return tuple(
        FramePictures(
            index=i,
            name=sequence.names[i],
            time=float(sequence.times[i]),
            render=held_out(i).colour,
            truth=sequence.frame(i).image,
            mask=sequence.masks[i],
            depth=held_out(i).depth,
            metrics=rows[i],
            seen=seen,
        )
        for i in sorted(order[:MOST_SHOWN])
    )


def worst_first(rows: dict[int, FrameMetrics]) -> list[int]:
    """Frame numbers by ascending `psnr_tissue`; frames without a value (render not finite) come first."""

    def order(frame: int) -> float:
        value = rows[frame].get("psnr_tissue")
        return -math.inf if value is None or math.isnan(value) else value

    return sorted(rows, key=order)
