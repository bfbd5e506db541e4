"""The annotated paper: every name on it exists, every equation of the paper stands on it, and the citation is valid."""

import re
from pathlib import Path

import pytest
from pages.claims import paper
from pages.store.marks import replaced

from endotsr import __version__
from endotsr.errors import InputError

ROOT = Path(__file__).parents[2]


def test_the_committed_page_is_made_by_its_command():
    text = paper.PAGE.read_text(encoding="utf-8")
    assert replaced(text, paper.parts(), paper.PAGE, "paper") == text


def test_every_equation_of_the_paper_has_a_sentence():
    labels = [sentence.label for sentences in paper.SECTIONS.values() for sentence in sentences]
    assert {"1", "1b", *"234567"} <= set(labels)
    numbered = [row.split("|")[2].strip() for row in paper.method().splitlines() if row.startswith("| ")]
    assert sum(cell.startswith("{eq}") for cell in numbered) == len(labels)


def test_every_claim_of_the_paper_stands_on_the_page():
    """Levels once each (LPIPS for one of its two ranges), gains and the largest step; ours are not the paper's."""
    table = paper.CLAIMS.read_text(encoding="utf-8").split("<!-- claims:verdicts:start -->")[1]
    claims = [line.strip("| ").split(" | ")[0] for line in table.split("<!-- claims:verdicts:end -->")[0].splitlines()]
    shown = [s.verdict for sentences in paper.SECTIONS.values() for s in sentences if s.verdict]
    left = [c for c in claims[3:] if not any(c.startswith(start) for start in shown)]
    assert all(c.startswith(("Ours", "The other sequences", "LPIPS, if its input is in [-1")) for c in left), left


def test_a_name_that_is_gone_stops_the_page():
    with pytest.raises(InputError, match="not a public function"):
        paper.link("endotsr.method.equations.appearance.gone")
    with pytest.raises(InputError, match="no row: gone"):
        paper.rulings(("gone",))
    with pytest.raises(InputError, match="no verdict on 'gone'"):
        paper.verdict("gone")


def test_the_citation_is_that_of_this_version_and_of_the_data():
    yaml = pytest.importorskip("yaml")
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0" and citation["version"] == __version__
    assert {"message", "title", "authors", "license"} <= set(citation)
    assert all({"type", "title", "authors"} <= set(reference) for reference in citation["references"])
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    for title in re.findall(r"\*([^*]+)\*, (?:MICCAI|IPCAI)", readme):
        assert title in [reference["title"] for reference in citation["references"]]
