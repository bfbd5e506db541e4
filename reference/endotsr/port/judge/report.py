"""The report of the judge as text, JSON and one self-contained HTML page with difference images."""

import base64
import html
import struct
import sys
import zlib
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.diagnose import made_of
from endotsr.port.judge.format import LEVELS
from endotsr.port.judge.npy import Refused, read_plain
from endotsr.port.judge.profiles import lines_of
from endotsr.port.judge.recognise import Suspect
from endotsr.port.judge.records import CaseReport, OutputReport, Report
from endotsr.port.judge.store import Golden
from endotsr.untrusted.writing import replace_file, replace_text

MOST_LINES = 60  # refused outputs in the table
MOST_MISSING = 12  # names of missing outputs of a case
MOST_NAMED = 3  # named mistakes
MOST_PICTURES = 40
MORE = "--all prints"  # printed if something is omitted
UNKNOWN = "looks like none of the known mistakes"


def as_json(report: Report) -> bytes:
    """The report as JSON."""
    cases = [msgspec.structs.replace(case, evidence={}) for case in report.cases]
    return msgspec.json.format(msgspec.json.encode(msgspec.structs.replace(report, cases=cases)), indent=1) + b"\n"


def as_table(report: Report, *, everything: bool = False) -> str:
    """The report for a terminal, the answer first: failed cases only, or all cases with all details."""
    most = sys.maxsize if everything else MOST_LINES
    shown = [case for case in report.cases if everything or case.status not in ("passed", "not ported")]
    opening = answer(report, everything=everything)
    lines = [*opening, *([""] if opening else [])]
    lines += [f"{'case':<32} {'level':>5} {'outputs':>8}  verdict"] if shown else []
    for case in shown:
        good = sum(o.status == "passed" for o in case.outputs)
        verdict = _summary(case, report)
        lines.append(f"{case.name:<32} {_level(case):>5} {good:>4}/{len(case.outputs):<3}  {verdict}")
    for status in ("passed", "not ported") if not everything else ():
        count = sum(case.status == status for case in report.cases)
        lines += [f"{count} of {len(report.cases)} cases {status}"] if count else []
    refused = [f"{c.name}/{o.name}: {_line(o)}" for c, o in _outputs(report, "refused")]
    lines += _listed("refused outputs:", refused, most)
    lines += _listed("missing outputs:", _missing(report, most if everything else MOST_MISSING), most)
    lines += [""] + [
        f"level {k} ({LEVELS[k]}): {good} of {asked} outputs" for k, (good, asked) in report.levels.items()
    ]
    return "\n".join([*lines, *lines_of(report.profiles), *report.notes, report.claim])


def answer(report: Report, *, everything: bool = False) -> list[str]:
    """The faults: how the port failed, the first wrong operation, its explanations and resemblances.

    A known mistake that explains everything stands above a change of the definition that was searched, which stands
    above the others.
    """
    known = _suspects(report, everything=everything)
    certain = bool(report.suspects) and report.suspects[0].whole
    explanations = [*known, *report.causes] if certain else [*report.causes, *known]
    return [
        *report.failures,
        *report.needles,
        *report.diagnosis[:1],
        *report.inside,
        *explanations,
        *report.diagnosis[1:],
    ]


def _level(case: CaseReport) -> int:
    """The lowest level blocked by a case; the level of the case if it passed."""
    return min((o.level for o in case.outputs if o.status != "passed"), default=case.level)


def _outputs(report: Report, status: str) -> list[tuple[CaseReport, OutputReport]]:
    return [(case, o) for case in report.cases for o in case.outputs if o.status == status]


def _missing(report: Report, most: int) -> list[str]:
    """The names of missing outputs, `most` of a case in one line, followed by files with similar names."""
    lines: dict[str, list[str]] = {}
    more: dict[str, list[str]] = {}
    for case, output in _outputs(report, "missing"):
        lines.setdefault(case.name, []).append(output.name)
        found = output.reason.partition("; ")[2]
        more.setdefault(case.name, []).extend([f"  {output.name}: {found}"] if found else [])
    shown = {
        case: [*names[:most], *([f"{len(names) - most} more"] * (len(names) > most))] for case, names in lines.items()
    }
    return [line for case, names in shown.items() for line in (f"{case}: {', '.join(names)}", *more[case])]


def _listed(title: str, lines: list[str], most: int) -> list[str]:
    if not lines:
        return []
    more = [f"  and {len(lines) - most} more lines, which {MORE}"] if len(lines) > most else []
    return ["", title, *(f"  {line}" for line in lines[:most]), *more]


def _suspects(report: Report, *, everything: bool) -> list[str]:
    """The named mistakes with the evidence for and against each, or else the partial resemblances."""
    if not any(case.status == "refused" for case in report.cases):
        return []
    named = [s for s in report.suspects if s.named]
    most = len(named) if everything else MOST_NAMED
    lines = ["looks like:"] if named else []
    for suspect in named[:most]:
        lines.append(f"  {suspect.flag}: {suspect.title} ({suspect.wrong})")
        lines += [f"    {line}" for line in said(suspect, everything=everything)]
    lines += [f"  and {len(named) - most} more, which {MORE}"] if len(named) > most else []
    if named:
        return lines
    if report.pair:
        return [f"looks like two mistakes at once: {' and '.join(report.pair)}; each has outputs of its own"]
    names = ", ".join(f"{s.flag} ({s.score:.2f})" for s in (report.suspects if everything else report.suspects[:3]))
    more = f", and {len(report.suspects) - 3} more, which {MORE}" if len(report.suspects) > 3 and not everything else ""
    return [f"{UNKNOWN}; resembles in part, of 1: {names}{more}"] if names else [] if report.causes else [UNKNOWN]


def said(suspect: Suspect, *, everything: bool = False) -> list[str]:
    """The evidence for and against a mistake."""
    e = suspect.evidence
    cases = len({name.rpartition("/")[0] for name in e.agrees + e.fits})
    lines = [f"for it: {len(e.agrees)} outputs agree, {len(e.fits)} more are refused as expected, in {cases} cases"]
    for text, names in (
        ("refused, but wrong in another way", e.differs),
        ("passed, although it changes them", e.passes),
        ("refused, although it leaves them right", e.unexplained),
    ):
        if names:
            most = len(names) if everything else 2
            more = f" and {len(names) - most} more, which {MORE}" if len(names) > most else ""
            lines.append(f"against it: {text}: {', '.join(names[:most])}{more}")
    return lines


def _summary(case: CaseReport, report: Report) -> str:
    """The status of a case, and the reason for a refusal if known."""
    if case.status in ("passed", "not ported"):
        return case.status
    why = _why(case, report) if any(o.expected is not None for o in case.outputs) else ""
    return "; ".join(filter(None, (f"{case.status}: {why}" if why else case.status, case.first_wrong)))


def _why(case: CaseReport, report: Report) -> str:
    first = report.first_wrong
    if case.looks_like:
        return f"looks like {', '.join(case.looks_like)}"
    if first in made_of(case.operation):
        return f"follows from {first}"
    if report.causes and case.operation == first:
        return "explained by the change above"
    named = [s.flag for s in report.suspects if s.named]
    return f"{named[0]} is not examined here" if named and named[0] not in case.evidence else "not explained"


def _line(output: OutputReport) -> str:
    if not output.index and output.got is None:
        return output.reason
    if output.got is None or output.expected is None:
        return f"{output.reason}; at {list(output.index)} not finite, expected {output.expected:.17g}"
    off = output.got - output.expected
    return (
        f"{output.reason}; at {list(output.index)} {output.got:.17g}, expected {output.expected:.17g}: off by {off:.2e}"
    )


def write_report(report: Report, golden: Golden, outputs: Path, data: Path | None, page: Path | None) -> None:
    """Write the report as JSON to `data` and as a page to `page`, each in one step; None = not this one."""
    if data:
        replace_file(data, lambda temporary: temporary.write_bytes(as_json(report)))
    if page:
        replace_text(page, as_html(report, golden, outputs))


def as_html(report: Report, golden: Golden, outputs: Path) -> str:
    """One page: claim, answer, levels, all cases; expected, got and difference of refused images."""
    e = html.escape
    rows, pictures = [], 0
    for case in report.cases:
        details = []
        for o in case.outputs:
            if o.status == "passed":
                continue
            picture = ""
            if o.status == "refused":
                picture = _pictures(golden, outputs, case, o.name)
                pictures += bool(picture)
                picture = picture if pictures <= MOST_PICTURES else ""
            details.append(f"<li><b>{e(o.name)}</b> (level {o.level}) {e(_line(o))}{picture}</li>")
        body = f"<ul>{''.join(details)}</ul>" if details else ""
        rows.append(
            f'<tr class="{case.status}"><td>{e(case.name)}</td><td>{_level(case)}</td><td>{e(case.title)}</td>'
            f"<td>{e(_summary(case, report))}{body}</td></tr>"
        )
    levels = "".join(
        f"<tr><td>{k}</td><td>{e(LEVELS[k])}</td><td>{a} of {b}</td></tr>" for k, (a, b) in report.levels.items()
    )
    opening = "\n".join(answer(report, everything=True))
    left_out = f"{pictures - MOST_PICTURES} more pictures are left out; --only FAMILY draws those of one family."
    return _PAGE.format(
        claim=e(report.claim), levels=levels, rows="".join(rows), notes=e(" ".join(report.notes)),
        answer=f"<pre>{e(opening)}</pre>" if opening else "", left_out=left_out if pictures > MOST_PICTURES else "",
    )  # fmt: skip


_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>{claim}</title><style>
body{{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:75em;padding:0 1em;color:#1c2430}}
table{{border-collapse:collapse;width:100%}}td,th{{text-align:left;vertical-align:top;padding:.3em .6em;
border-bottom:1px solid #dde3ea}}.passed td:first-child{{border-left:4px solid #3a8f5c}}
.refused td:first-child{{border-left:4px solid #b3392f}}.missing td:first-child{{border-left:4px solid #b8a03a}}
img{{image-rendering:pixelated;height:120px;margin:.3em .6em .3em 0;border:1px solid #ccd}}figure{{margin:0}}
pre{{white-space:pre-wrap;overflow-wrap:anywhere;background:#f4f6f8;padding:.6em}}
figcaption{{color:#5a6675;font-size:13px}}td,li{{overflow-wrap:anywhere}}ul{{padding-left:1.2em}}
@media(max-width:640px){{tr,td{{display:block}}th{{display:none}}td{{border:0;padding:.1em .6em}}
tr{{border-bottom:1px solid #dde3ea;padding:.3em 0}}}}</style></head><body><h1>{claim}</h1><p>{notes}</p>{answer}
<table><tr><th>level</th><th></th><th>outputs</th></tr>{levels}</table>
<h2>Cases</h2><p>{left_out}</p>
<table><tr><th>case</th><th>level</th><th>what it is for</th><th>verdict</th></tr>{rows}</table>
</body></html>
"""


def _pictures(golden: Golden, outputs: Path, report: CaseReport, name: str) -> str:
    """Expected, got and magnitude of the difference of an image-shaped output, or nothing."""
    case = next((c for c in golden.cases if c.name == report.name), None)
    if case is None or name not in case.outputs:
        return ""
    asked = case.outputs[name]
    if len(asked.shape) < 2 or min(asked.shape[-2:]) < 4 or asked.dtype != "real":
        return ""
    try:
        got = read_plain(outputs / case.family / case.case / f"{name}.npy", outputs, 8 * int(np.prod(asked.shape)))
    except Refused:
        return ""
    expected = golden.array(case, asked.answer(report.answer))
    if got.shape != expected.shape:
        return ""
    planes = [_plane(a) for a in (expected, got)]
    low, high = float(planes[0].min()), float(planes[0].max())
    off = np.abs(planes[1] - planes[0])
    off = np.where(np.isfinite(off), off, np.nanmax(np.where(np.isfinite(off), off, 0)) or 1.0)
    images = [_png(planes[0], low, high), _png(planes[1], low, high), _png(off, 0.0, float(off.max()))]
    shown = "".join(f'<img alt="" src="data:image/png;base64,{image}">' for image in images)
    return (
        f"<figure>{shown}<figcaption>expected, got, difference (largest {float(off.max()):.3g})</figcaption></figure>"
    )


def _plane(array: NDArray) -> NDArray[np.float64]:
    return array.astype(np.float64).reshape(-1, *array.shape[-2:])[0]


def _png(plane: NDArray[np.float64], low: float, high: float) -> str:
    """An 8-bit grey PNG as base64."""
    span = high - low if high > low else 1.0
    with np.errstate(all="ignore"):
        grey = np.clip(np.nan_to_num((plane - low) / span, nan=1.0), 0.0, 1.0)
    pixels = (grey * 255).astype(np.uint8)
    height, width = pixels.shape
    raw = b"".join(b"\x00" + row.tobytes() for row in pixels)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    image = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")
    return base64.b64encode(image).decode()
