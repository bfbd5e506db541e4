"""Prevents line breaks between a number and its unit, and between groups of digits, on every page of the book.

A space between a number and a unit becomes a non-breaking space. Code and mathematics are unchanged, except for long
names in tables, which may break after a point or an underscore.
"""

import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform

UNITS = (
    "ns", "us", "µs", "ms", "s", "min", "h", "px", "nm", "mm", "cm", "m", "dB", "KB", "MB", "GB", "TB", "MiB", "GiB",
    "GB/s", "GFLOP/s", "Hz", "fps", "%", "bit", "bits",
)  # fmt: skip
BREAKABLE = re.compile(rf"(?<=\d) (?=(?:{'|'.join(map(re.escape, sorted(UNITS, key=len, reverse=True)))})(?![\w/]))")
GROUPS = re.compile(r"(?<=\d) (?=\d{3}(?!\d))")
EXPONENT = re.compile(r"(?<=\de)-(?=\d)")
BREAKS = re.compile(r"(?<=[._/,])(?=\w)")
LONGEST_NAME = 12  # characters of a name that stays whole
UNTOUCHED = (nodes.literal, nodes.literal_block, nodes.math, nodes.math_block, nodes.raw, nodes.comment)


def unbroken(text: str) -> str:
    """The text with non-breaking spaces, `12 ms` and `1 462 338`, and unbroken exponents, `1e-4`."""
    return EXPONENT.sub("-\u2060", GROUPS.sub("\u202f", BREAKABLE.sub("\u00a0", text)))


class UnbrokenUnits(SphinxPostTransform):
    """Replaces the spaces in the text of a page."""

    default_priority = 700

    def run(self, **_: Any) -> None:
        for text in list(self.document.findall(nodes.Text)):
            above: Any = text.parent
            while above is not None and not isinstance(above, UNTOUCHED):
                above = above.parent
            new = unbroken(text.astext())
            if above is None and new != text.astext():
                text.parent.replace(text, nodes.Text(new))


class BreakableNames(SphinxPostTransform):
    """Lets a long name in a table break after a point, an underscore, a slash or a comma."""

    default_priority = 701

    def run(self, **_: Any) -> None:
        for literal in [node for entry in self.document.findall(nodes.entry) for node in entry.findall(nodes.literal)]:
            pieces = BREAKS.split(literal.astext())
            if len(pieces) > 1 and len(literal.astext()) > LONGEST_NAME:
                literal.children = []
                for k, piece in enumerate(pieces):
                    literal += [nodes.raw("", "<wbr>", format="html"), nodes.Text(piece)] if k else nodes.Text(piece)


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_post_transform(UnbrokenUnits)
    app.add_post_transform(BreakableNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
