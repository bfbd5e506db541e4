"""The section of the report on the held-out frames: the model and the baselines.

Frames before the first or after the last training frame are extrapolated and have a table of their own. A folded table
compares the tissue PSNR with and without pixels that training hardly shows, another one is of 8-bit pictures.
"""

from collections.abc import Mapping
from typing import Any

from endotsr.results.evaluation.evaluate import OWN, held_out_means, left_out
from endotsr.results.evaluation.records import FramesMeasured, Means
from endotsr.results.report import parts
from endotsr.results.report.data import COLUMNS, DECIDING, SEEN, ReportData
from endotsr.results.report.tables import html_table
from endotsr.untrusted.names import counted

Column = tuple[str, str, int, int]  # of COLUMNS
MOST_NAMED = 12  # extrapolated frames that are listed by number
MetricsRow = tuple[str, Mapping[str, Any], str]  # label, means by metric, and the kind of row


def mean_of(data: ReportData, key: str, extrapolated: bool = False) -> Means:
    """Means of `held_out`, `training` or a key of `OWN`; of held-out frames, see `held_out_means`; {} without them."""
    measured = data.evaluation.get(key)
    return held_out_means(data.evaluation, measured)[extrapolated] if measured else {}


def baseline_rows(data: ReportData, extrapolated: bool = False) -> list[tuple[str, Means]]:
    """Label and means of every baseline, as in `mean_of`."""
    baselines: Mapping[str, FramesMeasured] = data.evaluation.get("baselines") or {}
    return [
        (str(row.get("label", name)), held_out_means(data.evaluation, row)[extrapolated])
        for name, row in baselines.items()
    ]


def extrapolated_frames(data: ReportData) -> list[int]:
    """Numbers of the held-out frames before the first or after the last training frame."""
    return (data.evaluation.get("frames") or {}).get("extrapolated") or []


def held_out(data: ReportData) -> str:
    """The tables of held-out metrics of model and baselines."""
    rows = _rows(data)
    columns = _columns(rows)
    if not columns:
        return ""
    note = "Means over the held-out frames. Baselines use training frames only. The best value per column is coloured."
    shown = [c for c in columns if c in DECIDING] or columns
    table = _held_out_table(rows, shown)
    title = "Held-out frames, compared with baselines without a model"
    return parts.section(
        title, table, _extrapolated(data, shown), _absent_reasons(data), _seldom_seen(data, rows),
        _eight_bit(rows, columns), note=note,
    )  # fmt: skip


def _rows(data: ReportData, extrapolated: bool = False) -> list[MetricsRow]:
    rows: list[MetricsRow] = []
    if mean := mean_of(data, "held_out", extrapolated):
        rows.append(("This model", mean, "model"))
    for key in OWN:
        if found := data.evaluation.get(key):
            rows.append((found["label"], mean_of(data, key, extrapolated), ""))
    return rows + [(label, mean, "") for label, mean in baseline_rows(data, extrapolated)]


def _columns(rows: list[MetricsRow]) -> list[Column]:
    return [c for c in COLUMNS if any(row.get(c[0]) is not None for _, row, _ in rows)]


def _extrapolated(data: ReportData, columns: list[Column]) -> str:
    """The sentence on extrapolated frames, and their table if there are other held-out frames."""
    frames = extrapolated_frames(data)
    if not frames:
        return ""
    listed = ", ".join(map(str, frames)) if len(frames) <= MOST_NAMED else f"{frames[0]} to {frames[-1]}"
    where = f"before the first or after the last training frame ({listed})"
    if not mean_of(data, "held_out", extrapolated=True):
        return f'<p class="note">Every held-out frame is extrapolated: {where}.</p>'
    sentence = f"The means above are over frames between training frames. {len(frames)} further held-out frames are"
    sentence = sentence.replace("frames are", "frame is") if len(frames) == 1 else sentence
    table = _held_out_table(_rows(data, extrapolated=True), columns, "Extrapolated frames")
    return f'<p class="note">{sentence} extrapolated: {where}.</p>{table}'


def _seldom_seen(data: ReportData, rows: list[MetricsRow]) -> str:
    """The folded table with and without pixels that at most one training frame shows."""
    covered = (data.evaluation.get("frames") or {}).get("coverage") or []
    if mean_of(data, "held_out", extrapolated=True):  # the rows are means over the other frames
        outside = extrapolated_frames(data)
        covered = [row for row in covered if row["frame"] not in outside]
    never, once, tissue = (sum(row[key] for row in covered) for key in ("never_seen", "seen_once", "tissue"))
    if not never + once:
        return ""
    sentence = (
        f"Of {tissue} tissue pixels of the held-out frames, {never} ({never / tissue:.2%}) are excluded in every "
        f"training frame, and {once} ({once / tissue:.2%}) are tissue in one. PSNR over all tissue pixels, over those "
        "that a training frame shows, and over those that two or more show."
    )
    measured = [row for row in rows if any(row[1].get(key) is not None for key, *_ in SEEN[1:])]
    summary = f"Without pixels that training hardly shows<small>{never + once} of {tissue} px</small>"
    return parts.details(summary, f'<p class="note">{sentence}</p>{_held_out_table(measured, list(SEEN))}')


def _held_out_table(rows: list[MetricsRow], columns: list[Column], head: str = "Held-out frames") -> str:
    best = {key: _best(rows, key, sign) for key, _, _, sign in columns}
    cells = [
        [
            parts.text(label),
            *(_metric(row.get(key), n, best[key]) for key, _, n, _ in columns),
        ]
        for label, row, _ in rows
    ]
    return html_table([head, *(c[1] for c in columns)], cells, [kind for _, _, kind in rows])


def _eight_bit(rows: list[MetricsRow], columns: list[Column]) -> str:
    """The folded table for pictures rounded to 8 bits, whose rounding is an error of 0.29 / 255 (RMS)."""
    rounded = [c for c in columns if c not in DECIDING]
    if not rounded or len(rounded) == len(columns):
        return ""
    measured = [row for row in rows if any(row[1].get(c[0]) is not None for c in rounded)]
    summary = "With renders rounded to 8 bits<small>as measured from PNG files</small>"
    return parts.details(summary, _held_out_table(measured, rounded))


def _best(rows: list[MetricsRow], key: str, sign: int) -> float | None:
    values = [row[key] for _, row, _ in rows if row.get(key) is not None]
    return max(values, key=lambda v: sign * v) if len(values) > 1 else None


def _metric(value: Any, digits: int, best: float | None) -> str:
    shown = parts.number(value, digits)
    return f'<span class="best">{shown}</span>' if value is not None and value == best else shown


def _absent_reasons(data: ReportData) -> str:
    reasons = []
    if reason := data.evaluation.get("lpips_reason"):
        reasons.append(f"LPIPS: {reason}")
    if frames := left_out(data.evaluation):
        reasons.append(f"excluded from the tissue means (no finite value): {', '.join(frames)}")
    if count := data.evaluation.get("not_finite"):
        verbs = ("was", "is") if count == 1 else ("were", "are")
        reasons.append(f"{counted(count, 'value')} {verbs[0]} not finite and {verbs[1]} shown as a dash")
    return f'<p class="note">{parts.text("; ".join(reasons))}.</p>' if reasons else ""
