"""docs/guides/port.md: the report that it prints is that of the judge for this mistake."""

import re
from pathlib import Path

from made_up_ports import case_of, cases_of, write_expected

from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.report import as_table
from endotsr.port.judge.verdict import judge
from endotsr.port.search.find import explain

GUIDE = Path(__file__).parents[3] / "docs" / "guides" / "port.md"


def test_the_report_of_the_guide_is_that_of_a_penalty_over_two(golden, tmp_path):
    cases = cases_of(golden, "matern")
    write_expected(golden, cases, tmp_path)
    for case in cases:
        for name in ("penalty", "d_motion_coefficients"):
            expected = golden.array(case_of(golden, case.name), case.outputs[name].file)
            write_npy(tmp_path / case.name / f"{name}.npy", 3 * expected)
    found = judge(golden, tmp_path, "float64", level=2, only="matern")
    explain(golden, found, tmp_path, 16)
    (printed,) = re.findall(r"^```text\n(first wrong: operation matern.*?)^```", GUIDE.read_text("utf-8"), re.M | re.S)
    assert as_table(found).split("\n\n")[0] == printed.rstrip("\n")
