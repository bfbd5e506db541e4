"""Commands set the number of threads of the process; the tests after them get back what was there."""

import numba
import pytest
from tiny import train_words

from endotsr.cli.main import main


@pytest.fixture(autouse=True)
def threads_as_before():
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory):
    """A tiny run, trained to the end and evaluated. Tests only read it."""
    out = tmp_path_factory.mktemp("finished") / "run"
    assert main(train_words(out)) == 0
    return out
