"""Names by evidence: of a contradicted case, of two mistakes at once, and their place beside a line of the search."""

import msgspec
import pytest

from endotsr.port.judge.diagnose import PARTS, first_wrong, order_of
from endotsr.port.judge.recognise import Evidence, Suspect, contradicted, pair_of
from endotsr.port.judge.records import CaseReport, OutputReport, Report
from endotsr.port.judge.report import answer


def suspect(evidence):
    return Suspect(flag="flag", title="Title", wrong="a; right: b", score=evidence.score, evidence=evidence)


@pytest.mark.parametrize(
    ("evidence", "named"),
    [
        (Evidence(agrees=["composite/a/x", "composite/a/y"]), True),
        (Evidence(agrees=["composite/a/x", "composite/a/y"], passes=["composite/b/x"]), False),
        (Evidence(agrees=["composite/a/x"], fits=["composite/c/x"] * 9, differs=["composite/b/x"]), False),
        (Evidence(agrees=["composite/a/x", "composite/b/x"], passes=["composite/c/x"]), True),
        (Evidence(agrees=["composite/a/x"], passes=["composite/a/y"]), True),  # one pass of the two alone
        (Evidence(agrees=["masked_l1/equal/x"], passes=["laplacian/equal/x"]), True),  # two operations share a rule
        (Evidence(fits=["calibration/a/x"], passes=["calibration/b/x"]), False),  # no output has a fingerprint
    ],
)
def test_one_case_that_others_contradict_gives_no_name(evidence, named):
    assert contradicted(evidence) != named
    assert suspect(evidence).named == named


@pytest.mark.parametrize(
    ("passing", "counts"),
    [("composite/b/x", True), ("render/b/x", True), ("harmonics/b/x", False), ("masked_l1/equal/x", False)],
)
def test_a_pass_counts_against_a_mistake_in_the_same_operation_its_parts_and_what_it_is_part_of(passing, counts):
    alone = Evidence(agrees=["composite/a/x"], unexplained=["composite/a/y"])
    beside = Evidence(agrees=["composite/a/x"], unexplained=["composite/a/y"], passes=[passing])
    assert (beside.score < alone.score) == counts
    assert alone.score == 0.5


def test_two_mistakes_in_two_outputs_are_told():
    one = Evidence(agrees=["d/a/x", "d/b/x"], unexplained=["d/a/y", "d/b/y"])
    two = Evidence(agrees=["d/a/y", "d/b/y"], unexplained=["d/a/x", "d/b/x"])
    assert pair_of({"one": one, "two": two})[:2] == ("one", "two")
    less = Evidence(agrees=["d/a/y"], differs=["d/b/y"], unexplained=["d/a/x", "d/b/x"])
    assert pair_of({"one": one, "two": less}) is None
    assert pair_of({"one": one, "two": two, "three": two}) is None, "not alone"
    assert pair_of({"one": one}) is None


def report(score_one):
    evidence = Evidence(agrees=["d/a/x"], passes=[] if score_one else ["d/a/y"] * 3)
    case = CaseReport(name="d/a", title="", operation="density", level=1, status="refused")
    return Report(version="4.1.0", precision="float64", asked_level=1, level=0, without=(), claim="", levels={},
                  cases=[case], suspects=[suspect(evidence)], notes=[], diagnosis=["first wrong: density"],
                  causes=["your outputs are those of the definition with `2`"])  # fmt: skip


def test_a_name_that_explains_everything_stands_above_a_line_of_the_search():
    lines = answer(report(True))
    assert lines.index("looks like:") < lines.index(report(True).causes[0])
    lines = answer(report(False))
    assert lines.index("looks like:") > lines.index(report(False).causes[0])


def test_the_first_wrong_operation_is_that_of_the_method(golden):
    refused = [OutputReport(name="d_rendered", level=2, status="refused", reason="")]
    reports = [
        CaseReport(name=name, title="", operation=name.split("/")[0], level=1, status="refused", outputs=refused)
        for name in ("laplacian/equal", "masked_l1/equal")
    ]
    assert first_wrong(golden.cases, reports)[1].operation == "masked_l1"


def test_the_order_has_every_operation_once_and_a_part_before_the_whole(golden):
    order = order_of(golden.cases)
    assert sorted(order) == sorted({case.operation for case in golden.cases}), "a name of PARTS is no operation"
    assert [(part, whole) for whole, of in PARTS.items() for part in of if order.index(part) > order.index(whole)] == []


def test_an_operation_that_is_no_part_of_another_comes_before_those_with_parts(golden):
    new = msgspec.structs.replace(golden.cases[-1], operation="haze", family="haze")
    order = order_of([*golden.cases, new])
    place = order.index("haze")
    assert order[place + 1 :] == list(PARTS) and {"masked_l1", "density", "pose"} < {*order[:place]}
