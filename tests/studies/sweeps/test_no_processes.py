"""A system without semaphores, such as one whose /dev/shm cannot be written: runs follow one another in one process."""

import errno
import multiprocessing
import signal

import pytest

from endotsr.studies.sweeps import local
from endotsr.studies.sweeps.execute import FINISHED, INTERRUPTED, Outcome
from endotsr.training.runs.stopping import stop_asked

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")


class Refusing:
    """A context of processes that cannot create a lock."""

    def Lock(self):
        raise OSError(errno.EROFS, "Read-only file system")


@pytest.fixture
def without(monkeypatch):
    monkeypatch.setattr(multiprocessing, "get_context", lambda method: Refusing())


def test_the_runs_follow_one_another_with_a_line(without, monkeypatch, capsys):
    threads = []
    monkeypatch.setattr(local, "execute", lambda job, n: (threads.append(n), Outcome("run", FINISHED))[1])
    found = [outcome for outcome in local.local_outcomes([object()] * 3, 2, 1) if outcome is not None]
    assert [outcome.status for outcome in found] == [FINISHED] * 3 and threads == [2, 2, 2]
    said = capsys.readouterr().out
    assert "one run at a time in this process" in said and "/dev/shm, Read-only file system" in said


def test_a_signal_stops_them(without, monkeypatch):
    def interrupted(job, threads):
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        return Outcome("run", INTERRUPTED)

    monkeypatch.setattr(local, "execute", interrupted)
    found = []
    with pytest.raises(KeyboardInterrupt):
        found.extend(outcome for outcome in local.local_outcomes([object()] * 3, 1, 1) if outcome is not None)
    assert len(found) <= 1
    assert not stop_asked(), "the next training in this process would stop at once"


def test_here_processes_can_be_used():
    assert local.no_processes() == ""
