"""The gallery of docs/hard_cases.md: ours is right to its bound, the naive formula is not, the page is up to date."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
RESULTS, PAGE = ROOT / "docs" / "results", ROOT / "docs" / "hard_cases.md"
sys.path.insert(0, str(RESULTS))
from pages.hard_cases import pictures  # noqa: E402
from pages.hard_cases.gallery import CASES, DTYPES  # noqa: E402
from pages.hard_cases.page import gallery, measure, measured, promise  # noqa: E402

UNITS = {"float64": 2.0**-53, "float32": 2.0**-24}
IDS = [case.run.__name__ for case in CASES]


@pytest.fixture(scope="module")
def record():
    return measured()


@pytest.fixture(scope="module")
def rows():
    return {row["run"]: row for row in measure()}


def shown(name):
    """A part of the page."""
    mark = f"<!-- hard_cases:{name}"
    return PAGE.read_text(encoding="utf-8").partition(f"{mark}:start -->")[2].partition(f"{mark}:end -->")[0]


@pytest.mark.parametrize("case", CASES, ids=IDS)
def test_ours_is_right_and_the_naive_formula_is_not(case, rows):
    row = rows[case.run.__name__]
    for dtype in DTYPES:
        assert row[dtype]["ours_error"] <= case.bound * UNITS[dtype], dtype
    lost, rounding = row["float32"]["naive_error"], UNITS["float32"]
    assert not lost <= 10 * max(row["float32"]["ours_error"], rounding)  # NaN counts as lost


def test_the_page_shows_what_the_command_computes(record):
    """Up to the last digits, which may differ between machines: titles, sentences, values that are not finite."""
    number = re.compile(r"-?\d[\d.]*(?:e[+-]\d+)?(?: \((?:exact|\de[+-]\d+)\))?")
    shape = lambda text: number.sub("#", text.partition("Made by")[0]).strip()
    assert shape(shown("gallery")) == shape(gallery(record))
    stored = json.loads((RESULTS / "hard_cases.json").read_text(encoding="utf-8"))["cases"]
    for old, new in zip(stored, record["cases"], strict=True):
        for dtype in DTYPES:
            truth, again = old[dtype]["truth"], new[dtype]["truth"]
            assert truth == pytest.approx(again, rel=1e-6, abs=1e-12), old["title"]


def test_every_case_of_the_gallery_is_in_the_catalogue():
    catalogue = PAGE.read_text(encoding="utf-8")
    for case in CASES:
        assert f"\n| {case.name} |" in catalogue, case.name


def test_the_first_sentence_of_the_page_is_what_the_gallery_says(record):
    whole = lambda text: re.sub(r"[\d.]+e-\d+", "#", text.strip())  # the last digit may differ between machines
    assert whole(shown("promise")) == whole(promise(record))


def test_the_three_pictures_fail_above_and_not_below():
    found = pictures.measured()
    assert all(np.isfinite(ours).all() for _, ours in found.values())
    usual = {name: pair[0] for name, pair in found.items()}
    assert np.isnan(usual["Opaque Gaussian"]).sum() > 300 and np.isnan(usual["NaN under the instrument"]).sum() > 300
    textbook, ours = found["Needle"]
    assert np.abs(textbook - ours).max() > 0.5
