"""The numbers of an evaluated run as text: facts, the table of components, the table on the terminal.

In: the dictionary of metrics.json. Out: text and plain tables; no file, no HTML.
"""

from endotsr.evaluation.evaluate import left_out
from endotsr.evaluation.records import EvaluationRecord, LabelledMeans, MotionPart, PosePart, RunEvaluation, RunPart
from endotsr.report.data import Facts, FreeTable
from endotsr.report.words import duration

SHOWN = (("psnr_full", "PSNR full", 2), ("psnr_tissue", "PSNR tissue", 2), ("ssim_full", "SSIM full", 4))
TABLE = (*SHOWN, ("ssim_tissue", "SSIM tissue", 4), ("lpips", "LPIPS", 4))


def iterations(run: RunPart) -> str:
    """Iteration of the measured checkpoint: "6000", or "2000 of 6000, the run is not finished"."""
    done, planned = run["iteration"], run["iterations_planned"]
    return f"{done}" if done >= planned else f"{done} of {planned}, the run is not finished"


def facts(metrics: RunEvaluation) -> Facts:
    """The facts about the run that the report lists."""
    run = metrics["run"]
    about, machine = run["input"], run["machine"]
    peak, memory = run["peak_memory_bytes"], machine.get("memory_bytes")
    size = f"{about.get('width')}x{about.get('height')}"
    return {
        "Sequence": f"{about.get('source')}, {about.get('frames')} frames of {size}",
        "Frames": f"{about.get('training_frames')} for training, {about.get('held_out_frames')} held out",
        "Tissue": f"{about.get('tissue_fraction', 0.0):.1%} of the pixels",
        "Iterations": iterations(run),
        "Gaussians": run["gaussians"],
        "Laplacian weight": run["lambda_lap"],
        "Seed": run["seed"],
        "Threads": run["threads"],
        "Training time": duration(run["seconds"] or 0.0),
        "Peak memory": f"{peak / 1e9:.2f} GB" if peak else "not known",
        "Machine": f"{machine.get('processor')}, {machine.get('cores')} cores, "
        + (f"{memory / 1e9:.0f} GB" if memory else "memory not known"),
        "System": machine.get("system"),
    }


def held_out_table(metrics: EvaluationRecord) -> str:
    """The held-out means of model and baselines as text.

    metrics   of `evaluation.run.measure_folder`, or of `evaluation.pictures.measure_pictures`, which has a `label`
    """
    rows = [(metrics.get("label", "this model"), metrics["held_out"]["mean"])]
    rows += [(entry["label"], entry["mean"]) for entry in [metrics.get("cross_fade")] if entry]
    rows += [(entry["label"], entry["mean"]) for entry in metrics["baselines"].values()]
    columns = [column for column in TABLE if any(mean.get(column[0]) is not None for _, mean in rows)]
    width = max(len(label) for label, _ in rows)
    frames = len(metrics["held_out"]["per_frame"])
    lines = [" ".join([f"{f'{frames} held-out frames':<{width}}", *(f"{label:>12}" for _, label, _ in columns)])]
    for label, mean in rows:
        cells = (f"{_number(mean.get(key), digits):>12}" for key, _, digits in columns)
        lines.append(" ".join([f"{label:<{width}}", *cells]))
    inside = metrics["training"]["mean"].get("psnr_tissue")
    run: RunPart | None = metrics.get("run")
    if run is not None or inside is not None:
        lines.append(f"training frames: PSNR tissue {_number(inside, 2)} dB")
    if motion := metrics.get("trajectories"):
        lines.append(trajectory_sentence(motion))
    if change := metrics.get("pose_correction"):
        lines.append(pose_sentence(change))
    if frames := left_out(metrics):
        lines.append(f"left out of the means of the tissue, without a finite value there: {', '.join(frames)}")
    if run is not None and run["iteration"] < run["iterations_planned"]:
        lines.append(f"checkpoint of iteration {iterations(run)}")
    if metrics["lpips_reason"]:
        lines.append(f"LPIPS: {metrics['lpips_reason']} (--lpips FILE)")
    return "\n".join(lines)


def trajectory_sentence(motion: MotionPart) -> str:
    """The error of the motion beside the motion itself."""
    return (
        f"True motion: mean trajectory error {motion['scene_units']:.3f} {motion['unit']} "
        f"({motion['pixels']:.2f} px), where the tissue moves {motion['motion_scene_units']:.3f} {motion['unit']} "
        f"({motion['motion_pixels']:.2f} px)."
    )


def pose_sentence(change: PosePart) -> str:
    """How far the cameras were moved."""
    return (
        f"Poses: corrected by {change['degrees']:.2f} degrees and {change['scene_units']:.2f} {change['unit']} in the "
        f"mean, which moves the picture by {change['pixels']:.2f} px."
    )


def component_table(metrics: RunEvaluation) -> FreeTable:
    """Held-out means of the model rendered without one component at a time."""
    found, rows = metrics.get("components", []), []
    for row in found:
        cells = [_number(row.get(key), digits) for key, _, digits in SHOWN]
        change = None if row is found[0] else _gain(row, found[0])
        rows.append((row["label"], *cells, "" if change is None else f"{change:+.2f} dB"))
    return FreeTable(
        "Held-out means without one component",
        ("Rendered", *(label for _, label, _ in SHOWN), "Change, PSNR tissue"),
        tuple(rows),
        "The trained model, rendered with the named residual set to zero. Component L, the Laplacian loss, acts in "
        "training only; to see it, train with --model.no-laplacian.",
    )


def _gain(row: LabelledMeans, whole: LabelledMeans) -> float | None:
    a, b = row.get("psnr_tissue"), whole.get("psnr_tissue")
    return None if a is None or b is None else a - b


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
