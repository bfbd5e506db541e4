"""Every deliberately wrong port is refused, and the judge names its mistake first."""

import pytest

from endotsr.golden.judge.store import golden_folder, read_golden
from endotsr.golden.judge.verdict import conclude, judge_case
from endotsr.golden.vectors.reference import answer_wrongly
from endotsr.golden.vectors.registry import all_wrong_ports

WRONG_PORTS = all_wrong_ports()


@pytest.fixture(scope="module")
def golden():
    return read_golden(golden_folder())


@pytest.fixture(scope="module")
def clean(golden, tmp_path_factory):
    """Verdicts on the expected values themselves, by precision."""
    folder = tmp_path_factory.mktemp("clean")
    for case in golden.cases:
        target = folder / case.name
        target.mkdir(parents=True)
        for name, output in case.outputs.items():
            source = golden.folder / "cases" / case.name / output.file
            (target / f"{name}.npy").write_bytes(source.read_bytes())
    return {p: {c.name: judge_case(golden, c, folder, p) for c in golden.cases} for p in ("float64", "float32")}


def test_the_expected_values_pass_themselves(golden, clean):
    for precision, verdicts in clean.items():
        report = conclude(golden, list(verdicts.values()), precision, 5, [])
        assert report.passed and not report.suspects, report.claim


def test_there_are_many_wrong_ports_and_each_was_thought_of_when_a_case_was_made(golden):
    assert len(WRONG_PORTS) >= 40
    assert {flag for case in golden.cases for flag in case.flags} == set(WRONG_PORTS) == set(golden.manifest.flags)


@pytest.mark.parametrize("name", list(WRONG_PORTS))
def test_a_wrong_port_is_refused_and_named(name, golden, clean, tmp_path):
    spoiled = answer_wrongly(golden, tmp_path, WRONG_PORTS[name], spoiled_only=True)
    assert spoiled > 0
    for precision, right in clean.items():
        verdicts = [
            judge_case(golden, case, tmp_path, precision) if (tmp_path / case.name).is_dir() else right[case.name]
            for case in golden.cases
        ]
        report = conclude(golden, verdicts, precision, 5, [])
        assert not report.passed
        refused = {v.name for v in verdicts if v.status == "refused"}
        assert {case.name for case in golden.cases if name in case.flags} <= refused
        best = [s for s in report.suspects if s.matches - s.contradicted == report.suspects[0].matches]
        assert name in [s.flag for s in best], [(s.flag, s.matches, s.contradicted) for s in report.suspects[:4]]
