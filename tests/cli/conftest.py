"""Commands set the number of threads of the process; the tests after them get back what was there.

Checkpoints are written by iterations alone, so that no test depends on the speed of the machine.
"""

import shutil

import numba
import pytest
from tiny import train_words

from endotsr.cli.main import main


@pytest.fixture(autouse=True)
def threads_as_before():
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.fixture(autouse=True)
def checkpoints_by_iterations(monkeypatch):
    monkeypatch.setattr("endotsr.training.runs.training.seconds_between", lambda *_: float("inf"))


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory):
    """A tiny run, trained to the end and evaluated. Tests only read it."""
    out = tmp_path_factory.mktemp("finished") / "run"
    assert main(train_words(out)) == 0
    return out


@pytest.fixture
def run_copy(finished_run, tmp_path):
    """A copy of the finished run that a test may change."""
    return shutil.copytree(finished_run, tmp_path / "run")
