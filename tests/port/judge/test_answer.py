"""The report begins with the answer, says why a case is refused, and how to see what it leaves out."""

import json

import numpy as np
import pytest
from made_up_ports import case_of, cases_of, write_expected

from endotsr.cli.golden import run
from endotsr.port.judge.npy import npy_bytes, write_npy
from endotsr.port.judge.recognise import MENTIONED
from endotsr.port.judge.report import MOST_LINES, as_html, as_table
from endotsr.port.judge.verdict import judge, without_claim


@pytest.fixture
def right(golden, tmp_path):
    """A folder with the expected values of all cases."""
    write_expected(golden, golden.cases, tmp_path)
    return tmp_path


def spoil(golden, folder, name, output, change):
    case = case_of(golden, name)
    write_npy(folder / name / f"{output}.npy", change(golden.array(case, case.outputs[output].file)))


def line(text, start):
    (found,) = [one for one in text.splitlines() if one.startswith(start)]
    return found


def test_a_case_says_from_which_operation_it_follows(golden, right):
    """A wrong covariance, and what is made of it and what is not."""
    for name, output in (("covariance/generic", "rotation"), ("projection/paper", "mean2d")):
        spoil(golden, right, name, output, lambda a: a + np.linspace(0.1, 0.3, a.size).reshape(a.shape) ** 2)
    spoil(golden, right, "render/paper", "colour_image", lambda a: a * 1.5 + 0.01)
    text = as_table(judge(golden, right, "float64", level=3))
    assert text.startswith("first wrong: operation covariance, equation (B2), level 1")
    assert line(text, "render/paper").endswith("refused: follows from covariance")
    assert line(text, "projection/paper").endswith("refused: not explained")


def test_a_mistake_that_a_case_does_not_examine_is_said(golden, right):
    case = case_of(golden, "masked_l1/generic")
    assert "l1_over_all_pixels" in case.mistakes
    spoil(golden, right, "exposure/generic", "exposed", lambda a: a**2 + 0.1)
    mask = golden.array(case, "inputs/mask.npy")
    for one in cases_of(golden, "masked_l1"):
        share = golden.array(one, "inputs/mask.npy").mean()
        for name in one.outputs:
            spoil(golden, right, one.name, name, lambda a, share=share: a * share)
    report = judge(golden, right, "float64", level=3)
    text = as_table(report)
    assert mask.any() and report.suspects[0].flag == "l1_over_all_pixels" and report.suspects[0].named
    assert line(text, "exposure/generic").endswith("refused: l1_over_all_pixels is not examined here")
    assert line(text, "masked_l1/generic").endswith("refused: looks like l1_over_all_pixels")


def test_a_crash_comes_first(golden, right):
    spoil(golden, right, "motion/generic", "translation", lambda a: 2 * a)
    report = judge(golden, right, "float64", level=1)
    without_claim(report, ["the port ended with code 3"])
    assert as_table(report).splitlines()[:2] == [
        "the port ended with code 3",
        "first wrong: operation motion, equation (3), level 1, forward",
    ]


def test_a_file_of_another_name_is_named_beside_the_missing_one(golden, right):
    folder = right / "motion" / "generic"
    (folder / "d_phi.npy").rename(folder / "dphi.npy")
    (folder / "unlike.npy").write_bytes(npy_bytes(np.zeros(1)))
    text = as_table(judge(golden, right, "float64", level=2))
    assert "  motion/generic: d_phi\n    d_phi: 'dphi.npy' is there and is no output of this case\n" in text
    assert "unlike" not in text


def test_two_passes_of_other_bits_show_the_first_entry_that_differs(golden, right):
    """Before, the report had 0 and 0 at no index."""
    case = case_of(golden, "determinism/twice")
    name = next(name for name, o in case.outputs.items() if o.compare.kind == "identical" and o.shape)
    to, last = case.outputs[name].compare.to, tuple(n - 1 for n in case.outputs[name].shape)

    def nudged(array):
        changed = array.copy()
        changed[last] = np.nextafter(changed[last], np.inf)
        return changed

    spoil(golden, right, case.name, name, nudged)
    found = line(as_table(judge(golden, right, "float64", only=case.name)), f"  {case.name}/{name}: ")
    assert f"bits differ from {to}; at {list(last)} " in found and "off by 0.00" not in found
    spoil(golden, right, case.name, name, lambda array: array.astype(np.float32))
    assert f"{to} is float64" in as_table(judge(golden, right, "float32", only=case.name))
    (right / case.name / f"{to}.npy").unlink()
    found = line(as_table(judge(golden, right, "float32", only=case.name)), f"  {case.name}/{name}: ")
    assert found.endswith(f"{to}, whose bits it must have, is not there")


def test_a_part_is_right_without_a_second_run(golden, right, capsys):
    """Before, `golden judge OUTDIR --only matern` ended with exit code 1, as level 5 is the default."""
    assert run(["judge", str(right), "--only", "matern"]) == 0 and "missing" not in capsys.readouterr().out
    assert run(["judge", str(right), "--search", "0"]) == 1 and "second run" in capsys.readouterr().out
    assert judge(golden, right, "float32", only="matern", again=right).cases[-1].name == "determinism/again"


def test_what_is_left_out_is_said_and_is_printed_on_request(golden, right):
    count = 0
    for case in golden.cases:
        if case.operation in ("render", "composite"):
            for name, output in case.outputs.items():
                if output.dtype == "real" and output.level <= 3:
                    spoil(golden, right, case.name, name, lambda a: a + 0.1)
                    count += golden.array(case, output.file).size > 0
    report = judge(golden, right, "float64", level=3)
    assert count > MOST_LINES
    refused = sum(o.status == "refused" for case in report.cases for o in case.outputs)
    assert f"  and {refused - MOST_LINES} more lines, which --all prints" in as_table(report)
    whole = as_table(report, everything=True)
    assert "more lines" not in whole and "which --all prints" not in whole
    page = as_html(report, golden, right)
    assert "more pictures are left out; --only FAMILY draws" in page and "<pre>first wrong: " in page


def test_weak_candidates_are_hidden(golden, right):
    spoil(golden, right, "motion/generic", "translation", lambda a: a + 0.3)
    report = judge(golden, right, "float64", level=3)
    assert MENTIONED == 0.4 and all(s.score >= 0.4 for s in report.suspects)


def test_the_command_searches_and_can_be_told_not_to(golden, right, capsys):
    for case in cases_of(golden, "matern"):
        for name in case.outputs:
            if name != "rho":
                spoil(golden, right, case.name, name, lambda a: 1.7 * a)
    words = ["judge", str(right), "--precision", "float64", "--level", "2", "--only", "matern"]
    assert run([*words, "--json", str(right / "r.json")]) == 1
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("first wrong: operation matern") and "definition/matern.py:" in said[1]
    assert json.loads((right / "r.json").read_text())["causes"][0] == said[1]
    assert line("\n".join(said), "matern/short").endswith("refused: explained by the change above")
    assert run([*words, "--search", "0"]) == 1
    assert "definition/matern.py" not in capsys.readouterr().out
