"""The verdicts of docs/claims.md, claim by claim.

Verdicts follow from numbers alone. For a difference with the published value p and Student's 95 % interval I of its
mean: I contains p and not 0: reproduced; both: not decided; 0 and not p: not reproduced; neither: only the direction,
or the opposite. A claim of no change (p = 0) is reproduced if I is within HUNDREDTH of 0.
`sweeps.ablation.COMPARISONS` defines the two configurations of each claim.
"""

from typing import Any

from endotsr.results.report.tables import markdown
from endotsr.studies.sweeps.ablation import COMPARISONS, Contrast
from endotsr.studies.sweeps.ablation_page import interval_text
from pages.claims.power import least_difference
from pages.claims.protocols import LEAST_PAIRS, protocol_rows
from pages.store.intervals import interval
from pages.store.published import PUBLISHED

NOT_YET = "Not measured yet."
HUNDREDTH = 0.01  # dB
SCOPE = ", mean over EndoNeRF"  # scope of the published gains of the steps
FULL, SPLIT = "A+S+L", "every_eighth"
LEVELS = (  # key, key of the published value, name, larger is better, unit of the last published digit
    ("psnr_full", "psnr_full", "PSNR full", "{:.2f} dB", True, 0.01),
    ("ssim_full", "ssim_full", "SSIM full", "{:.4f}", True, 0.001),
    ("lpips", "lpips", "LPIPS, if its input is in [0, 1]", "{:.4f}", False, 0.001),
    ("lpips_symmetric", "lpips", "LPIPS, if its input is in [-1, 1]", "{:.4f}", False, 0.001),
)
WHOLE = "all three"  # of `COMPARISONS`: the whole method against the base
RANGES = (  # what is compared, metric, published range, format
    ("PSNR full", "psnr_full", (0.31, 0.66), "{:+.2f} dB"),
    ("LPIPS, if its input is in [0, 1]", "lpips", (-0.0096, -0.0035), "{:+.4f}"),
    ("LPIPS, if its input is in [-1, 1]", "lpips_symmetric", (-0.0096, -0.0035), "{:+.4f}"),
)
STEPS = COMPARISONS[:3]  # of the paper's cumulative ablation
Record = Any  # content of a file of docs/results


def verdicts(found: Record | None, half: list[Record | None], runs: list[Record]) -> str:
    """Claim by claim: the compared configurations, the published value, verdict, number, interval."""
    rows = [_level_row(found, runs, *level) for level in LEVELS]
    rows += [_increment_row(found, comparison) for comparison in COMPARISONS if comparison.says]
    rows += [_range_row(found, *claim) for claim in RANGES]
    rows.append(_largest_row(found))
    rows.append(
        ["The other sequences of the paper", "-", "-", "not testable: their pictures are not at hand", "-", "-"]
    )
    rows += protocol_rows(half)
    rows.append(_motion_row(found))
    heads = (
        "the paper, in our words", "compared", "published", "verdict on pulling", "measured", "95 % interval",
        "seen with 80 %",
    )  # fmt: skip
    return markdown(heads, [row if len(row) == len(heads) else [*row, "-"] for row in rows])


def increment_verdict(
    published: float, low: float | None, high: float | None, pairs: int, last: float | None = None
) -> str:
    """The verdict on a difference; see the module docstring.

    last   other end of a published range, which the interval must then intersect
    """
    first, last = sorted((published, published if last is None else last))
    if low is None or high is None or pairs < LEAST_PAIRS:
        return f"not decided: {pairs} of {LEAST_PAIRS} seeds"
    if published == 0.0:
        if -HUNDREDTH <= low and high <= HUNDREDTH:
            return "reproduced"
        return "not decided: the interval is wider" if low < HUNDREDTH and high > -HUNDREDTH else "not reproduced"
    holds, nothing = low <= last and first <= high, low <= 0.0 <= high
    if holds:
        return "not decided: the interval contains 0 too" if nothing else "reproduced"
    if nothing:
        return "not reproduced"
    return "direction reproduced, size not" if (low > 0) == (published > 0) else "not reproduced: the opposite"


def level_verdict(published: float, low: float | None, high: float | None, larger_is_better: bool, unit: float) -> str:
    """The verdict on a mean: reproduced if its interval reaches a value that rounds to the published one, or a better.

    unit   of the last published digit
    """
    if low is None or high is None:
        return "not decided: one seed"
    reached = high >= published - unit / 2 if larger_is_better else low <= published + unit / 2
    return "reproduced" if reached else "not reproduced"


def student(values: list[float]) -> tuple[float, float | None, float | None]:
    """Mean and 95 % interval (Student) of values of several seeds; no interval for one."""
    mean, half = interval(values)
    return (mean, None, None) if len(values) < 2 else (mean, mean - half, mean + half)


def full_runs(found: Record | None, runs: list[Record], key: str) -> list[float]:
    """A metric of the runs of the whole method with the preset `paper`: of the ablation, else of recorded runs."""
    if found is not None:
        chosen = [r for r in found["rows"] if (r["configuration"], r["split"], r["preset"]) == (FULL, SPLIT, "paper")]
        if values := [row[key] for row in chosen if row.get(key) is not None]:
            return values
    settings = [(run["run"]["settings"], run["held_out"]["mean"].get(key)) for run in runs]
    return [v for s, v in settings if v is not None and s["preset"] == "paper" and s["sequence"]["split"] == SPLIT]


def _level_row(
    found: Record | None, runs: list[Record], key: str, of: str, label: str, form: str, larger: bool, unit: float
) -> list[str]:
    published = PUBLISHED["pulling"][of]
    claim = [label, FULL, f"{published:g}"]
    values = full_runs(found, runs, key)
    if not values:
        return [*claim, NOT_YET, "-", "-"]
    mean, low, high = student(values)
    shown = "-" if low is None or high is None else f"{form.format(low)} to {form.format(high)}"
    measured = f"{form.format(mean)}, {len(values)} seed{'s' if len(values) > 1 else ''}"
    return [*claim, level_verdict(published, low, high, larger, unit), measured, shown]


def _of(found: Record | None, claim: str, metric: str = "psnr_full") -> Record | None:
    wanted = (claim, SPLIT, metric)
    rows = found["increments"] if found is not None else []
    return next((r for r in rows if (r["claim"], r["split"], r["metric"]) == wanted), None)


def _increment_row(found: Record | None, comparison: Contrast) -> list[str]:
    published, entry = comparison.published or 0.0, _of(found, comparison.claim)
    claim = [
        comparison.says,
        f"{comparison.with_} - {comparison.without}",
        f"{published:+.2f} dB{SCOPE if comparison in STEPS else ''}",
    ]
    if entry is None:
        return [*claim, NOT_YET, "-", "-"]
    verdict = increment_verdict(published, entry["student_low"], entry["student_high"], entry["pairs"])
    least = least_difference(found, comparison.claim)
    shown = interval_text(entry, "student", 3) + _unit(entry)
    return [*claim, verdict, f"{entry['mean']:+.3f} dB", shown, "-" if least is None else f"{least:.2f} dB"]


def _range_row(found: Record | None, label: str, metric: str, ends: tuple[float, float], form: str) -> list[str]:
    """The whole method against the base with matched input, called SurgicalGS in the paper."""
    claim = [
        f"{label}, over SurgicalGS with matched input (our base)", f"{FULL} - base",
        f"{form.format(ends[0])} to {form.format(ends[1])}, by sequence",
    ]  # fmt: skip
    entry, least = _of(found, WHOLE, metric), least_difference(found, WHOLE, metric)
    if entry is None or least is None:
        return [*claim, NOT_YET, "-", "-"]
    low, high = entry["student_low"], entry["student_high"]
    verdict = increment_verdict(ends[0], low, high, entry["pairs"], ends[1])
    shown = "-" if low is None or high is None else f"{form.format(low)} to {form.format(high)}"
    return [*claim, verdict, form.format(entry["mean"]), shown, form.format(least).lstrip("+")]


def _unit(entry: Record) -> str:
    return "" if entry["student_low"] is None else " dB"


def _largest_row(found: Record | None) -> list[str]:
    claim = ["Temporal appearance is the largest of the three steps", "the three steps above", "-"]
    known = [entry for step in STEPS if (entry := _of(found, step.claim)) is not None]
    if len(known) < len(STEPS):
        return [*claim, NOT_YET, "-", "-"]
    means = ", ".join(f"{e['claim'][0]} {e['mean']:+.3f}" for e in known) + " dB"
    if min(e["pairs"] for e in known) < LEAST_PAIRS:
        return [*claim, f"not decided: {min(e['pairs'] for e in known)} of {LEAST_PAIRS} seeds", means, "-"]
    appearance = next(entry for entry in known if entry["claim"].startswith("A"))
    others = max(entry["student_high"] for entry in known if entry is not appearance)
    if appearance["student_low"] > others:
        return [*claim, "reproduced", means, "-"]
    largest = max(known, key=lambda e: e["mean"]) is appearance
    return [*claim, "not decided: the intervals overlap" if largest else "not reproduced", means, "-"]


def _motion_row(found: Record | None) -> list[str]:
    """Not stated in the paper: whether the motion improves times between frames."""
    claim = ["Ours: between the frames the motion is better than a cross-fade of the model's own renders",
             f"{FULL} - cross-fade, tissue", "-"]  # fmt: skip
    rows = [] if found is None else [r for r in found["rows"] if (r["configuration"], r["split"]) == (FULL, SPLIT)]
    values = [
        r["psnr_tissue"] - r["cross_fade_psnr_tissue"] for r in rows
        if r.get("psnr_tissue") is not None and r.get("cross_fade_psnr_tissue") is not None
    ]  # fmt: skip
    if not values:
        return [*claim, NOT_YET, "-", "-"]
    mean, low, high = student(values)
    if low is None or high is None:
        return [*claim, "not decided: one seed", f"{mean:+.2f} dB", "-"]
    verdict = "yes" if low > 0 else "no" if high < 0 else "not decided"
    return [*claim, verdict, f"{mean:+.2f} dB", f"{low:+.2f} to {high:+.2f} dB"]
