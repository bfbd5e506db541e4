"""Several runs of a port: each within tolerance, and what differs between them; a wrong run is found in any place."""

import time

import pytest
from made_up_ports import racing

from endotsr.errors import InputError
from endotsr.port.judge import call, runs
from endotsr.port.judge.__main__ import main
from endotsr.port.judge.runs import RunDifference, called_often, joined, lines


def called(golden, folder, sizes, runs=3, **more):
    port = racing(folder, sizes)
    return called_often(golden, port, folder / "kept", "float32", runs=runs, level=2, only="motion", **more)[0]


def test_runs_within_tolerance_pass_and_their_spread_is_said(golden, tmp_path):
    report = called(golden, tmp_path, [0.0, 1e-7, -1e-7])
    assert report.accepted
    (said,) = report.notes
    assert said.startswith("every output is within its tolerance in each of 3 runs; ")
    assert "outputs have other bits in another run, 0.0" in said and "(motion/" in said
    assert called(golden, tmp_path, [0.0]).notes == [
        "every output is within its tolerance in each of 3 runs; all runs have the same bits"
    ]


@pytest.mark.parametrize("sizes", [[0.0, 0.0, 1e-3], [1e-3, 0.0, 0.0]])
def test_one_wrong_run_of_three_refuses_the_port(golden, tmp_path, sizes):
    report = called(golden, tmp_path, sizes)
    assert not report.accepted and report.first_wrong == "motion"
    assert f"1 of 3 runs are wrong ({sizes.index(1e-3) + 1})" in report.notes[-1]


def test_a_run_that_fails_takes_the_claim(golden, tmp_path):
    report = called(golden, tmp_path, "[0.0, None]", runs=2)
    assert report.failures == ["run 2: the port ended with code 1"] and "2 runs are wrong (2)" in report.notes[-1]


def test_what_cannot_be_asked_is_refused(golden, tmp_path):
    for number in (0, 1001):
        with pytest.raises(InputError, match=f"--runs {number}; use 1 to 1000"):
            called(golden, tmp_path, [0.0], runs=number)
    for seconds in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match=r"--timeout .*; use seconds above 0"):
            called(golden, tmp_path, [0.0], timeout=seconds)
    assert not (tmp_path / "kept").exists()
    with pytest.raises(InputError, match="level 5 asks for the same bits"):
        called_often(golden, "p {requests} {outputs}", tmp_path, "float32", runs=2, level=5)


def test_the_seconds_are_those_of_every_run(golden, tmp_path, monkeypatch):
    """Before, they were those of the first run."""
    for module in (call, runs):
        monkeypatch.setattr(module, "run_port", lambda *words: time.sleep(0.1) or "")
    assert called(golden, tmp_path, [0.0]).seconds >= 0.3


@pytest.mark.parametrize(
    ("name", "share", "said"),
    [
        ("a/b/c", 0.0, "0 of the tolerance at most (a/b/c)"),  # two zeros of other signs: before, the place was empty
        ("density/full/count", float("inf"), "other bits in another run, a decision differs (density/full/count)"),
    ],
)
def test_a_difference_of_bits_has_its_size_and_place(name, share, said):
    spread = joined(RunDifference(frozenset(), 0.0, ""), RunDifference(frozenset({name}), share, name))
    assert lines(2, [], spread)[0].endswith(said)


def test_the_program_of_the_judge_has_the_option(tmp_path, capsys):
    words = ["run", "--port", racing(tmp_path, [0.0, 1e-3]), "--runs", "2", "--level", "2", "--only", "motion"]
    assert main(words) == 1
    assert "1 of 2 runs are wrong (2)" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--json", "--html", "--certificate", "--badge"])
def test_a_file_that_cannot_be_written_is_refused_before_the_port_runs(tmp_path, capsys, option):
    words = ["run", "--port", racing(tmp_path, [0.0]), "--level", "1", "--only", "motion", option]
    assert main([*words, str(tmp_path / "none" / "file")]) == 2 and main([*words, str(tmp_path)]) == 2
    assert "cannot be written" in capsys.readouterr().err and not (tmp_path / "count").exists()
