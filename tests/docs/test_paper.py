"""The annotated paper: every name on it exists, every equation of the paper stands on it, and the citation is valid."""

import re
from pathlib import Path

import pytest
from pages.claims import paper
from pages.store.published import BY_NAME, SEVEN_OTHERS

from endotsr import __version__
from endotsr.errors import InputError

ROOT = Path(__file__).parents[2]


def test_every_equation_of_the_paper_has_a_sentence():
    labels = [sentence.label for sentences in paper.SECTIONS.values() for sentence in sentences]
    assert {"1", "1b", *"234567"} <= set(labels)
    numbered = [row.split("|")[2].strip() for row in paper.method().splitlines() if row.startswith("| ")]
    assert sum(cell.startswith("{eq}") for cell in numbered) == len(labels)


def test_every_claim_of_the_paper_stands_on_the_page():
    """Each statement of the verdicts has a sentence; of its metrics one is enough."""
    table = paper.CLAIMS.read_text(encoding="utf-8").split("<!-- claims:verdicts_pulling:start -->")[1]
    rows = table.split("<!--")[0].strip().splitlines()[2:]
    claims = {row.strip("| ").split(" | ")[0].split(": ")[0].split(", ")[0] for row in rows}
    shown = [s.verdict for sentences in paper.SECTIONS.values() for s in sentences if s.verdict]
    left = [c for c in claims if not any(start.startswith(c) or c.startswith(start) for start in shown)]
    assert left == []


def test_what_the_paper_does_not_contain_is_not_on_its_page():
    said = " ".join(s.says for sentences in paper.SECTIONS.values() for s in sentences).lower()
    assert not any(words in said for words in ("right eye", "every second", "blocks of two", "end of the clip"))


def test_lpips_has_the_verdict_of_both_ranges_of_its_input():
    shown = [s.verdict for s in paper.SECTIONS["Results"] if s.verdict.startswith("Level: LPIPS")]
    assert shown == ["Level: LPIPS, input in [0, 1]", "Level: LPIPS, input in [-1, 1]"]
    assert paper.verdict_on("pulling", shown[0]) != paper.verdict_on("pulling", shown[1])


def test_the_other_systems_have_their_printed_values():
    table = paper.systems()
    assert all(f"| {value:.2f} |" in table for value in SEVEN_OTHERS) and "not at hand" not in table


def test_systems_by_name_are_ordered_by_their_mean():
    rows = [line.strip("| ").split(" | ") for line in paper.by_name().splitlines()[2:]]
    means = [float(row[3]) for row in rows]
    assert len(rows) == len(BY_NAME) and means == sorted(means, reverse=True)
    assert next(row for row in rows if row[0] == "Local-EndoGS")[1:4] == ["38.73", "39.65", "39.19"]
    assert next(row for row in rows if row[0] == "ColorGS")[1:4] == ["-", "-", "39.85"]
    assert [paper.halved(*pair) for pair in ((38.43, 39.46), (37.99, 37.92), (37.19, 38.04))] == [
        "38.95",
        "37.96",
        "37.62",
    ]


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
