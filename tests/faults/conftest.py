"""Runs and folders that a test may spoil; the helpers of the command-line tests are importable."""

import shutil
import sys
from pathlib import Path

import numba
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "cli"))

from tiny import train_words, written_folder

from endotsr.cli.main import main


@pytest.fixture(autouse=True)
def threads_as_before():
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.fixture(scope="session")
def trained(tmp_path_factory):
    """A tiny run of 30 iterations on the simulated sequence, not evaluated. Tests only read it."""
    out = tmp_path_factory.mktemp("trained") / "run"
    assert main(train_words(out, "--no-evaluate")) == 0
    return out


@pytest.fixture
def run(trained, tmp_path):
    """A copy of the tiny run that a test may spoil."""
    shutil.copytree(trained, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture(scope="session")
def written(tmp_path_factory):
    """A tiny EndoNeRF folder. Tests only read it."""
    return written_folder(tmp_path_factory.mktemp("written"))


@pytest.fixture
def folder(written, tmp_path):
    """A copy of the tiny EndoNeRF folder that a test may spoil."""
    shutil.copytree(written, tmp_path / "sequence")
    return tmp_path / "sequence"
