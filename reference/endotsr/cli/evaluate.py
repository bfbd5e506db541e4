"""`endotsr evaluate`: what a run reached on the frames it never saw, beside what needs no model."""

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from endotsr.cli.parts.options import parse
from endotsr.report.words import duration
from endotsr.runs.files import replace_file, replacing_folder, write_json
from endotsr.runs.folder import RunFolder, open_run

if TYPE_CHECKING:
    from endotsr.runs.model import Model
    from endotsr.sequences.sequence import Sequence

PUBLISHED = {
    "pulling": {
        "label": "Endo-TSR as published, EndoNeRF pulling",
        "psnr_full": 39.34,
        "ssim_full": 0.967,
        "lpips": 0.035,
    }
}
COMPONENTS = {"appearance": "A, colour residual", "spectral_motion": "S, translation residual"}
SHOWN = (("psnr_full", "PSNR full", 2), ("psnr_tissue", "PSNR tissue", 2), ("ssim_full", "SSIM full", 4))
TABLE = (*SHOWN, ("ssim_tissue", "SSIM tissue", 4), ("lpips", "LPIPS", 4))


@dataclass
class EvaluateOptions:
    """Measure a run on its held-out frames: metrics.json, renders/, curves.png and report.html in the run folder."""

    run: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RUN")]
    """run folder"""
    sequence: Annotated[str | None, tyro.conf.arg(metavar="SEQUENCE")] = None
    """where the sequence of the run is now (default: where it was)"""
    lpips: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """AlexNet LPIPS weights (.npz)"""
    paper_row: Annotated[Literal["pulling"] | None, tyro.conf.arg(metavar="{pulling}")] = None
    """also show the published figures of this clip"""
    threads: int = 0
    """threads, 0 = all cores"""


def run(words: list[str]) -> int:
    """The command."""
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
) -> dict[str, Any]:
    """Measure the latest checkpoint, write the files of an evaluation, print the table; returns metrics.json."""
    from endotsr.evaluation.evaluate import evaluate_model
    from endotsr.evaluation.lpips import load_lpips_weights
    from endotsr.fitting.model import render_at, without
    from endotsr.runs.model import load_model

    weights = load_lpips_weights(lpips)
    model = load_model(folder)

    def render(index: int, taken_out: str = "") -> Any:
        shown = without(model.gaussians, **({taken_out: False} if taken_out else {}))
        camera, time = sequence.cameras[index], float(sequence.times[index])
        return render_at(shown, model.spectral, model.config, camera, time)

    held_out = {int(i): render(int(i)) for i in sequence.test_index}
    metrics = evaluate_model(sequence, lambda i: (held_out.get(i) or render(i)).colour, weights)
    metrics["components"] = _components(model, sequence, render, metrics["held_out"]["mean"])
    metrics["published"] = list(published)
    metrics["run"] = _about_run(folder, model)
    _write_pictures(folder, model, sequence, held_out)
    write_json(folder.path / "metrics.json", metrics)
    _write_report(folder, sequence, metrics, held_out, published)
    print(held_out_table(metrics))
    print(f"report: {folder.path / 'report.html'}", flush=True)
    return metrics


def _components(model: "Model", sequence: "Sequence", render: Any, full: dict[str, Any]) -> list[dict[str, Any]]:
    """Held-out means with one spectral component taken out of the trained model, for those it has."""
    from endotsr.evaluation.evaluate import evaluate_frames

    rows = [{"label": "the whole model", **full}]
    arrays = {
        "appearance": model.gaussians.appearance_coefficients,
        "spectral_motion": model.gaussians.motion_coefficients,
    }
    for name, label in COMPONENTS.items():
        if arrays[name] is not None:
            partial = evaluate_frames(sequence, sequence.test_index, lambda i, n=name: render(i, n).colour)
            rows.append({"label": f"rendered without {label}", **partial.mean})
    return rows


def _about_run(folder: RunFolder, model: "Model") -> dict[str, Any]:
    """What the numbers belong to: enough for metrics.json to stand alone."""
    import msgspec

    record = folder.record()
    kept = (
        "seed",
        "threads",
        "started",
        "finished",
        "seconds",
        "peak_memory_bytes",
        "lambda_lap",
        "versions",
        "machine",
    )
    about = {
        "iteration": model.iteration,
        "iterations_planned": model.config.training.iterations,
        "status": record.get("status"),
        "gaussians": model.gaussians.count,
    }
    return about | {key: record.get(key) for key in (*kept, "input")} | {"settings": msgspec.to_builtins(model.config)}


def _write_pictures(folder: RunFolder, model: "Model", sequence: "Sequence", held_out: dict[int, Any]) -> None:
    """renders/<name>.png and <name>_comparison.png; test/ours_<iteration>/{renders,gt,masks} as the peers name them."""
    from endotsr.cli.parts.pictures import rgb_bytes
    from endotsr.opencv import write_png
    from endotsr.report.figures import triptych, triptych_picture

    peers = folder.path / "test" / f"ours_{model.iteration}"
    peers.parent.mkdir(exist_ok=True)
    with replacing_folder(folder.path / "renders") as renders, replacing_folder(peers) as test:
        for name in ("renders", "gt", "masks"):
            (test / name).mkdir()
        for number, (index, out) in enumerate(held_out.items()):
            name = sequence.names[index]
            truth, mask = sequence.frame(index).image, sequence.masks[index]
            write_png(renders / f"{name}.png", rgb_bytes(out.colour))
            write_png(renders / f"{name}_comparison.png", triptych_picture(triptych(out.colour, truth, mask)))
            _link(renders / f"{name}.png", test / "renders" / f"{number:05d}.png")
            write_png(test / "gt" / f"{number:05d}.png", rgb_bytes(truth))
            write_png(test / "masks" / f"{number:05d}.png", (mask * 255).astype("uint8"))  # white = tissue


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:  # a file system without hard links
        shutil.copyfile(source, target)


def _write_report(
    folder: RunFolder,
    sequence: "Sequence",
    metrics: dict[str, Any],
    held_out: dict[int, Any],
    published: tuple[dict[str, Any], ...],
) -> None:
    from endotsr.config import config_to_toml
    from endotsr.report.curves import curves_png, read_log
    from endotsr.report.data import FramePictures, ReportData
    from endotsr.report.page import write_report

    record, reached = folder.record(), metrics["run"]["iteration"]
    log = [entry for entry in read_log(folder.log) if entry["iteration"] <= reached]  # what the checkpoint has seen
    picture = curves_png(log, metrics)
    if picture:
        replace_file(folder.path / "curves.png", lambda path: path.write_bytes(picture))
    rows = {row["frame"]: row for row in metrics["held_out"]["per_frame"]}
    frames = tuple(
        FramePictures(
            index=i,
            name=sequence.names[i],
            time=float(sequence.times[i]),
            render=out.colour,
            truth=sequence.frame(i).image,
            mask=sequence.masks[i],
            depth=out.depth,
            metrics=rows[i],
        )
        for i, out in held_out.items()
    )
    data = ReportData(
        title=f"{Path(record['input']['source']).name}: {folder.path.absolute().name}",
        evaluation=metrics,
        log=log,
        frames=frames,
        reference_rows=published,
        components=(_component_table(metrics),),
        facts=facts(metrics),
        configuration=config_to_toml(folder.config()),
        versions=record["versions"],
        input_hashes=record["input"].get("files_sha256") or record["input"]["arrays_sha256"],
        notes=tuple(record["input"]["notes"]),
        depth_unit=sequence.unit,
    )
    write_report(folder.path / "report.html", data)


def _component_table(metrics: dict[str, Any]) -> Any:
    from endotsr.report.data import FreeTable

    whole = metrics["components"][0]
    rows = []
    for row in metrics["components"]:
        cells = [_number(row.get(key), digits) for key, _, digits in SHOWN]
        change = None if row is whole else _gain(row, whole)
        rows.append((row["label"], *cells, "" if change is None else f"{change:+.2f} dB"))
    return FreeTable(
        "Held-out means with one component taken out",
        ("Rendered", *(label for _, label, _ in SHOWN), "Change, PSNR tissue"),
        tuple(rows),
        "The trained model, rendered with the named residual set to zero. Component L, the detail loss, acts in "
        "training only; to see it, train with --model.no-laplacian.",
    )


def _gain(row: dict[str, Any], whole: dict[str, Any]) -> float | None:
    a, b = row.get("psnr_tissue"), whole.get("psnr_tissue")
    return None if a is None or b is None else a - b


def iterations(run: dict[str, Any]) -> str:
    """How far the measured checkpoint is: "6000", or "2000 of 6000, the run is not finished"."""
    done, planned = run["iteration"], run["iterations_planned"]
    return f"{done}" if done >= planned else f"{done} of {planned}, the run is not finished"


def facts(metrics: dict[str, Any]) -> dict[str, Any]:
    """What a reader of the report wants to know about the run."""
    run = metrics["run"]
    about, machine = run["input"], run["machine"]
    peak, memory = run["peak_memory_bytes"], machine["memory_bytes"]
    return {
        "Sequence": f"{about['source']}, {about['frames']} frames of {about['width']}x{about['height']}",
        "Frames": f"{about['training_frames']} for training, {about['held_out_frames']} held out",
        "Tissue": f"{about['tissue_fraction']:.1%} of the pixels",
        "Iterations": iterations(run),
        "Gaussians": run["gaussians"],
        "Detail weight": run["lambda_lap"],
        "Seed": run["seed"],
        "Threads": run["threads"],
        "Training time": duration(run["seconds"]),
        "Peak memory": f"{peak / 1e9:.2f} GB" if peak else "not known",
        "Machine": f"{machine['processor']}, {machine['cores']} cores, "
        + (f"{memory / 1e9:.0f} GB" if memory else "memory not known"),
        "System": machine["system"],
    }


def held_out_table(metrics: dict[str, Any]) -> str:
    """The held-out means of model, baselines and published figures as text."""
    from endotsr.evaluation.evaluate import left_out

    rows = [("this model", metrics["held_out"]["mean"])]
    rows += [(entry["label"], entry["mean"]) for entry in metrics["baselines"].values()]
    rows += [(entry["label"], entry) for entry in metrics["published"]]
    columns = [column for column in TABLE if any(mean.get(column[0]) is not None for _, mean in rows)]
    width = max(len(label) for label, _ in rows)
    frames = len(metrics["held_out"]["per_frame"])
    lines = [" ".join([f"{f'{frames} held-out frames':<{width}}", *(f"{label:>12}" for _, label, _ in columns)])]
    for label, mean in rows:
        cells = (f"{_number(mean.get(key), digits):>12}" for key, _, digits in columns)
        lines.append(" ".join([f"{label:<{width}}", *cells]))
    inside = metrics["training"]["mean"].get("psnr_tissue")
    lines.append(f"training frames: PSNR tissue {_number(inside, 2)} dB")
    if frames := left_out(metrics):
        lines.append(f"left out of the means of the tissue, without a finite value there: {', '.join(frames)}")
    if metrics["run"]["iteration"] < metrics["run"]["iterations_planned"]:
        lines.append(f"checkpoint of iteration {iterations(metrics['run'])}")
    if metrics["lpips_reason"]:
        lines.append(f"LPIPS: {metrics['lpips_reason']} (--lpips FILE)")
    return "\n".join(lines)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
