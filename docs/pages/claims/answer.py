"""The answer of docs/claims.md in one paragraph, for README.md and the head of docs/paper.md.

Every number comes from a record; a clip that is not measured is named as such.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pages.claims.estimates import Estimate, contrast, runs_of
from pages.claims.rules import seeds_of
from pages.claims.verdicts import CLIPS, FULL, STEPS, WHOLE
from pages.store.intervals import shown, student
from pages.store.marks import read_json
from pages.store.published import MATCHED_PSNR, PUBLISHED

TRUTH, INTERPOLATION = "effects_truth.json", "interpolation.json"
PREDICTIONS = ("two_neighbours", "flow_interpolation", "two_neighbours_tissue", "flow_interpolation_tissue")
METHOD, WITHOUT_A = "`paper`", "`paper` without A"
Record = Any  # content of a file of docs/results


def answer(folder: Path, found: Mapping[str, Record | None], half: list[Record | None], right_eye: str) -> str:
    """What of the paper is reproduced, by how much, what is not, and what beats both models.

    right_eye   mean and interval of the gain on the right camera at held-out times as text, or ""
    """
    known = [clip for clip in CLIPS if contrast(found[clip], WHOLE, "psnr_full") is not None]
    missing = [clip for clip in CLIPS if clip not in known]
    parts = [part for clip in known for part in (components(found[clip], clip), level(folder, found[clip], clip))]
    parts.append(splits(found, half))
    if right_eye:
        parts.append(f"On the right camera at held-out times (half size) the components change PSNR by {right_eye}.")
    parts.append(truth(read_json(folder / TRUTH, "python docs/make.py effects.truth")))
    for clip in missing:
        who = f"On {clip} the published {PUBLISHED[clip]['psnr_full']:.2f} dB is"
        parts += [beaten(folder, clip, PUBLISHED[clip]["psnr_full"] or 0.0, who)]
        parts += [f"The ablation on EndoNeRF {clip} is not finished."]
    return " ".join(part for part in parts if part)


def components(found: Record, clip: str) -> str:
    """The gain of all three components over the base, and of the step of A."""
    whole, step = contrast(found, WHOLE, "psnr_full"), contrast(found, STEPS["A"], "psnr_full")
    least, most = MATCHED_PSNR
    text = (
        f"On EndoNeRF {clip} the three components together raise the PSNR of their base by {whole.mean:.2f} dB "
        f"({_median(whole)}; published medians {least} to {most} dB)"
        if whole is not None
        else ""
    )
    if step is None:
        return f"{text}."
    fewer = whole is not None and len(step.values) < len(whole.values)
    seeds = f"{seeds_of(len(step.values))}; " if fewer else ""
    return f"{text}; the step of A is {step.mean:+.2f} dB of it ({seeds}published +0.29 dB)."


def _median(whole: Estimate) -> str:
    """The median, or that there is one seed alone."""
    count = len(whole.values)
    return seeds_of(count) if count == 1 else f"median of {seeds_of(count)} {whole.median:.2f} dB"


def level(folder: Path, found: Record, clip: str) -> str:
    """The level against the published one, and the two predictions without a model."""
    published = PUBLISHED[clip]["psnr_full"] or 0.0
    values = list(runs_of(found, FULL, "psnr_full").values())
    mean, limits = student(values)
    said = f"published level, {published:.2f} dB,"
    if limits is None:
        text, half = f"Whether the {said} is reached is not decided: one seed has {mean:.2f} dB.", 0.0
    else:
        inside = "is exceeded" if limits[0] > published else "lies in the interval"
        verdict, half = "is not reached" if limits[1] < published else inside, limits[1] - mean
        text = f"The {said} {verdict}: {shown(values, 2)} dB."
    return f"{text} {beaten(folder, clip, mean, 'The reproduction is', half)}".strip()


def baselines(folder: Path, clip: str) -> dict[str, float]:
    """PSNR of the whole image of blend and flow, plain and tissue only; empty if not recorded."""
    path = folder / INTERPOLATION
    clips = read_json(path, "python docs/make.py full_size.interpolation")["clips"] if path.exists() else {}
    rows = clips.get(f"endonerf_{clip}", {}).get("every eighth frame", {}).get("baselines", {})
    return {name: float(np.mean(rows[name]["psnr_full"])) for name in PREDICTIONS if name in rows}


def against(level: float, value: float, half: float) -> str:
    """Below, above, or level with: within half the width of the interval of the level."""
    return "level with" if abs(level - value) <= half else "below" if level < value else "above"


def beaten(folder: Path, clip: str, level: float, who: str, half: float = 0.0) -> str:
    """How a level, with half the width of its interval, stands to the predictions without a model."""
    of = baselines(folder, clip)
    if len(of) < len(PREDICTIONS):
        return ""
    blend, flow, blend_tissue, flow_tissue = (of[name] for name in PREDICTIONS)
    to_blend, to_flow, to_tissue, to_flow_tissue = (against(level, value, half) for value in of.values())
    return (
        f"{who} {to_blend} the mean of the two neighbouring frames ({blend:.2f} dB) and {to_flow} flow ({flow:.2f} "
        f"dB); if these may read tissue only, as the model does, it is {to_tissue} the mean ({blend_tissue:.2f} dB) "
        f"and {to_flow_tissue} flow ({flow_tissue:.2f} dB)."
    )


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
    return f"The reproduction is below the blend in {below} of the {len(groups)} choices of held-out frames measured."


def truth(found: Record) -> str:
    """What A does to the held-out PSNR where the light alone, or the motion alone, changes."""
    gains = {
        name: [a["psnr"] - b["psnr"] for a, b in zip(scene[METHOD], scene[WITHOUT_A], strict=True)]
        for name, scene in found["scenes"].items()
    }
    light, motion = (shown(gains[name], 2, "+") for name in ("light", "motion"))
    where = "On simulated clips with a known truth, A changes the held-out PSNR by"
    return f"{where} {light} dB where only the light changes and by {motion} dB where only the tissue moves."
