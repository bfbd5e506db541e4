"""Every deliberately wrong port is refused, and the judge names its mistake first."""

import sys

import pytest
from made_up_ports import case_of, write_expected

import make
from endotsr.port.contract import all_operations
from endotsr.port.judge.case_verdict import judge_case
from endotsr.port.judge.verdict import conclude
from makers.copies import Edit, changed_text
from makers.registry import all_wrong_ports
from makers.wrong import Question, answer_wrongly, answers

WRONG_PORTS = all_wrong_ports()


@pytest.fixture(scope="module")
def clean(golden, tmp_path_factory):
    """Verdicts on the expected values themselves, by precision."""
    folder = tmp_path_factory.mktemp("clean")
    write_expected(golden, golden.cases, folder)
    return {p: {c.name: judge_case(golden, c, folder, p) for c in golden.cases} for p in ("float64", "float32")}


def test_the_expected_values_pass_themselves(golden, clean):
    for precision, verdicts in clean.items():
        report = conclude(golden, list(verdicts.values()), precision, 5, [])
        assert report.passed and not report.suspects, report.claim


def test_there_are_many_wrong_ports_and_each_was_thought_of_when_a_case_was_made(golden):
    assert len(WRONG_PORTS) >= 200
    assert {flag for case in golden.cases for flag in case.flags} == set(WRONG_PORTS) == set(golden.manifest.flags)


def test_every_wrong_port_changes_the_source_and_no_two_change_it_alike():
    """A stale edit, whose text is no longer in the source, is refused."""
    for wrong_port in WRONG_PORTS.values():
        for module in {one.module for one in wrong_port.edits}:
            changed_text(module, [one for one in wrong_port.edits if one.module == module])
    assert len({wrong_port.edits for wrong_port in WRONG_PORTS.values()}) == len(WRONG_PORTS)
    with pytest.raises(ValueError, match="occurs 0 times, not 1"):
        changed_text("method.losses.masked_l1", [Edit("method.losses.masked_l1", "no such line", "")])


def _attribute(name: str) -> object:
    """What the package above a module has under its name: the module, or a function of that name."""
    above, _, own = name.rpartition(".")
    return getattr(sys.modules[above], own, None) if above else None


def test_a_copy_leaves_the_reference_as_it_is(golden):
    """Its modules, and its answer after the copy was used."""
    before = {name: module for name, module in sys.modules.items() if name.startswith("endotsr")}
    attributes = {name: _attribute(name) for name in before}
    question = case_of(golden, "masked_l1/generic")
    made = answers(WRONG_PORTS["l1_over_all_pixels"], [Question(question.name, question.operation,
                   golden.inputs(question), question.settings, question.flags)])  # fmt: skip
    assert {name: module for name, module in sys.modules.items() if name in before} == before
    for name, was in attributes.items():
        assert _attribute(name) is was, f"{name} is still the copy's"
    right = all_operations()["masked_l1"].compute(golden.inputs(question), question.settings)
    assert right["loss"] == golden.array(question, "expected/loss.npy") != made[question.name].double["loss"]


@pytest.mark.slow
@pytest.mark.parametrize("name", list(WRONG_PORTS))
def test_a_wrong_port_is_refused_and_named(name, golden, clean, tmp_path):
    examined = answer_wrongly(golden, tmp_path, WRONG_PORTS[name], spoiled_only=True)
    assert examined > 0
    for precision, right in clean.items():
        if WRONG_PORTS[name].rounding and precision == "float32":
            continue  # its answers here are those of a port in float64
        verdicts = [
            judge_case(golden, case, tmp_path, precision) if (tmp_path / case.name).is_dir() else right[case.name]
            for case in golden.cases
        ]
        report = conclude(golden, verdicts, precision, 5, [])
        assert not report.passed
        refused = {v.name for v in verdicts if v.status == "refused"}
        assert {case.name for case in golden.cases if name in case.flags} <= refused
        named = [s.flag for s in report.suspects if s.named]
        assert named and named[0] == name, [(s.flag, round(s.score, 3)) for s in report.suspects[:4]]


def test_no_integer_or_boolean_is_the_fingerprint_of_two_mistakes(golden):
    for case in golden.cases:
        for output in (name for name, o in case.outputs.items() if o.compare.kind == "exact"):
            shown = [m.shows[output] for m in case.mistakes.values() if output in m.shows]
            prints = [one.fingerprint for one in shown if one.fingerprint is not None and one.distance is not None]
            assert len(set(prints)) == len(prints), (case.name, output)


def test_mistakes_are_listed_and_written(tmp_path, capsys):
    """The list of flags.json; the outputs of one port; a flag that is not known is refused."""
    assert make.main(["wrong"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said == [f"{port.flag}: {port.title} ({port.wrong})" for port in WRONG_PORTS.values()]
    assert make.main(["wrong", "l1_over_all_pixels", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.startswith("golden: 7 cases answered wrongly in ")
    assert (tmp_path / "out" / "motion" / "generic" / "translation.npy").is_file()
    for words in (["no_such_flag", str(tmp_path)], ["l1_over_all_pixels"]):
        with pytest.raises(SystemExit, match="give the FLAG of a mistake"):
            make.main(["wrong", *words])
