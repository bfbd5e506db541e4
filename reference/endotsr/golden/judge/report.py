"""The report of the judge as text, JSON and one self-contained HTML page with difference images."""

import base64
import html
import struct
import zlib
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.golden.judge.format import LEVELS
from endotsr.golden.judge.npy import Refused, read_plain
from endotsr.golden.judge.store import Golden
from endotsr.golden.judge.verdict import CaseReport, OutputReport, Report

MOST_LINES = 60  # refused outputs that the table prints
MOST_PICTURES = 40
UNKNOWN = "looks like none of the known mistakes"


def as_json(report: Report) -> bytes:
    """The report as JSON."""
    return msgspec.json.format(msgspec.json.encode(report), indent=1) + b"\n"


def as_table(report: Report) -> str:
    """The report for a terminal."""
    lines = [f"{'case':<32} {'level':>5} {'outputs':>8}  verdict"]
    for case in report.cases:
        good = sum(o.status == "passed" for o in case.outputs)
        lines.append(f"{case.name:<32} {case.level:>5} {good:>4}/{len(case.outputs):<3}  {_summary(case)}")
    bad = [(c, o) for c in report.cases for o in c.outputs if o.status == "refused"]
    if bad:
        lines += ["", "refused outputs:"]
        lines += [f"  {case.name}/{o.name}: {_line(o)}" for case, o in bad[:MOST_LINES]]
        lines += [f"  ... and {len(bad) - MOST_LINES} more"] if len(bad) > MOST_LINES else []
    if report.suspects:
        lines += ["", "looks like:"]
        for s in report.suspects[:5]:
            against = f", but {s.contradicted} passed cases speak against it" if s.contradicted else ""
            lines.append(f"  {s.flag}: {s.title} ({s.wrong}); in {s.matches} case{'s' * (s.matches > 1)}{against}")
    elif bad:
        lines += ["", UNKNOWN]
    lines += [""] + [
        f"level {k} ({LEVELS[k]}): {good} of {asked} outputs" for k, (good, asked) in report.levels.items()
    ]
    return "\n".join([*lines, *report.notes, report.claim])


def _summary(case: CaseReport) -> str:
    if case.status in ("passed", "not ported"):
        return case.status
    if case.looks_like:
        return f"{case.status}: looks like {', '.join(case.looks_like[:3])}"
    return f"{case.status}: {UNKNOWN}" if any(o.expected is not None for o in case.outputs) else case.status


def _line(output: OutputReport) -> str:
    if not output.index and output.got is None:
        return output.reason
    if output.got is None or output.expected is None:
        return f"{output.reason}; at {list(output.index)} not finite, expected {output.expected:.17g}"
    off = output.got - output.expected
    return (
        f"{output.reason}; at {list(output.index)} {output.got:.17g}, expected {output.expected:.17g}: off by {off:.2e}"
    )


def as_html(report: Report, golden: Golden, outputs: Path) -> str:
    """One page: claim, levels, suspects, every case; refused images with expected, got and difference."""
    e = html.escape
    rows, pictures = [], 0
    for case in report.cases:
        details = []
        for o in case.outputs:
            if o.status == "passed":
                continue
            picture = ""
            if o.status == "refused" and pictures < MOST_PICTURES:
                picture = _pictures(golden, outputs, case, o.name)
                pictures += bool(picture)
            details.append(f"<li><b>{e(o.name)}</b> (level {o.level}) {e(_line(o))}{picture}</li>")
        body = f"<ul>{''.join(details)}</ul>" if details else ""
        rows.append(
            f'<tr class="{case.status}"><td>{e(case.name)}</td><td>{case.level}</td><td>{e(case.title)}</td>'
            f"<td>{e(_summary(case))}{body}</td></tr>"
        )
    levels = "".join(
        f"<tr><td>{k}</td><td>{e(LEVELS[k])}</td><td>{a} of {b}</td></tr>" for k, (a, b) in report.levels.items()
    )
    suspects = "".join(
        f"<li><b>{e(s.flag)}</b>: {e(s.title)}. {e(s.wrong)}. Cases with its fingerprint: {s.matches}; "
        f"passed cases against it: {s.contradicted}</li>"
        for s in report.suspects[:8]
    )
    return _PAGE.format(
        claim=e(report.claim), levels=levels, rows="".join(rows), notes=e(" ".join(report.notes)),
        suspects=f"<h2>Looks like</h2><ul>{suspects}</ul>" if suspects else "",
    )  # fmt: skip


_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>{claim}</title><style>
body{{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:75em;padding:0 1em;color:#1c2430}}
table{{border-collapse:collapse;width:100%}}td,th{{text-align:left;vertical-align:top;padding:.3em .6em;
border-bottom:1px solid #dde3ea}}.passed td:first-child{{border-left:4px solid #3a8f5c}}
.refused td:first-child{{border-left:4px solid #b3392f}}.missing td:first-child{{border-left:4px solid #b8a03a}}
img{{image-rendering:pixelated;height:120px;margin:.3em .6em .3em 0;border:1px solid #ccd}}figure{{margin:0}}
figcaption{{color:#5a6675;font-size:13px}}td,li{{overflow-wrap:anywhere}}ul{{padding-left:1.2em}}
@media(max-width:640px){{tr,td{{display:block}}th{{display:none}}td{{border:0;padding:.1em .6em}}
tr{{border-bottom:1px solid #dde3ea;padding:.3em 0}}}}</style></head><body><h1>{claim}</h1><p>{notes}</p>
<table><tr><th>level</th><th></th><th>outputs</th></tr>{levels}</table>{suspects}
<h2>Cases</h2><table><tr><th>case</th><th>level</th><th>what it is for</th><th>verdict</th></tr>{rows}</table>
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
    grey = np.clip(np.nan_to_num((plane - low) / span, nan=1.0), 0.0, 1.0)
    pixels = (grey * 255).astype(np.uint8)
    height, width = pixels.shape
    raw = b"".join(b"\x00" + row.tobytes() for row in pixels)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    image = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")
    return base64.b64encode(image).decode()
