"""Every case of the catalogue in docs/hard_cases.md has a test named after it, and the other way round."""

import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
PAGE = TESTS.parent / "docs" / "hard_cases.md"
NAMED = re.compile(r"^def test_hard_((?:[A-Z]\d+_)+)\w+\(", re.MULTILINE)
ROW = re.compile(r"^\| ([A-Z]\d+) \|(.+)\|(.+)\|(.+)\|$", re.MULTILINE)


def cases_in(file: Path) -> set[str]:
    """IDs in the names of the tests of one file; one name may carry several."""
    return {case for found in NAMED.findall(file.read_text(encoding="utf-8")) for case in found.strip("_").split("_")}


TESTED = {file.relative_to(TESTS).as_posix(): cases_in(file) for file in sorted(TESTS.rglob("test_*.py"))}
CATALOGUE = {case: cells for case, *cells in ROW.findall(PAGE.read_text(encoding="utf-8").replace("`", ""))}


@pytest.mark.parametrize("case", CATALOGUE)
def test_the_case_has_input_bound_and_a_test_in_each_file_it_names(case):
    given, bound, files = CATALOGUE[case]
    assert given.strip() and bound.strip() and files.split()
    for file in files.split():
        assert case in TESTED.get(file, ()), f"no test_hard_{case}_... in tests/{file}"


def test_no_test_is_named_after_a_case_that_the_catalogue_does_not_have():
    for file, cases in TESTED.items():
        for case in cases:
            assert case in CATALOGUE, f"tests/{file}: {case} is not in {PAGE.name}"
            assert file in CATALOGUE[case][2].split(), f"{PAGE.name} does not name tests/{file} for {case}"


def test_the_catalogue_is_complete():
    """The families and how many cases each has: a lost row of the table is noticed."""
    sizes = {letter: sum(case[0] == letter for case in CATALOGUE) for letter in sorted({c[0] for c in CATALOGUE})}
    assert sizes == {
        "A": 6, "C": 7, "D": 5, "E": 6, "F": 8, "G": 5, "H": 5, "I": 1, "K": 3, "L": 7, "M": 2, "N": 4, "O": 4,
        "P": 7, "Q": 2, "S": 4, "T": 4, "W": 6, "X": 3,
    }  # fmt: skip
