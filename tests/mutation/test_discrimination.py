"""The report on mutants fits the current source, and its detections are reproduced."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mutation import checks
from mutation.equivalents import EQUIVALENT
from mutation.kernels import kernels, planted
from mutation.merge import added, names, of_today, still_checked, survivors, whole
from mutation.mutator import mutants
from mutation.page import PAGE, RESULT, page, rows
from mutation.registry import DEFECTS, defect_mutants

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def result():
    return json.loads(RESULT.read_text(encoding="utf-8"))


def test_every_equivalent_mutant_is_one_of_todays_source():
    listed = [name for group in EQUIVALENT for name in group.names]
    assert len(set(listed)) == len(listed)
    functions = kernels()
    named = {name.split(":", 1)[0] for name in listed}
    assert named <= functions.keys()
    today = {m.name for kernel in named for m in mutants(kernel, functions[kernel])}
    assert not set(listed) - today
    assert all(group.reason and group.names for group in EQUIVALENT)


def test_no_mutant_that_is_called_equivalent_was_noticed(result):
    assert not [r.name for r in rows(result) if r.equivalent and r.suites]


def test_every_named_defect_can_be_planted_and_is_noticed(result):
    assert len(defect_mutants(kernels() | planted())) == len(DEFECTS) >= 22
    assert result["defects"].keys() == {d.name for d in DEFECTS}
    for name, (_, found) in result["defects"].items():
        assert max(found) >= 0, name


def test_the_page_is_made_from_the_report(result):
    assert PAGE.read_text(encoding="utf-8") == page(result)
    found = rows(result)
    left_out = sum(row.equivalent for row in found)
    assert left_out and f" {left_out} more changes are judged equivalent" in " ".join(page(result)[:1000].split())


@pytest.mark.slow
def test_defects_and_a_sample_of_mutants_are_still_noticed():
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, str(ROOT / "tests/mutation/again.py"), "40"]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


def test_a_later_run_of_survivors_is_added_by_name():
    run = {"commit": "a", "finished": "1", "seconds": 1}
    early = {
        "run": run, "checks": ["x", "y"], "false_alarms": ["y"], "defects": {},
        "kernels": {"k": {"k: seen": ["sign", [0, -1], None], "k: alive": ["sign", [-1, -1], None]}},
    }  # fmt: skip
    assert survivors(early) == {"k: alive"}
    late = {
        "run": run | {"commit": "b"}, "checks": ["new", "x"], "false_alarms": [], "defects": {"d": ["k", [-1, 1]]},
        "kernels": {"k": {"k: alive": ["sign", [-1, 0], 0.5]}},
    }  # fmt: skip
    both = added(early, late)
    assert both["checks"] == ["x", "y", "new"] and both["run"]["again"][0]["commit"] == "b"
    assert both["kernels"]["k"] == {"k: seen": ["sign", [0, -1], None], "k: alive": ["sign", [-1, 2], 0.5]}
    assert both["defects"] == {"d": ["k", [-1, 0]]}
    assert survivors(both) == set() and survivors(early) == {"k: alive"}


@pytest.mark.slow
def test_what_the_source_no_longer_has_leaves_the_report(result):
    functions = kernels() | planted()
    kernel = "method.equations.matern.matern_weights"
    old = {"kernels": {"gone.away": {}, kernel: {f"{kernel}: gone": ["sign", [0], None]}}, "defects": {"gone": []}}
    assert of_today(old, functions) == {"kernels": {kernel: {}}, "defects": {}}
    today = of_today(result, functions)
    assert today["defects"] == result["defects"] and names(today) <= names(result)


def test_a_detection_by_a_check_that_is_gone_is_measured_again():
    seen = {"by both": ["sign", [0, 1], None], "by the one that stays": ["sign", [1, -1], None]}
    old = {"checks": ["gone", "stays"], "kernels": {"k": seen}, "defects": {"d": ["k", [0, -1]], "e": ["k", [-1, 1]]}}
    found = still_checked(old, ["stays", "new"])
    assert found["kernels"] == {"k": {"by the one that stays": ["sign", [1, -1], None]}}
    assert found["defects"] == {"e": ["k", [-1, 1]]} and found["checks"] == old["checks"]


def test_a_check_that_waits_for_another_process_ends(monkeypatch):
    monkeypatch.setattr(checks, "WAIT", 0.2)
    begin = time.monotonic()
    waiting = checks.Check("hard", "waits", lambda facts: time.sleep(30) or "")
    assert checks.run(waiting, 0.1, {}) == "out of time" and time.monotonic() < begin + 10


def test_a_report_is_whole_when_no_mutant_is_missing():
    kernel = "method.equations.matern.matern_weights"
    functions = {kernel: kernels()[kernel]}
    rows_of_all = {m.name: ["sign", [0], None] for m in mutants(kernel, functions[kernel])}
    assert whole({"kernels": {kernel: rows_of_all}, "defects": {}}, functions)
    rows_of_all.popitem()
    assert not whole({"kernels": {kernel: rows_of_all}, "defects": {}}, functions)
