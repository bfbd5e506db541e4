"""Equation numbers from labels: the display labelled `eq-1b` is (1b), `eq-b5` is (B5)."""

from typing import Any

from sphinx.application import Sphinx
from sphinx.domains.math import MathDomain


class PaperMathDomain(MathDomain):
    """The mathematics domain, with equation numbers from labels instead of a count."""

    def note_equation(self, docname: str, labelid: str, location: Any = None) -> None:
        super().note_equation(docname, labelid, location)
        if labelid.startswith("eq-"):
            number = labelid.removeprefix("eq-")
            number = number[0].upper() + number[1:]
            self.equations[labelid] = (docname, number)  # type: ignore[assignment]


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_domain(PaperMathDomain, override=True)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
