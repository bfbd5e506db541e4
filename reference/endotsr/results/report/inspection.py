"""The inspection of a clip as a self-contained page: verdicts, confidence, plan, and a picture of every test.

In: an `Inspection` and its `Plan`. Out: HTML, or lines for a terminal.
"""

from typing import Any

import numpy as np

from endotsr.clips.effects.inspect import Inspection
from endotsr.clips.effects.plan import Plan, shown_value
from endotsr.clips.effects.verdict import UNKNOWN, Curve, EffectVerdict, Map
from endotsr.results.report import curves, figures, parts, tables
from endotsr.results.report.style import Theme
from endotsr.untrusted.names import counted

SMALL = ("none", "good", "degree 0")


def inspection_html(title: str, inspection: Inspection, plan: Plan) -> str:
    """The page as text."""
    body = [_headline(title, inspection, plan), _verdicts(inspection), _plan(plan), _dictionary(inspection, plan)]
    body += [_pictures(inspection)]
    return parts.page(title, "\n".join(part for part in body if part))


def inspection_text(inspection: Inspection, plan: Plan) -> str:
    """Verdicts and plan as lines for a terminal."""
    noise = inspection.noise
    head = f"noise: {255 * noise.level:.2f} grey levels, from {noise.source}"
    rows = [
        (v.effect, v.kind, f"{v.statistic:.3g}", f"{v.threshold:.3g}", f"{v.confidence:.2f}", v.reason)
        for v in inspection.verdicts.values()
    ]
    found = tables.plain(("effect", "found", "statistic", "threshold", "confidence", "reason"), rows, left=(0, 1, 5))
    rates = [_rate(inspection, line.cycles, line.harmonics) for line in inspection.lines]
    lines = [head, found, *(f"rate: {rate}" for rate in rates)]
    lines.append("plan:" if plan.changes else "plan: nothing to switch off")
    lines += [
        f"  {c.key} = {shown_value(c.value)} (now {shown_value(c.before)}){_saving(c.time, c.memory)}: {c.reason}"
        for c in plan.changes
    ]
    lines += [f"  {key} is kept: {reason}" for key, reason in plan.kept]
    lines += [f"  {remark}" for remark in plan.remarks]
    lines.append(
        f"expected saving: {plan.time:.0%} of the time of an iteration and {plan.memory:.0%} of the memory of Gaussians"
        " and optimiser"
    )
    return "\n".join(lines)


def _saving(time: float, memory: float) -> str:
    return f", saves {time:.0%} time, {memory:.0%} memory" if time > 0 or memory > 0 else ""


def _rate(inspection: Inspection, cycles: float, harmonics: int) -> str:
    per_minute = inspection.per_minute(cycles)
    minute = f", {per_minute:.0f} per minute" if per_minute is not None else ""
    return f"{cycles:.3g} cycles per sequence{minute}, {counted(harmonics, 'harmonic')}"


def _headline(title: str, inspection: Inspection, plan: Plan) -> str:
    verdicts = inspection.verdicts.values()
    present = [v.effect for v in verdicts if v.present and v.kind not in (UNKNOWN, *SMALL)]
    unknown = [v.effect for v in verdicts if v.kind == UNKNOWN]
    static = "No effect was found." if unknown else "No effect was found: to these tests, the tissue is static."
    found = f"Found: {', '.join(present)}." if present else static
    found += f" Undecided: {', '.join(unknown)}." if unknown else ""
    cards = [
        (f"{255 * inspection.noise.level:.2f}", "grey levels", "noise, standard deviation"),
        (str(inspection.clip.count), "", f"training frames of {inspection.clip.frames}"),
        (f"{plan.time:.0%}", "", "expected saving, time of an iteration"),
        (f"{plan.memory:.0%}", "", "expected saving, memory of Gaussians and optimiser"),
    ]
    boxes = "".join(parts.card(parts.text(value), unit, label) for value, unit, label in cards)
    return (
        f'<header><p class="eyebrow">Endo-TSR · inspection</p><h1>{parts.text(title)}</h1>'
        f'<p class="lead">{parts.text(found)}</p><div class="cards">{boxes}</div></header>'
    )


def _verdicts(inspection: Inspection) -> str:
    rows = [
        [
            parts.text(v.effect), f'<b class="{"good" if v.kind in SMALL else "bad"}">{parts.text(v.kind)}</b>',
            parts.cell(float(v.statistic)), parts.cell(float(v.threshold)), parts.text(v.unit),
            _false_positives(v), f"{v.confidence:.2f}",
        ]
        for v in inspection.verdicts.values()
    ]  # fmt: skip
    columns = ("Effect", "Found", "Statistic", "Threshold", "Unit", "False-positive rate", "Confidence")
    reasons = parts.definitions(
        (parts.text(v.effect), f"{parts.text(v.reason)} <small>{parts.text(v.test)}</small>")
        for v in inspection.verdicts.values()
    )
    note = (
        "Every test uses training frames only. Confidence measures the distance of the statistic from its threshold: "
        "0.5 at the threshold or for unknown, towards 1 far from it, 1 for an exact answer. It is no probability."
    )
    return parts.section("Findings", tables.html_table(columns, rows), reasons, note=note)


def _false_positives(verdict: EffectVerdict) -> str:
    rate = verdict.false_positive_rate
    return "not known" if rate is None else "exact" if rate == 0 else f"{rate:.0%}"


def _plan(plan: Plan) -> str:
    rows = [
        [f"<code>{parts.text(c.key)}</code>", shown_value(c.before), f"<b>{shown_value(c.value)}</b>", f"{c.time:.0%}",
         f"{c.memory:.0%}", parts.text(f"Set explicitly, kept. {c.reason}" if c.given else c.reason)]
        for c in plan.changes
    ]  # fmt: skip
    table = tables.html_table(("Setting", "Now", "Plan", "Time saved", "Memory saved", "Reason"), rows) if rows else ""
    kept = parts.definitions((f"<code>{parts.text(key)}</code>", parts.text(reason)) for key, reason in plan.kept)
    stays = f"<h3>Kept settings</h3>{kept}" if kept else ""
    remarks = "".join(f'<p class="note">{parts.text(remark)}</p>' for remark in plan.remarks)
    note = "<code>endotsr train --effects auto</code> applies this plan; explicit settings take precedence."
    return parts.section("Plan", table or "<p>Nothing to switch off.</p>", stays, remarks, note=note)


def _dictionary(inspection: Inspection, plan: Plan) -> str:
    d, configured = plan.dictionary, plan.dictionary.configured
    facts = [
        ("Rates found", "; ".join(_rate(inspection, x.cycles, x.harmonics) for x in inspection.lines) or "none"),
        ("Configured dictionary", f"rank {configured.rank}, condition {configured.condition:.3g}"),
        ("Dictionary identifiable from the time stamps", f"{d.frequencies} frequencies up to {d.frequency_max:g}"
                                                         f" cycles, rank {d.rank}, condition {d.condition:.3g}"),
    ]  # fmt: skip
    return parts.section("Rates and time stamps", parts.definitions((name, parts.text(value)) for name, value in facts))


def _pictures(inspection: Inspection) -> str:
    shown = [_panel(v) for v in inspection.verdicts.values()]
    frame = inspection.clip.images[inspection.clip.reference]
    first = parts.figure("Reference frame", parts.image(figures.bytes_image(frame), "the reference frame"))
    return parts.section("Maps and curves of the tests", f'<div class="charts">{first}{"".join(shown)}</div>')


def _panel(verdict: EffectVerdict) -> str:
    found = ""
    if verdict.map is not None:
        found += parts.figure(f"{verdict.effect}: {verdict.map.name}", _map_image(verdict.map))
    if verdict.curve is not None:
        title = f"{verdict.effect}: {verdict.curve.name}"
        found += curves.chart_figure(curves.Chart(title, _drawer(verdict.curve), verdict.curve.x_name))
    return found


def _map_image(shown: Map) -> str:
    known = shown.values[np.isfinite(shown.values)]
    high = float(known.max()) if known.size and known.max() > 0 else 1.0
    picture = figures.colour_mapped(np.nan_to_num(shown.values), 0.0, high, figures.DEPTH_MAP)
    picture[~np.isfinite(shown.values)] = figures.EXCLUDED
    return parts.image(picture, shown.name) + parts.colour_bar(figures.DEPTH_MAP, "0", f"{high:.3g}")


def _drawer(curve: Curve) -> Any:
    def draw(axes: Any, theme: Theme) -> None:
        for position, (name, values) in enumerate(curve.lines.items()):
            colour = theme.colours[position % len(theme.colours)]
            label = name if len(curve.lines) > 1 else ""
            axes.plot(curve.x, values, color=colour, linewidth=1.4, marker=".", label=label)
        if curve.threshold is not None:
            axes.axhline(curve.threshold, color=theme.grey, linestyle="--", linewidth=1.0)

    return draw
