"""The answer of docs/claims.md in one list and one table, for README.md and the head of docs/paper.md.

Every number comes from a record; a clip that is not measured is named as such.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.simulator import SimulatorSettings
from endotsr.config import PAPER
from endotsr.studies.sweeps.ablation import BOTH, COMPARISONS
from pages.claims.estimates import Estimate, averaged, contrast, runs_of
from pages.claims.rules import LEAST_PAIRS, increment_verdict, seeds_of
from pages.claims.verdicts import CLIPS, FULL, ROUNDED, STEPS, WHOLE
from pages.full_size.sweeps import FOLDER, rows_of
from pages.store.commands import loaded
from pages.store.intervals import shown, student
from pages.store.published import MATCHED_PSNR, PUBLISHED
from pages.store.tables import noted

PREDICTIONS = ("two_neighbours", "flow_interpolation", "two_neighbours_tissue", "flow_interpolation_tissue")
NAMES = ("the blend", "flow", "the tissue-only blend", "the tissue-only flow")  # of the predictions, in their order
FIXED_GAIN = next(one for one in COMPARISONS if one.claim == "A and L added to S, fixed count")
STEP_OF_A = next(one for one in COMPARISONS if (one.with_, one.without) == tuple(STEPS["A"]))
PAIRS = "`pulling_pairs`"
METHOD, WITHOUT_A = "`paper`", "`paper` without A"
Record = Any  # content of a file of docs/results


def answer(folder: Path, found: Mapping[str, Record | None], half: list[Record | None], right_eye: str) -> str:
    """What of the paper is reproduced, by how much, what is not, and what beats both models; the levels as a table.

    right_eye   mean and interval of the gain on the right camera at held-out times as text, or ""
    """
    known = {clip: found[clip] for clip in CLIPS if contrast(found[clip], WHOLE, "psnr_full") is not None}
    weights = with_other_weights(rows_of(FOLDER / "similarity_weight.toml"))
    parts = [reached(known) + weights] if known else []
    parts += [beaten(folder, clip, record) for clip, record in known.items()]
    parts.append(splits(found, half))
    if right_eye:
        parts.append(f"On the right camera at held-out times the components change PSNR by {right_eye}.")
    parts.append(truth(loaded(folder / "effects_truth.json")))
    parts += [f"The ablation on {clip} is not finished." for clip in CLIPS if clip not in known]
    listed = "\n".join(f"- {part}" for part in parts if part)
    return "\n\n".join([*([gains(known)] if known else []), listed, levels(folder, found)])


def gains(known: Mapping[str, Record]) -> str:
    """Published and measured changes of PSNR by the components, with their intervals and verdicts, as a table."""
    least, most = MATCHED_PSNR
    step, fixed = STEP_OF_A.published[BOTH]["psnr_full"], FIXED_GAIN.published
    of_fixed = {FIXED_GAIN.with_: 1, FIXED_GAIN.without: -1}
    rows = []
    for clip, gain in _by_clip(known, WHOLE).items():
        rows.append(["A, S and L, over the base", f"{least:+.2f} to {most:+.2f}", clip, *_cells(gain, least, most)])
    steps = _by_clip(known, STEPS["A"])
    both = {"mean of both": averaged([*steps.values()])} if len(steps) == len(CLIPS) else {}
    for clip, gain in (steps | both).items():
        rows.append(["A, over S", f"{step:+.2f}", clip, *_cells(gain, step, step)])
    for clip, gain in _by_clip(known, of_fixed).items():
        published = fixed[clip]["psnr_full"]
        rows.append(["A and L, over S, fixed number", f"{published:+.2f}", clip, *_cells(gain, published, published)])
    head = ["Change by", "published", "EndoNeRF", "here", "interval", "verdict", "pooled interval", "verdict with it"]
    about = (
        "Changes of PSNR in dB with 95 % intervals over the seeds, by A (colour residual), S (motion residual) and L"
        " (Laplacian detail loss). *Pooled*: with the spread over all configurations. *Fixed number*: of Gaussians. The"
        " published changes over the base are medians, by sequence; that of A over S is the mean of both clips."
        " *Reproduced*: the interval meets the published value or range and does not contain 0."
    )
    return noted(head, rows, about)


def _by_clip(known: Mapping[str, Record], terms: Mapping[str, int]) -> dict[str, Estimate]:
    """The change of PSNR on every clip on which it was measured."""
    found = {clip: contrast(record, terms, "psnr_full") for clip, record in known.items()}
    return {clip: gain for clip, gain in found.items() if gain is not None}


def _cells(gain: Estimate, least: float, most: float) -> list[str]:
    """Mean, interval and verdict on the published range, of rounded values in dB, and both with the pooled spread."""
    least, most = least - ROUNDED["psnr_full"], most + ROUNDED["psnr_full"]
    cells = [f"{gain.mean:+.2f}"]
    for limits in (gain.paired, gain.common):
        cells.append("-" if limits is None else f"{limits[0]:+.2f} to {limits[1]:+.2f}")
        cells.append(increment_verdict(least, limits, gain.seeds, most))
    return cells


def interval(record: Record) -> tuple[float, tuple[float, float] | None]:
    """Mean and interval over the seeds of the PSNR of the whole method, whole image; no interval for one seed."""
    return student(list(runs_of(record, FULL, "psnr_full").values()))


def reached(known: Mapping[str, Record]) -> str:
    """The level against the published one."""
    texts = []
    for clip, record in known.items():
        _, limits = interval(record)
        published = PUBLISHED[clip]["psnr_full"] or 0.0
        if limits is None:
            texts.append(f"is not decided on {clip}")
        else:
            texts.append(f"{_stands(limits, published)} on {clip}")
    return f"The published level {' and '.join(texts)}."


def _stands(limits: tuple[float, float], published: float) -> str:
    """The published level, which stands for all values that round to it, against the interval of the reproduced one."""
    half = ROUNDED["psnr_full"]
    inside = "is exceeded" if limits[0] > published + half else "lies in the interval"
    return "is not reached" if limits[1] < published - half else inside


def with_other_weights(rows: list[Record]) -> str:
    """The level against the published one with other weights of D-SSIM, which the paper does not print.

    rows   of the sweep `similarity_weight`; a clip and weight with fewer seeds than a verdict needs is left out
    """
    found: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        found.setdefault((row["configuration"].removeprefix("w "), row["sequence"]), []).append(row["psnr_full"])
    stands: dict[str, list[str]] = {}  # weights with their levels, by clip and verdict
    for (weight, sequence), values in sorted(found.items()):
        mean, limits = student(values)
        if limits is None or len(values) < LEAST_PAIRS or float(weight) == PAPER.loss.ssim_weight:
            continue
        clip = sequence.removeprefix("endonerf_")
        published = PUBLISHED[clip]["psnr_full"] or 0.0
        level = f"{weight} ({mean:.2f} dB, {limits[0]:.2f} to {limits[1]:.2f} dB)"
        stands.setdefault(f"{_stands(limits, published)} on {clip}", []).append(level)
    if not stands:
        return ""
    texts = [f"With {' and '.join(of)} it {told}." for told, of in stands.items()]
    used = f" This is with the weight {PAPER.loss.ssim_weight:g} of D-SSIM; the paper does not print its own."
    return " ".join([used, *texts])


def levels(folder: Path, found: Mapping[str, Record | None]) -> str:
    """Published and reproduced PSNR of the whole image beside the predictions without a model."""
    rows = []
    for clip in CLIPS:
        here, base = ["-" if found[clip] is None else shown([*runs_of(found[clip], name, "psnr_full").values()], 2)
                      for name in (FULL, "base")]  # fmt: skip
        of = baselines(folder, clip)
        predicted = [f"{of[name]:.2f}" if name in of else "-" for name in PREDICTIONS]
        rows.append([clip, f"{PUBLISHED[clip]['psnr_full']:.2f}", here, base, *predicted])
    head = ["EndoNeRF", "published", "here", "its base", "blend", "flow", "blend, tissue only", "flow, tissue only"]
    about = (
        "PSNR of the whole image in dB, every eighth frame held out. ± is a 95 % interval over the seeds. Blend is the"
        " mean of the two neighbouring frames. *Tissue only* reads no excluded pixel; the losses of the method read no"
        " excluded colour. *Level with* means within the interval over the seeds, which does not cover other frames."
    )
    return noted(head, rows, about + black(folder))


def black(folder: Path) -> str:
    """What the excluded pixels, black in both pictures, add to the PSNR of the whole image."""
    path = folder / "interpolation.json"
    clips = loaded(path)["clips"] if path.exists() else {}
    texts = []
    for clip in CLIPS:
        rows = clips.get(f"endonerf_{clip}", {}).get("every eighth frame", {}).get("baselines", {}).get(PREDICTIONS[0])
        if rows:
            added = np.array(rows["psnr_full"]) - rows["psnr_tissue"]  # of a frame: of its masks alone
            fraction = np.mean(1 - 10 ** (-added / 10))
            texts.append(f"{100 * fraction:.1f} % of the pixels of {clip}, which adds {added.mean():.2f} dB")
    if not texts:
        return ""
    return f" Excluded pixels are black in both pictures and count as right: {', and '.join(texts)}."


def baselines(folder: Path, clip: str) -> dict[str, float]:
    """PSNR of the whole image of blend and flow, plain and tissue only; empty if not recorded."""
    path = folder / "interpolation.json"
    clips = loaded(path)["clips"] if path.exists() else {}
    rows = clips.get(f"endonerf_{clip}", {}).get("every eighth frame", {}).get("baselines", {})
    return {name: float(np.mean(rows[name]["psnr_full"])) for name in PREDICTIONS if name in rows}


def against(level: float, value: float, half: float) -> str:
    """Below, above, or level with: within half the width of the interval of the level."""
    return "level with" if abs(level - value) <= half else "below" if level < value else "above"


def beaten(folder: Path, clip: str, record: Record) -> str:
    """How the level stands to the predictions without a model."""
    of = baselines(folder, clip)
    if len(of) < len(PREDICTIONS):
        return ""
    mean, limits = interval(record)
    half = limits[1] - mean if limits else 0.0
    stands: dict[str, list[str]] = {}
    for name, value in zip(NAMES, of.values(), strict=True):
        stands.setdefault(against(mean, value, half), []).append(name)
    if len(stands) == 1:
        return f"On {clip} the mean of the full method is {next(iter(stands))} all four predictions without a model."
    texts = [f"{how} {', '.join(names[:-1])} and {names[-1]}" if names[1:] else f"{how} {names[0]}"
             for how, names in stands.items()]  # fmt: skip
    return f"On {clip} the mean of the full method is {', and '.join(texts)}."


def splits(found: Mapping[str, Record | None], half: list[Record | None]) -> str:
    """In how many of the measured splits the whole method is below the blend, on tissue."""
    groups: dict[tuple[str, str, int], list[Record]] = {}
    for record in (*found.values(), *half):
        for row in [] if record is None else record["rows"]:
            if row["configuration"] == FULL and row.get("baselines"):
                groups.setdefault((row["sequence"], row["split"], row["width"]), []).append(row)
    below = 0
    for rows in groups.values():
        blend = rows[0]["baselines"]["two_neighbours"]["mean"]["psnr_tissue"]
        below += sum(row["psnr_tissue"] for row in rows) / len(rows) < blend
    if not groups:
        return ""
    clips = {sequence for sequence, _, _ in groups}
    measured = f"{len(groups)} combinations of clip, size and held-out frames measured"
    firsts = [rows[0] for rows in groups.values()]
    short = Counter(
        (row["width"], row["height"], row["iterations"])
        for row in firsts
        if row["iterations"] < PAPER.training.iterations
    )
    shorter = "".join(
        f", {count} of them at {width}x{height} with {iterations} iterations"
        for (width, height, iterations), count in sorted(short.items())
    )
    twice = f" One clip of them is {PAIRS}, which is pulling without its last frame." if PAIRS[1:-1] in clips else ""
    return f"The mean of the full method is below the blend in {below} of the {measured}{shorter}.{twice}"


def truth(found: Record) -> str:
    """What A does to the held-out PSNR where the light alone, or the motion alone, changes."""
    gains = {
        name: [a["psnr"] - b["psnr"] for a, b in zip(scene[METHOD], scene[WITHOUT_A], strict=True)]
        for name, scene in found["scenes"].items()
    }
    light, motion = (shown(gains[name], 2, "+") for name in ("light", "motion"))
    of = SimulatorSettings()
    size = f"{found['frames']} frames of {of.width}x{of.height}"
    runs = f"{METHOD} with {found['iterations']} iterations on {size}, {seeds_of(found['seeds'])} of clip and training"
    where = f"On small simulated clips with a known truth ({runs}), A changes the held-out PSNR by"
    return f"{where} {light} dB where only the light changes and by {motion} dB where only the tissue moves."
