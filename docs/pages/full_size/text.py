"""Generated parts of docs/full_size.md as Markdown, from the numbers of docs/results/full_size and of recorded runs."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.results.report.tables import markdown
from pages.full_size.against_flow import KINDS
from pages.full_size.interpolation import tissue_only
from pages.store.commands import loaded
from pages.store.intervals import blocks, paired
from pages.store.program import RESULTS
from pages.store.tables import where_with_cores

PREDICTIONS = ("model", "nearest_frame", "two_neighbours", "flow_interpolation")
LABELS = {"model": "model", "nearest_frame": "copy", "two_neighbours": "blend", "flow_interpolation": "flow",
          "two_neighbours_tissue": "blend, tissue only", "flow_interpolation_tissue": "flow, tissue only"}  # fmt: skip
SPLITS = {"eighth": "every eighth frame held out", "blocks8": "blocks of 8 frames held out"}
RECORDED = {"every_eighth": "every eighth frame", "blocks 4": "blocks of 4", "blocks 8": "blocks of 8",
            "blocks 16": "blocks of 16"}  # fmt: skip
AGAINST = ("model", "two_neighbours", "flow_interpolation")  # in the answer
PRESETS = ("paper", "quick", "sharp")


def split_name(sequence: dict[str, Any]) -> str:
    """Short name of the held-out frames, from the settings of a run: eighth, blocks8, ..."""
    if sequence["split"] == "every_eighth":
        return "eighth"
    return f"{sequence['split']}{sequence['block_length']}"


def psnr(squared_error: float) -> float:
    """In dB, of a mean squared error in display units."""
    return float(-10 * np.log10(squared_error))


def mean_psnr(run: dict[str, Any], name: str) -> float:
    """Mean over the held-out frames of the PSNR over the tissue, dB."""
    return float(by_frame(run, name).mean())


def ahead(run: dict[str, Any]) -> float:
    """Gain of the model over the blend, dB."""
    return mean_psnr(run, "model") - mean_psnr(run, "two_neighbours")


def encoded(picture: NDArray[np.uint8]) -> bytes:
    """The bytes of a webp file; a picture of noise has 25 % of the size of its png."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="webp", quality=82, method=6)
    return buffer.getvalue()


def fragments(runs: dict[str, Any]) -> dict[str, str]:
    """Every generated part of the page by name."""
    order = list(SPLITS)
    runs = dict(sorted(runs.items(), key=lambda item: (order.index(item[1]["split"]), item[1]["preset"])))
    return {
        "answer": answer(runs),
        "made": made(runs),
        "table": clip_table(runs),
        "noise": noise_table(runs),
        "motion": motion_table(runs),
        "regions": "\n\n".join(region_table(run) for run in runs.values()),
        "pictures": "\n\n".join(pictures(name, run) for name, run in runs.items()),
    }


def answer(runs: dict[str, Any]) -> str:
    """Model against blend and flow, on the simulated clip and on the recorded one."""
    lines = []
    for run in runs.values():
        values = {name: by_frame(run, name) for name in AGAINST}
        frames = [row["frame"] for row in run["frames"]]
        lines.append(_line(f"Simulated clip, {SPLITS[run['split']]}, `{run['preset']}`", values, frames))
    for (split, preset), records in recorded().items():
        values = {name: recorded_by_frame(records, name) for name in AGAINST}
        frames = [row["frame"] for row in records[0]["held_out"]["per_frame"]]
        lines.append(_line(f"Recorded clip, {RECORDED[split]} held out, `{preset}`", values, frames))
    note = "A difference has a 95 % interval over the frames, as if they were independent, or one mean for each block."
    return "\n".join(lines) + f"\n\n{note}"


def _line(what: str, values: dict[str, NDArray[np.float64]], frames: list[int]) -> str:
    model = values["model"]
    count = len(blocks(model, frames))
    held_out = f"{count} frames" if count == len(frames) else f"{count} blocks"
    less = [f"{paired(model - values[name], frames, 2)} dB" for name in AGAINST[1:]]
    return f"- {what} ({held_out}): {model.mean():.2f} dB; **minus the blend {less[0]}; minus flow {less[1]}**."


def by_frame(run: dict[str, Any], name: str) -> NDArray[np.float64]:
    """PSNR over the tissue of every held-out frame of a stored run, dB."""
    return np.array([psnr(row["squared_error"][name]) for row in run["frames"]])


def recorded_by_frame(records: list[dict[str, Any]], name: str) -> NDArray[np.float64]:
    """The same of recorded runs, mean over the runs."""
    parts = [record["held_out"] if name == "model" else record["baselines"][name] for record in records]
    return np.array([[row["psnr_tissue"] for row in part["per_frame"]] for part in parts]).mean(axis=0)


def recorded() -> dict[tuple[str, str], list[dict[str, Any]]]:
    """The recorded runs on endonerf_pulling (docs/pages/full_size/record.py) by held-out frames and preset."""
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for file in sorted(RESULTS.glob("pulling_*.json")):
        record = loaded(file)
        settings = record["run"]["settings"]
        sequence = settings["sequence"]
        split = sequence["split"] + (f" {sequence['block_length']}" if sequence["split"] == "blocks" else "")
        found.setdefault((split, settings["preset"]), []).append(record)
    return dict(sorted(found.items(), key=lambda item: (list(RECORDED).index(item[0][0]), item[0][1])))


def means(records: list[dict[str, Any]]) -> dict[str, float]:
    """PSNR over the tissue of recorded runs: their mean, and the predictions without a model."""
    baselines = records[0]["baselines"]
    values = {LABELS[name]: baselines[name]["mean"]["psnr_tissue"] for name in PREDICTIONS[1:]}
    return values | {"model": float(np.mean([record["held_out"]["mean"]["psnr_tissue"] for record in records]))}


def clip_table(runs: dict[str, Any]) -> str:
    """Both clips: PSNR over the tissue of every preset and of the predictions without a model."""
    rows = []
    for split, words in SPLITS.items():
        same = {run["preset"]: run for run in runs.values() if run["split"] == split}
        if same:
            of_models = [f"{mean_psnr(same[name], 'model'):.2f}" if name in same else "-" for name in PRESETS]
            without = [f"{mean_psnr(next(iter(same.values())), name):.2f}" for name in PREDICTIONS[1:]]
            rows.append(["simulated", words.removesuffix(" held out"), *of_models, *without, "-", "-"])
    groups = recorded()
    for split, words in RECORDED.items():
        same = {preset: means(records) for (of, preset), records in groups.items() if of == split}
        of_models = [f"{same[name]['model']:.2f}" if name in same else "-" for name in PRESETS]
        without = [f"{next(iter(same.values()))[LABELS[name]]:.2f}" for name in PREDICTIONS[1:]]
        part = words if split == "every_eighth" else f"{words} frames"
        obeying = [f"{row['psnr_tissue']:.2f}" for row in tissue_only("endonerf_pulling", part).values()]
        rows.append(["recorded", words, *of_models, *without, *obeying])
    return markdown(("Clip", "Held out", *PRESETS, *list(LABELS.values())[1:]), rows)


def noise_table(runs: dict[str, Any]) -> str:
    """Squared error of model, blend and flow without the noise of the held-out frame and of the blend."""
    rows = []
    for run in runs.values():
        noise = run["noise"] ** 2
        weight = float(np.mean([row["blend_noise"] for row in run["frames"]]))
        errors = {key: np.mean([row["squared_error"][key] for row in run["frames"]]) for key in PREDICTIONS}
        left = [
            errors["model"] - noise,
            errors["two_neighbours"] - noise,
            errors["two_neighbours"] - noise * (1 + weight),
        ]
        cells = [f"{value / noise:.2f}" for value in (*left, errors["flow_interpolation"] - noise)]
        rows.append([f"`{run['preset']}`, {SPLITS[run['split']]}", f"{psnr(noise):.2f} dB", *cells])
    head = ("Run", "PSNR of a prediction without any error", "model", "blend", "blend without its own noise", "flow")
    return markdown(head, rows)


def motion_table(runs: dict[str, Any]) -> str:
    """Every held-out frame with the motion between its neighbours, and the differences of the predictions."""
    parts = []
    for split, words in SPLITS.items():
        same = [run for run in runs.values() if run["split"] == split]
        if not same:
            continue
        rows = []
        for i, row in enumerate(same[0]["frames"]):
            of_models = [psnr(run["frames"][i]["squared_error"]["model"]) for run in same]
            without = [psnr(row["squared_error"][key]) for key in PREDICTIONS[1:]]
            moved = "one neighbour" if row["motion_px"] is None else f"{row['motion_px']:.2f}"
            rows.append([str(row["frame"]), moved, *(f"{value:.2f}" for value in (*of_models, *without))])
        head = ("Frame", "motion between its neighbours, px", *(run["preset"] for run in same))
        parts.append(
            f"{words[0].upper()}{words[1:]}, PSNR of the tissue in dB:\n\n"
            + markdown((*head, "copy", "blend", "flow"), rows)
        )
    return "\n\n".join(parts)


def region_table(run: dict[str, Any]) -> str:
    """The squared error divided among kinds of pixels: of the model, of the blend, of flow."""
    keys = ("pixels", "model", "two_neighbours", "flow_interpolation")
    sums = {key: sum(row[key] for row in run["regions"].values()) for key in keys}
    rows = []
    for name, row in run["regions"].items():
        if row["pixels"]:
            shares = [f"{100 * row[key] / sums[key]:.1f} %" for key in keys]
            rows.append([KINDS[name], *shares, f"{psnr(row['model'] / row['pixels']):.2f}"])
    head = ("Tissue pixels", "of the pixels", "of the model's error", "of the blend's", "of flow's", "model there, dB")
    return f"`{run['preset']}`, {SPLITS[run['split']]}:\n\n" + markdown(head, rows)


def pictures(name: str, run: dict[str, Any]) -> str:
    """The crops of three held-out frames and the error maps of one run."""
    parts = [f"### `{run['preset']}`, {SPLITS[run['split']]}"]
    for key, index in run["shown"].items():
        alt = f"Frame {index}, the {key} for the model: truth, model, copy, blend and flow, and their errors"
        parts.append(f"The **{key}** frame, {index}:\n\n![{alt}](results/full_size/{name}_{key}.webp)")
    alt = "Root mean squared error of every pixel over the held-out frames, for model, copy, blend and flow"
    parts.append(f"Every pixel over all held-out frames:\n\n![{alt}](results/full_size/{name}_errors.webp)")
    return "\n\n".join(parts)


def made(runs: dict[str, Any]) -> str:
    """Trainings, date and machine."""
    first = next(iter(runs.values()))
    each = [
        f"`{run['preset']}`, {SPLITS[run['split']]}: {run['iterations_done']} iterations, {run['gaussians']} Gaussians"
        for run in runs.values()
    ]
    return (
        "Simulated clip: `endotsr simulate pulling`, "
        f"{first['frame_count']} frames of {first['width']}x{first['height']}, "
        f"noise and rounding of {255 * first['noise']:.2f} grey levels. One seed each, "
        f"{where_with_cores(first)}. {'; '.join(each)}. Recorded clip: `endonerf_pulling`, 63 frames of "
        "640x512, the runs of {doc}`results/README`; its pictures are not published."
    )
