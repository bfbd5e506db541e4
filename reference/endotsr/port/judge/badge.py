"""A badge of a certificate: a small picture in SVG, of the name of the vectors and of the claim."""

import html
from pathlib import Path

from endotsr.port.judge.certificate import Certificate, Port, certified, obstacle, write_certificate
from endotsr.port.judge.profiles import PROFILES
from endotsr.port.judge.records import Report
from endotsr.port.judge.store import Golden
from endotsr.untrusted.writing import replace_text

LEFT = "endotsr golden"
NARROW, WIDE = " ,.()fijlrt", "mw"  # letters; widths at 11 px, px:
LETTER, NARROW_LETTER, WIDE_LETTER = 6.8, 4.0, 10.0
MARGIN = 12  # of a text, both sides together, px
COLOURS = {0: "#5a6675", 1: "#2f6f9f", 2: "#2f6f9f", 3: "#23794a", 4: "#23794a", 5: "#23794a"}  # white text on them
_BADGE = """<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="20" role="img" aria-label="{title}">
<title>{title}</title>
<rect width="{left_width}" height="20" fill="#1c2430"/>
<rect x="{left_width}" width="{right_width}" height="20" fill="{colour}"/>
<g fill="#fff" text-anchor="middle" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">
<text x="{left_at}" y="14" textLength="{left_text}">{left}</text>
<text x="{right_at}" y="14" textLength="{right_text}">{right}</text>
</g>
</svg>
"""


def badge_text(certificate: Certificate) -> str:
    """What stands on the right: version, profile, level, precision, and whether something is left out."""
    part = f"{PROFILES[certificate.profile].title}, " if certificate.profile else ""
    less = ", in part" if certificate.without else ""
    short = ".".join(certificate.vectors.split(".")[:2])
    return f"{short}, {part}level {certificate.level}, {certificate.precision}{less}"


def width(text: str) -> int:
    """The width of a text in px, for every badge at least that of DejaVu Sans at 11 px and up to 8 % more."""
    own = (NARROW_LETTER if one in NARROW else WIDE_LETTER if one in WIDE else LETTER for one in text)
    return round(sum(own))


def badge(certificate: Certificate) -> str:
    """The picture as text; its title is the whole claim."""
    right = badge_text(certificate)
    left_text, right_text = width(LEFT), width(right)
    left_width, right_width = left_text + MARGIN, right_text + MARGIN
    return _BADGE.format(
        width=left_width + right_width, left_width=left_width, right_width=right_width, left_text=left_text,
        right_text=right_text, left_at=left_width / 2, right_at=left_width + right_width / 2, left=LEFT,
        right=html.escape(right), colour=COLOURS[certificate.level], title=html.escape(certificate.claim),
    )  # fmt: skip


def write_badge(path: Path, certificate: Certificate) -> None:
    """As SVG."""
    replace_text(path, badge(certificate))


def write_proof(golden: Golden, report: Report, port: Port, certificate: Path | None, picture: Path | None) -> str:
    """Write the certificate of a report, its badge, or both. Returns the reason if there is none, else ""."""
    if not (certificate or picture):
        return ""
    if reason := obstacle(report):
        return reason
    found = certified(golden, report, port)
    if certificate:
        write_certificate(certificate, found)
    if picture:
        write_badge(picture, found)
    return ""
