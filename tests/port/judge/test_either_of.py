"""Where several answers are right, each passes as a whole, and a mixture of them does not."""

import pytest

from endotsr.port.judge.case_verdict import judge_case
from endotsr.port.judge.store import golden_folder, read_golden

GOLDEN = read_golden(golden_folder())
CASES = [case for case in GOLDEN.cases if case.answers > 1]


def written(case, folder, answer_of):
    """Outputs of a port that gives answer `answer_of(name)` for each output."""
    target = folder / case.name
    target.mkdir(parents=True)
    for name, output in case.outputs.items():
        source = GOLDEN.folder / "cases" / case.name / output.answer(answer_of(name))
        (target / f"{name}.npy").write_bytes(source.read_bytes())
    return folder


def test_there_is_such_a_case_and_its_outputs_have_all_answers():
    assert CASES
    for case in CASES:
        for output in case.outputs.values():
            assert (output.compare.kind == "either-of") == (len(output.compare.others) == case.answers - 1 > 0)


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_each_answer_passes(case, precision, tmp_path):
    for answer in range(case.answers):
        folder = written(case, tmp_path / str(answer), lambda name, answer=answer: answer)
        report = judge_case(GOLDEN, case, folder, precision)
        assert report.status == "passed" and report.answer == answer


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_a_mixture_is_refused_where_it_turns(case, tmp_path):
    """The image of one answer with the gradient of another: level 1 is right, level 2 is not."""
    folder = written(case, tmp_path, lambda name: int(name.startswith("d_")))
    assert judge_case(GOLDEN, case, folder, "float32", level=1).status == "passed"
    report = judge_case(GOLDEN, case, folder, "float32")
    assert report.answer == 0
    assert all(o.name.startswith("d_") for o in report.outputs if o.status == "refused")
    assert report.status == "refused"
