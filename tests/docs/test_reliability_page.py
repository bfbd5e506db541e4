"""The page on reliability holds the tables of the stored results, and its promises name what exists."""

import json
import re

import pytest
from pages.book import reliability
from pages.store.program import DOCS, RESULTS

ROOT = DOCS.parent


@pytest.mark.parametrize("name", reliability.MAKERS)
def test_every_result_can_be_made_again(name):
    assert (ROOT / reliability.MAKERS[name].split()[1]).is_file()


def test_every_stored_trial_is_as_promised():
    file = RESULTS / "faults.json"
    if not file.exists():
        pytest.skip("no result of the campaign is stored yet")
    rows = json.loads(file.read_text())["faults"]
    assert {row["fault"]: row["trials"] - row["as_promised"] for row in rows} == {row["fault"]: 0 for row in rows}


def test_every_file_that_the_page_names_exists():
    (page,) = reliability.PROGRAM.pages
    text = page.read_text(encoding="utf-8")
    for path in re.findall(r"(tests/\S+?\.py)", text):
        assert (ROOT / path).is_file(), path
    bounds = {"256 MiB": "png.LARGEST_FILE", "64 MiB": "files.LARGEST_TEXT", "64 GiB": "checkpoint.LARGEST"}
    from endotsr.training.fitting import checkpoint
    from endotsr.untrusted import files, png

    places = {"png": png, "files": files, "checkpoint": checkpoint}
    for said, name in bounds.items():
        size, unit = said.split()
        module, constant = name.split(".")
        assert said in text and int(size) * {"MiB": 1 << 20, "GiB": 1 << 30}[unit] == getattr(places[module], constant)
