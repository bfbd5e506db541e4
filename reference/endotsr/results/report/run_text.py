"""The metrics of an evaluated run as text: facts, sentences, and the table for the terminal.

In: the dictionary of metrics.json. Out: plain text.
"""

from endotsr.results.evaluation.evaluate import OWN, all_extrapolated, held_out_means, left_out
from endotsr.results.evaluation.records import EvaluationRecord, FramesMeasured, Means, MotionPart, PosePart, RunPart
from endotsr.results.report.tables import duration, fixed, plain
from endotsr.untrusted.names import counted

SHOWN = (("psnr_full", "PSNR full", 2), ("psnr_tissue", "PSNR tissue", 2), ("ssim_full", "SSIM full", 4))
TABLE = (*SHOWN, ("ssim_tissue", "SSIM tissue", 4), ("lpips", "LPIPS", 4))


def iterations(run: RunPart) -> str:
    """Iteration of the evaluated checkpoint: "6000", or "2000 of 6000, the run is not finished"."""
    done, planned = run["iteration"], run["iterations_planned"]
    return f"{done}" if done >= planned else f"{done} of {planned}, the run is not finished"


def training_time(run: RunPart) -> str | None:
    """The time of the training; None if run.json has no seconds yet."""
    return duration(run["seconds"]) if run["seconds"] else None


def facts(run: RunPart) -> dict[str, str | int | float | None]:
    """Label -> value for the facts listed in the report."""
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
        "Training time": training_time(run),
        "Peak memory": f"{peak / 1e9:.2f} GB" if peak else "unknown",
        "Machine": f"{machine.get('processor')}, {machine.get('cores')} cores, "
        + (f"{memory / 1e9:.0f} GB" if memory else "memory unknown"),
        "System": machine.get("system"),
    }


def held_out_table(metrics: EvaluationRecord) -> str:
    """The held-out means of model and baselines as text.

    metrics   of a run, or from `evaluation.pictures.measure_pictures` (with `label`)
    """
    measured: list[tuple[str, FramesMeasured]] = [(metrics.get("label", "this model"), metrics["held_out"])]
    measured += [(entry["label"], entry) for key in OWN if (entry := metrics.get(key))]
    measured += [(entry["label"], entry) for entry in metrics["baselines"].values()]
    means = [(label, *held_out_means(metrics, entry)) for label, entry in measured]
    total, outside = len(metrics["held_out"]["per_frame"]), (metrics.get("frames") or {}).get("extrapolated") or []
    split = bool(means[0][2])  # frames between training frames, and extrapolated ones
    between = total - len(outside) if split else total
    lines = [_means_table(counted(between, "held-out frame"), [row[:2] for row in means])]
    if split:
        lines.append(_means_table(f"{len(outside)} extrapolated", [(label, beyond) for label, _, beyond in means]))
    elif outside:
        lines.append("every held-out frame is extrapolated: no training frame is on its other side")
    if sentence := interpolation_sentence(metrics):
        lines.append(sentence)
    inside = metrics["training"]["mean"].get("psnr_tissue")
    run: RunPart | None = metrics.get("run")
    if run is not None or inside is not None:
        lines.append(f"training frames: PSNR tissue {fixed(inside, 2)} dB")
    if motion := metrics.get("trajectories"):
        lines.append(trajectory_sentence(motion))
    if change := metrics.get("pose_correction"):
        lines.append(pose_sentence(change))
    if frames := left_out(metrics):
        lines.append(f"excluded from the tissue means (no finite value): {', '.join(frames)}")
    if run is not None and run["iteration"] < run["iterations_planned"]:
        lines.append(f"checkpoint of iteration {iterations(run)}")
    if metrics["lpips_reason"]:
        lines.append(f"LPIPS: {metrics['lpips_reason']} (--lpips FILE)")
    return "\n".join(lines)


def _means_table(head: str, rows: list[tuple[str, Means]]) -> str:
    """A table of means with the columns that have a value."""
    columns = [column for column in TABLE if any(mean.get(column[0]) is not None for _, mean in rows)]
    cells = [[label, *(fixed(mean.get(key), digits) for key, _, digits in columns)] for label, mean in rows]
    return plain([head, *(label for _, label, _ in columns)], cells)


def interpolation_sentence(metrics: EvaluationRecord) -> str:
    """A sentence if the blend of the two neighbouring frames predicts the frames between better than the model.

    Edges   "" if the model is level or above in PSNR of the tissue, if one of the two has no finite value, or if no
            held-out frame is between training frames. Where the model has the lower LPIPS, the sentence is
            restricted to PSNR. A second sentence follows if the model is below the blend on its own training frames
            too: a longer training may then change the order. If the recorded texture raises the model above the blend,
            the sentence says so instead.
    """
    blend = metrics["baselines"].get("two_neighbours")
    if blend is None or all_extrapolated(metrics):
        return ""
    ours, theirs = (held_out_means(metrics, entry)[0] for entry in (metrics["held_out"], blend))
    model, best = ours.get("psnr_tissue"), theirs.get("psnr_tissue")
    if model is None or best is None or model >= best:
        return ""
    perceived = [mean.get("lpips") for mean in (ours, theirs)]
    values, scope = f"{best:.2f} dB on tissue, this model {model:.2f} dB", ""
    if perceived[0] is not None and perceived[1] is not None:
        values += f" (LPIPS {perceived[1]:.4f} and {perceived[0]:.4f})"
        scope = "in PSNR, " if perceived[0] < perceived[1] else ""
    textured = held_out_means(metrics, entry)[0] if (entry := metrics.get("recorded_texture")) else {}
    raised, lpips = textured.get("psnr_tissue"), textured.get("lpips")
    if raised is not None and raised > best:
        perceived_too = "" if lpips is None else f" (LPIPS {lpips:.4f})"
        return (
            f"Between its training frames this model is below a blend: that of the two neighbouring frames reaches"
            f" {values}. With the recorded texture of these frames it reaches {raised:.2f} dB{perceived_too}."
        )
    sentence = f"{scope}interpolation suffices on this clip for the frames between: the blend of the two neighbouring"
    sentence = f"{sentence[0].upper()}{sentence[1:]} training frames reaches {values}."
    fitted = metrics["training"]["mean"].get("psnr_tissue")
    if fitted is None or fitted >= best:
        return sentence
    return f"{sentence} The model has {fitted:.2f} dB on its own training frames; a longer training may change this."


def trajectory_sentence(motion: MotionPart) -> str:
    """The mean trajectory error, compared with the mean motion."""
    return (
        f"Mean trajectory error {motion['scene_units']:.3f} {motion['unit']} ({motion['pixels']:.2f} px); mean tissue "
        f"motion {motion['motion_scene_units']:.3f} {motion['unit']} ({motion['motion_pixels']:.2f} px)."
    )


def pose_sentence(change: PosePart) -> str:
    """The mean pose correction."""
    return (
        f"Mean pose correction {change['degrees']:.2f} degrees and {change['scene_units']:.2f} {change['unit']}; it "
        f"moves the picture by {change['pixels']:.2f} px."
    )
