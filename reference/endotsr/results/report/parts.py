"""HTML elements of the report: escaping, numbers, pictures, and the style sheet.

All text from a run is escaped by `text`. The pages have no script. The report links to the viewer page, and after the
evaluation the progress page links to the report; there are no other links.
"""

import html
import math
from collections.abc import Iterable
from typing import Any

from endotsr.results.report import figures
from endotsr.results.report.figures import ByteImage
from endotsr.untrusted.marks import HTML

ABSENT = '<span class="absent" title="no value">&ndash;</span>'

LOSSLESS_BYTES = 200_000  # raw size up to which an embedded picture is a PNG


def text(value: Any) -> str:
    """`value` escaped for use between tags and inside double-quoted attributes."""
    return html.escape(str(value), quote=True)


def number(value: Any, digits: int) -> str:
    """A number with fixed decimals; a dash for None and for anything but a finite number."""
    if value is None or isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return ABSENT
    return f"{value:.{digits}f}".replace("-", "&minus;")


def cell(value: Any) -> str:
    """A value as a table cell: floats with 4 digits, integers with digit groups, escaped text."""
    if value is None:
        return ABSENT
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}".replace(",", "&#8239;").replace("-", "&minus;")
    if isinstance(value, float):
        return f"{value:.4g}".replace("-", "&minus;") if math.isfinite(value) else ABSENT
    return text(value)


def section(title: str, *content: str, note: str = "") -> str:
    """A section with a heading; "" without content."""
    body = "\n".join(part for part in content if part)
    if not body:
        return ""
    lead = f'<p class="note">{note}</p>' if note else ""
    return f"<section><h2>{text(title)}</h2>{lead}\n{body}</section>"


def details(summary: str, content: str, opened: bool = False) -> str:
    """A collapsible part. Both arguments are HTML."""
    return f"<details{' open' if opened else ''}><summary>{summary}</summary>{content}</details>"


def definitions(pairs: Iterable[tuple[str, str]]) -> str:
    """A list of names and contents, both HTML; "" without one."""
    rows = "".join(f"<dt>{name}</dt><dd>{content}</dd>" for name, content in pairs)
    return f"<dl>{rows}</dl>" if rows else ""


def figure(caption: str, content: str) -> str:
    """HTML content with a caption above it."""
    return f"<figure><figcaption>{text(caption)}</figcaption>{content}</figure>"


def image(picture: ByteImage, alternative: str, css: str = "") -> str:
    """An embedded picture with its size, which keeps the layout stable; small pictures are lossless."""
    kind = "webp" if picture.size > LOSSLESS_BYTES else "png"
    address = figures.data_uri(figures.encode(picture, kind), kind)
    style = f' class="{css}"' if css else ""
    height, width = picture.shape[:2]
    return f'<img{style} src="{address}" alt="{text(alternative)}" width="{width}" height="{height}" loading="lazy">'


def themed_image(light: bytes, dark: bytes, alternative: str) -> str:
    """A PNG chart in two versions; the page shows the one for the reader's colour scheme."""
    return (
        f'<picture><source media="(prefers-color-scheme: dark)" srcset="{figures.data_uri(dark, "png")}">'
        f'<img class="chart" src="{figures.data_uri(light, "png")}" alt="{text(alternative)}"></picture>'
    )


def moving_image(moving: bytes, still: bytes, alternative: str, width: int, height: int) -> str:
    """An animated WebP; readers who prefer reduced motion see its first picture."""
    return (
        f'<picture><source media="(prefers-reduced-motion: reduce)" srcset="{figures.data_uri(still, "webp")}">'
        f'<img src="{figures.data_uri(moving, "webp")}" alt="{text(alternative)}" width="{width}" height="{height}">'
        "</picture>"
    )


def colour_bar(name: str, low: str, high: str) -> str:
    """A colour map as a strip between its two end values."""
    colours = figures.colour_table(name)[::17]
    stops = ",".join(f"#{r:02x}{g:02x}{b:02x}" for r, g, b in colours)
    strip = f'<i style="background:linear-gradient(90deg,{stops})"></i>'
    return f'<span class="bar">{text(low)}{strip}{text(high)}</span>'


def colour_box(colour: tuple[int, int, int]) -> str:
    """A small box of one colour, for a legend."""
    red, green, blue = colour
    return f'<span class="bar"><i class="box" style="background:#{red:02x}{green:02x}{blue:02x}"></i></span>'


def card(value: str, unit: str, label: str) -> str:
    """A number in a box with a label below; `value` is HTML."""
    suffix = f"<small>{unit}</small>" if unit and "absent" not in value else ""
    return f'<div class="card"><b>{value}{suffix}</b><span>{text(label)}</span></div>'


def page(title: str, body: str, refresh: str = "") -> str:
    """The complete document.

    refresh   seconds until the browser reloads the page, or "0; url=NAME" to redirect
    """
    again = f'<meta http-equiv="refresh" content="{text(refresh)}">' if refresh else ""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'{HTML}<meta name="color-scheme" content="light dark">{again}'
        f"<title>{text(title)}</title><style>{STYLE}</style></head>\n<body><main>{body}</main></body></html>\n"
    )


STYLE = """
:root{--ground:#fafbfc;--panel:#fff;--ink:#1c262e;--soft:#5a6771;--line:#dfe5e9;--accent:#0b6e99;--tint:#e8f3f8;
--good:#1f7a45;--bad:#b3441a}
@media(prefers-color-scheme:dark){:root{--ground:#11171b;--panel:#182026;--ink:#e2e8ec;--soft:#98a5ae;--line:#2b363e;
--accent:#62bde6;--tint:#17303c;--good:#7fd39f;--bad:#f29a70}}
*{box-sizing:border-box}
body{margin:0;background:var(--ground);color:var(--ink);-webkit-text-size-adjust:100%;
font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif}
main{max-width:1180px;margin:0 auto;padding:2.2rem 1.25rem 4rem}
h1{font-size:clamp(1.5rem,4vw,2.1rem);line-height:1.2;margin:.1rem 0 .5rem;letter-spacing:-.015em;text-wrap:balance}
h2{font-size:1.25rem;margin:0 0 .4rem;letter-spacing:-.01em}
h3{font-size:1rem;margin:1.1rem 0 .4rem}
section{margin-top:2.6rem}
.eyebrow{color:var(--accent);font-size:.8rem;font-weight:600;letter-spacing:.06em;text-transform:uppercase;margin:0}
.lead{font-size:1.06rem;max-width:46rem;margin:.3rem 0 0;text-wrap:pretty}
.note,figcaption{color:var(--soft);font-size:.88rem}
.note{max-width:52rem;margin:.2rem 0 .8rem;text-wrap:pretty}
.good{color:var(--good)}.bad{color:var(--bad)}.absent{color:var(--soft)}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(9.2rem,1fr));gap:.7rem;margin-top:1.5rem}
.card{background:var(--panel);border:1px solid var(--line);border-radius:10px;padding:.75rem .9rem}
.card b{display:block;white-space:nowrap;font-size:1.38rem;line-height:1.25;font-weight:650;
font-variant-numeric:tabular-nums}
.card b small{font-size:.85rem;font-weight:500;color:var(--soft);margin-left:.2em}
.card span{color:var(--soft);font-size:.82rem}
.scroll{overflow-x:auto;background:var(--panel);border:1px solid var(--line);border-radius:10px;margin:.5rem 0}
table{border-collapse:collapse;width:100%;font-size:.9rem;font-variant-numeric:tabular-nums}
th,td{padding:.5rem .9rem;text-align:right;white-space:nowrap;border-bottom:1px solid var(--line)}
tbody th,td.words{white-space:normal}.words{text-align:left}td.words{min-width:11rem}
h1,h2,p,dt{overflow-wrap:anywhere}
thead th{color:var(--soft);font-weight:600;font-size:.8rem;vertical-align:bottom;white-space:normal}
th:first-child{text-align:left;position:sticky;left:0;background:var(--panel)}
tbody th{font-weight:500}
tbody tr:last-child>*{border-bottom:0}
tr.model>*{background:var(--tint)!important;font-weight:650}
td.best,td .best{color:var(--accent);font-weight:650}
figure{margin:0}
.preview img{width:auto;max-width:100%}.preview figcaption{margin-top:.35rem}
a{color:var(--accent)}
.charts{display:grid;grid-template-columns:repeat(2,minmax(0,1fr));gap:1rem}
.charts figure,.panel{background:var(--panel);border:1px solid var(--line);border-radius:10px;padding:.7rem .8rem}
.charts{align-items:start}.charts .scroll{margin:0}
.charts figcaption{color:var(--ink);font-weight:600;margin-bottom:.2rem}
img{display:block;width:100%;height:auto;border-radius:4px}
img.chart{border-radius:0}
img.inset{image-rendering:pixelated}
.views{display:grid;grid-auto-flow:column;grid-template-rows:auto auto;grid-auto-columns:minmax(0,1fr);gap:.45rem}
.views figure{display:contents}
.views div{position:relative}
.views div>span{position:absolute;left:.4rem;top:.4rem;padding:.05rem .5rem;border-radius:99px;font-size:.76rem;
color:#fff;background:rgba(10,14,18,.66)}
section>.panel{margin-bottom:1rem}
details{border-top:1px solid var(--line);padding:.7rem 0}
summary{cursor:pointer;font-weight:600}
summary small{color:var(--soft);font-weight:400;margin-left:.5rem}
details[open]>summary{margin-bottom:.6rem}
.legend{display:flex;flex-wrap:wrap;gap:.3rem 1.5rem;color:var(--soft);font-size:.85rem;margin:.2rem 0 .8rem}
.bar{display:inline-flex;align-items:center;gap:.45rem;white-space:nowrap}
.bar i{display:inline-block;width:7.5rem;height:.65rem;border-radius:3px}.bar i.box{width:.65rem}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.25rem 1.4rem;margin:0;font-size:.92rem}
dt{color:var(--soft)}dd{margin:0;overflow-wrap:anywhere}
pre{overflow-x:auto;font:.82rem/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;margin:0}
code{font:.85em ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;overflow-wrap:anywhere}
.whole{display:inline-block}
footer{margin-top:3rem;border-top:1px solid var(--line);padding-top:1rem;color:var(--soft);font-size:.86rem}
@media(max-width:1180px){.few td,.listed td{white-space:normal}}
@media(max-width:640px){main{padding:1.3rem .9rem 3rem}.charts{grid-template-columns:1fr}
.views{grid-auto-flow:row;grid-template-rows:none;grid-template-columns:1fr 1fr}
.cards{grid-template-columns:1fr 1fr}th,td{padding:.45rem .65rem}tbody th{min-width:8.5rem}
dl{grid-template-columns:minmax(0,1fr)}dd{margin-bottom:.4rem}
.few table,.few thead,.few tbody{display:block}
.few tr{display:grid;grid-template-columns:var(--columns);border-bottom:1px solid var(--line)}
.few tbody tr:last-child{border-bottom:0}
.few th:first-child{grid-column:1/-1;position:static;padding-bottom:0}
.few th,.few td{padding:.35rem .3rem;border-bottom:0;white-space:normal;overflow-wrap:anywhere;font-size:.85rem}
.few tr>:first-child,.few tr>:nth-child(2){padding-left:.5rem}.few tr>:last-child{padding-right:.5rem}
.few thead th{font-size:.72rem}}
@media(max-width:800px){.listed thead{display:none}
.listed table,.listed tbody,.listed th,.listed tr{display:block}
.listed tr{border-bottom:1px solid var(--line);padding:.4rem .7rem}.listed tbody tr:last-child{border-bottom:0}
.listed th,.listed td,.listed td.words{padding:.15rem 0;border-bottom:0;white-space:normal;text-align:left;min-width:0}
.listed td{display:grid;grid-template-columns:8.5rem minmax(0,1fr);gap:.6rem;overflow-wrap:anywhere}
.listed td::before{content:attr(data-head);color:var(--soft);font-size:.82rem}}
@media print{section{break-inside:avoid}details>*{display:block}}
"""
