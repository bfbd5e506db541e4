"""Wrong statements of two outside reviews do not come back, and each correction names a check that exists."""

import re
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TABLE = tomllib.loads((Path(__file__).parent / "statements.toml").read_text(encoding="utf-8"))["statement"]
REVIEWS = {"claims": 15, "book": 29}  # statements of each
KINDS = {"record", "run", "bound", "hedge", "derivation", "source", "wording", "removed"}
TEXTS = ("README.md", "CONTRIBUTING.md", "docs/*.md", "docs/guides/*.md",
         "docs/specification/*.md", "docs/results/*.md", "notebooks/*.py",
         "notebooks/*.md", "reference/endotsr/**/*.py", "docs/pages/**/*.py", "docs/_static/*.js")  # fmt: skip


def folded(text: str) -> str:
    """Without the `#` of comments, in lower case, with single spaces."""
    return " ".join(re.sub(r"^\s*# ?", " ", text, flags=re.MULTILINE).split()).lower()


@cache
def texts() -> dict[str, str]:
    """Every page, notebook, module and maker of pages, by its path."""
    files = sorted({file for pattern in TEXTS for file in ROOT.glob(pattern)})
    return {file.relative_to(ROOT).as_posix(): folded(file.read_text(encoding="utf-8")) for file in files}


def named(row: dict) -> str:
    return " ".join(row["review"]) + " " + Path(row["where"]).name


def found_in(fragments: list[str], where: dict[str, str]) -> list[str]:
    """Files that contain a fragment, with the fragment."""
    return [f"{path}: {words}" for words in fragments for path, text in where.items() if folded(words) in text]


def exists(check: str) -> bool:
    """Whether the named test, or the fragment of an assertion, stands in its file."""
    path, _, name = check.partition("::" if "::" in check else " | ")
    file = ROOT / path
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    if "::" in check:
        return re.search(rf"^def {re.escape(name)}\(", text, re.MULTILINE) is not None
    return bool(name) and folded(name) in folded(text)


def test_the_table_has_every_statement_of_both_reviews():
    numbers = {label for row in TABLE for label in row["review"]}
    assert numbers == {f"{name} {n}" for name, count in REVIEWS.items() for n in range(1, count + 1)}


@pytest.mark.parametrize("row", TABLE, ids=named)
def test_a_wrong_statement_does_not_come_back(row):
    left = found_in(row["said"], texts())
    if row.get("open"):
        assert left or not row["said"], "corrected: replace `open` by what it says now and its check"
        pytest.skip("not corrected yet")
    assert not left


@pytest.mark.parametrize("row", [row for row in TABLE if not row.get("open")], ids=named)
def test_a_correction_says_what_checks_it(row):
    assert row["kind"] in KINDS and (row["check"] or row["kind"] in ("removed", "wording", "hedge"))
    assert [check for check in row["check"] if not exists(check)] == []
    assert folded(row["now"]) in texts()[row["where"]]


def test_a_fragment_that_comes_back_is_named_with_its_file():
    planted = {"docs/a.md": folded("The blend wins here,\n# but not on other splits.")}
    assert found_in(["But not on\nother splits"], planted) == ["docs/a.md: But not on\nother splits"]
    assert not exists("tests/docs/test_statements.py::test_gone") and not exists("README.md | no such assertion")
