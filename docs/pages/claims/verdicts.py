"""The verdicts of docs/claims.md on what the paper states, clip by clip and for the mean of both clips.

`rules` decides; `endotsr.studies.sweeps.ablation.COMPARISONS` defines the two configurations of each claim.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

from collections.abc import Mapping
from typing import Any, NamedTuple

from endotsr.results.report.tables import markdown
from endotsr.studies.sweeps.ablation import BOTH, COMPARISONS, Contrast
from pages.claims.estimates import Estimate, averaged, contrast, runs_of
from pages.claims.rules import (
    increment_verdict,
    largest_verdict,
    level_verdict,
    no_change_verdict,
    seeds_of,
    unless_few,
)
from pages.store.intervals import Interval, student
from pages.store.published import MATCHED_LPIPS, MATCHED_PSNR, PRIOR, PUBLISHED, as_printed

NOT_YET = "Not measured yet."
FULL = "A+S+L"
CLIPS = ("pulling", "cutting")
HEADS = (
    "the paper, in our words", "compared", "published", "mean (median)", "better in", "paired interval", "verdict",
    "common spread", "verdict with it",
)  # fmt: skip


class Metric(NamedTuple):
    """How a metric is shown."""

    key: str
    label: str
    form: str  # of a level
    signed: str  # of a difference
    larger: bool  # is better


METRICS = {
    metric.key: metric
    for metric in (
        Metric("psnr_full", "PSNR", "{:.2f} dB", "{:+.3f} dB", True),
        Metric("ssim_full", "SSIM", "{:.4f}", "{:+.4f}", True),
        Metric("ssim_tissue", "SSIM of tissue", "{:.4f}", "{:+.4f}", True),
        Metric("lpips", "LPIPS, input in [0, 1]", "{:.4f}", "{:+.4f}", False),
        Metric("lpips_symmetric", "LPIPS, input in [-1, 1]", "{:.4f}", "{:+.4f}", False),
    )
}
ROUNDED = {
    "psnr_full": 0.005,
    "ssim_tissue": 0.00005,
    "lpips": 0.00005,
    "lpips_symmetric": 0.00005,
}  # half a last digit
LEVELS = (("psnr_full", "psnr_full", 0.01), ("ssim_full", "ssim_full", 0.001), ("lpips", "lpips", 0.001),
          ("lpips_symmetric", "lpips", 0.001))  # fmt: skip  # key, key of the published value, unit of its last digit
COMPARED = ("psnr_full", "ssim_tissue", "lpips", "lpips_symmetric")  # of the steps
MATCHED = {"psnr_full": MATCHED_PSNR, "lpips": MATCHED_LPIPS, "lpips_symmetric": MATCHED_LPIPS}
STEPS = {"S": {"S": 1, "base": -1}, "A": {"A+S": 1, "S": -1}, "L": {"A+S+L": 1, "A+S": -1}}
WHOLE = {FULL: 1, "base": -1}
Record = Any  # content of a file of docs/results


def verdicts(found: Record | None, clip: str) -> str:
    """What the paper states about a clip, each claim with its number, intervals and verdict."""
    if found is None:
        return NOT_YET
    rows = [_level_row(found, clip, *level) for level in LEVELS]
    rows.append(_base_row(found, clip))
    rows += [_increment_row([found], c, metric, clip) for c in COMPARISONS if c.says for metric in _metrics(c)]
    rows += [_matched_row(found, metric) for metric in MATCHED]
    rows += [_median_row(found, metric) for metric in MATCHED]
    rows.append(_every_seed_row(found))
    rows += [_largest_row([found], metric) for metric in COMPARED]
    return markdown(HEADS, rows)


def verdicts_of_both(found: Mapping[str, Record | None]) -> str:
    """The steps and the largest of them in the mean of both clips, as the paper gives them."""
    records = [found[clip] for clip in CLIPS]
    if any(record is None for record in records):
        missing = ", ".join(clip for clip in CLIPS if found[clip] is None)
        return f"Not measured yet: {missing} is missing. The steps of the paper are means over both clips."
    steps = [c for c in COMPARISONS if BOTH in c.published]
    rows = [_increment_row(records, c, metric, BOTH) for c in steps for metric in _metrics(c)]
    return markdown(HEADS, rows + [_largest_row(records, metric) for metric in COMPARED])


def _metrics(of: Contrast) -> list[str]:
    stated = {metric for values in of.published.values() for metric in values}
    return [metric for metric in COMPARED if metric in stated] or ["psnr_full"]


def _terms(of: Contrast) -> dict[str, int]:
    return {of.with_: 1, of.without: -1}


def _estimated(records: list[Record], terms: Mapping[str, int], metric: str) -> Estimate | None:
    found = [contrast(record, terms, metric) for record in records]
    known = [estimate for estimate in found if estimate is not None]
    if len(known) < len(records):
        return None
    return known[0] if len(known) == 1 else averaged(known)


def between(limits: Interval, form: str) -> str:
    """An interval as text."""
    return "-" if limits is None else f"{form.format(limits[0])} to {form.format(limits[1])}".replace(" dB to", " to")


def _wins(values: tuple[float, ...], larger: bool) -> int:
    return sum((value > 0) == larger and value != 0 for value in values)


def _cells(estimate: Estimate, metric: Metric) -> tuple[str, str, str, str]:
    """Mean and median, improved seeds, and both intervals as text."""
    count = len(estimate.values)
    shown = f"{metric.signed.format(estimate.mean)} ({metric.signed.format(estimate.median).removesuffix(' dB')})"
    improved = f"{_wins(estimate.values, metric.larger)} of {count}"
    return shown, improved, between(estimate.paired, metric.signed), between(estimate.common, metric.signed)


def _row(claim: list[str], estimate: Estimate | None, metric: Metric, verdict: Any) -> list[str]:
    """A row with both intervals; `verdict` maps an interval and the number of seeds to words."""
    if estimate is None:
        return [*claim, NOT_YET, "-", "-", "-", "-", "-"]
    shown, improved, paired, common = _cells(estimate, metric)
    count = estimate.seeds
    of_common = "-" if estimate.common is None else verdict(estimate.common, count)
    return [*claim, shown, improved, paired, verdict(estimate.paired, count), common, of_common]


def _level_row(found: Record, clip: str, key: str, of: str, unit: float) -> list[str]:
    metric, published = METRICS[key], PUBLISHED[clip][of]
    claim = [f"Level: {metric.label}", FULL, f"{as_printed(of, published)}{' dB' if 'dB' in metric.form else ''}"]
    values = list(runs_of(found, FULL, key).values())
    if not values:
        return [*claim, NOT_YET, "-", "-", "-", "-", "-"]
    mean, limits = student(values)
    verdict = level_verdict(published, limits, metric.larger, unit)
    return [*claim, metric.form.format(mean), seeds_of(len(values)), between(limits, metric.form), verdict, "-", "-"]


def implied_base(clip: str) -> tuple[float, float]:
    """The PSNR in dB of the base that the paper's level minus its gain with matched input gives: least and most."""
    level, (least, most) = PUBLISHED[clip]["psnr_full"], MATCHED_PSNR
    assert level is not None
    return level - most, level - least


def _base_row(found: Record, clip: str) -> list[str]:
    """The level of the base that follows from the paper: its level minus its gain with matched input."""
    low, high = implied_base(clip)
    claim = ["Level: PSNR of the base, from the level and the gain with matched input", "base",
             f"{low:.2f} to {high:.2f} dB"]  # fmt: skip
    values = list(runs_of(found, "base", "psnr_full").values())
    if not values:
        return [*claim, NOT_YET, "-", "-", "-", "-", "-"]
    mean, limits = student(values)
    inside = low - 0.005 <= mean <= high + 0.005
    verdict = unless_few("the mean lies inside" if inside else "the mean lies outside", len(values))
    return [*claim, f"{mean:.2f} dB", seeds_of(len(values)), between(limits, "{:.2f} dB"), verdict, "-", "-"]


def _increment_row(records: list[Record], of: Contrast, key: str, clip: str) -> list[str]:
    metric = METRICS[key]
    estimate = _estimated(records, _terms(of), key)
    compared = f"{of.with_} - {of.without}"
    if not of.published:
        stated = " and ".join(f"{value:+.3f}" for value in PRIOR) + " dB, one seed"
        return _row([f"{of.says}", compared, stated], estimate, metric, no_change_verdict)
    stated_for = clip if clip in of.published else BOTH
    value = of.published[stated_for][key]
    scope = ", mean of both clips" if stated_for == BOTH else ""
    unit = "{:+.2f} dB" if key == "psnr_full" else "{:+.4f}"
    claim = [f"{of.says}: {metric.label}", compared, f"{unit.format(value)}{scope}"]
    first, last = value - ROUNDED[key], value + ROUNDED[key]
    return _row(claim, estimate, metric, lambda limits, count: increment_verdict(first, limits, count, last))


def _matched_claim(metric: Metric, words: str) -> list[str]:
    form = "{:+.2f} dB" if metric.key == "psnr_full" else "{:+.4f}"
    first, last = MATCHED[metric.key]
    published = f"{form.format(first)} to {form.format(last)}, by sequence".replace(" dB to", " to")
    return [f"{metric.label}, over SurgicalGS with matched input (our base){words}", f"{FULL} - base", published]


def _matched_row(found: Record, key: str) -> list[str]:
    metric, (first, last) = METRICS[key], MATCHED[key]
    first, last = first - ROUNDED[key], last + ROUNDED[key]
    return _row(
        _matched_claim(metric, ""), contrast(found, WHOLE, key), metric,
        lambda limits, count: increment_verdict(first, limits, count, last),
    )  # fmt: skip


def _median_row(found: Record, key: str) -> list[str]:
    """By the statistic of the paper: the median over the seeds. No interval belongs to it."""
    metric, (first, last) = METRICS[key], MATCHED[key]
    claim = _matched_claim(metric, ", by the paper's statistic, the median")
    estimate = contrast(found, WHOLE, key)
    if estimate is None:
        return [*claim, NOT_YET, "-", "-", "-", "-", "-"]
    inside = first - ROUNDED[key] <= estimate.median <= last + ROUNDED[key]
    better = estimate.median > last if metric.larger else estimate.median < first
    verdict = "inside the range" if inside else "better than the range" if better else "short of the range"
    verdict = unless_few(verdict, len(estimate.values))
    return [*claim, metric.signed.format(estimate.median), _cells(estimate, metric)[1], "-", verdict, "-", "-"]


def _every_seed_row(found: Record) -> list[str]:
    """The paper: PSNR and LPIPS improve over SurgicalGS with matched input in every seed."""
    claim = ["PSNR and LPIPS improve in every seed with matched input", f"{FULL} - base", "in every seed"]
    known = {key: contrast(found, WHOLE, key) for key in MATCHED}
    counts = {key: (_wins(e.values, METRICS[key].larger), len(e.values)) for key, e in known.items() if e is not None}
    if not counts:
        return [*claim, NOT_YET, "-", "-", "-", "-", "-"]
    shown = ", ".join(f"{METRICS[key].label} {wins} of {seeds}" for key, (wins, seeds) in counts.items())
    seeds = max(seeds for _, seeds in counts.values())
    holds = all(wins == of for wins, of in counts.values())  # one seed that does not improve decides
    verdict = unless_few(f"holds in {seeds} seeds", seeds) if holds else f"does not hold in {seeds_of(seeds)}"
    return [*claim, "-", shown, "-", verdict, "-", "-"]


def _largest_row(records: list[Record], key: str) -> list[str]:
    """Paired tests of the lead of A over each other step."""
    metric = METRICS[key]
    claim = [f"Temporal appearance is the largest of the three steps: {metric.label}", "A - S; A - L", "-"]
    leads = [_estimated(records, lead("A", other), key) for other in ("S", "L")]
    known = [estimate for estimate in leads if estimate is not None]
    if len(known) < len(leads):
        return [*claim, NOT_YET, "-", "-", "-", "-", "-"]
    count = min(estimate.seeds for estimate in known)
    cells = ["; ".join(of) for of in zip(*(_cells(estimate, metric) for estimate in known), strict=True)]
    decide = lambda limits: largest_verdict(limits, count, metric.larger)
    of_paired, of_common = decide([e.paired for e in known]), decide([e.common for e in known])
    return [*claim, cells[0], cells[1], cells[2], of_paired, cells[3], of_common]


def lead(step: str, other: str) -> dict[str, int]:
    """The coefficients of one step minus those of another."""
    terms = dict(STEPS[step])
    for name, c in STEPS[other].items():
        terms[name] = terms.get(name, 0) - c
    return {name: c for name, c in terms.items() if c}
