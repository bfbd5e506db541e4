"""Existing programs answer the families that they have; a test is skipped where its program is not installed.

ENDOTSR_TORCH_PYTHON names an interpreter that has them, by default this one.
"""

import json
import os
import sys

import pytest
import survey

from endotsr.port.judge.store import golden_folder, read_golden

PYTHON = os.environ.get("ENDOTSR_TORCH_PYTHON", sys.executable)


def test_the_page_is_made_from_the_result():
    result = json.loads(survey.RESULT.read_text())
    written = survey.PAGE.read_text(encoding="utf-8").partition(survey.START)[2].partition(survey.END)[0]
    assert written == "\n" + survey.page(result)
    # A minor version adds cases; what a program gives for the others stays.
    assert result["golden"].split(".")[0] == read_golden(golden_folder()).manifest.version.split(".")[0]
    assert len(result["programs"]) >= 2


@pytest.mark.parametrize("file", list(survey.PROGRAMS))
def test_a_program_passes_what_it_passed_and_deviates_as_it_did(file):
    name, distribution, _ = survey.PROGRAMS[file]
    version = survey.version_of(PYTHON, distribution)
    known = next(p for p in json.loads(survey.RESULT.read_text())["programs"] if p["program"] == name)
    if version != known["version"]:
        pytest.skip(f"{name} {known['version']} is not installed (found: {version or 'none'})")
    report = survey.run(read_golden(golden_folder()), PYTHON, file)
    assert report is not None
    found = {row["case"]: (set(row["passed"]), row["named"]) for row in survey.rows_of(report)}
    assert found == {row["case"]: (set(row["passed"]), row["named"]) for row in known["cases"]}
