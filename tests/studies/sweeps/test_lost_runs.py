"""A run that kills its process does not take the runs beside it along: the third loss is counted of a run alone."""

from collections import Counter, deque
from concurrent.futures import Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, NamedTuple, cast

from endotsr.studies.sweeps import local
from endotsr.studies.sweeps.execute import FAILED, FINISHED, Outcome


class Run(NamedTuple):
    name: str


class Pool:
    """A pool that a run called `heavy` breaks; like that of Python, it then loses all its runs."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Run, Future[Outcome]]] = []

    def submit(self, work, job: Run, threads: int) -> Future[Outcome]:
        future: Future[Outcome] = Future()
        self.waiting.append((job, future))
        return future

    def work(self) -> None:
        broken = any(job.name == "heavy" for job, _ in self.waiting)
        for job, future in self.waiting:
            if broken:
                future.set_exception(BrokenProcessPool("a process ended"))
            else:
                future.set_result(Outcome(job.name, FINISHED))
        self.waiting.clear()


def outcomes(names: list[str], workers: int, monkeypatch) -> dict[str, Outcome]:
    waiting, losses, found = deque(map(Run, names)), Counter(), {}
    for _ in range(20):
        if not waiting:
            return found
        pool = Pool()
        monkeypatch.setattr(local, "wait", lambda *words, pool=pool: (pool.work(), wait(*words))[1])
        for outcome in local.until_broken(cast(Any, pool), cast(Any, waiting), losses, workers, 1):
            if outcome is not None:
                assert outcome.name not in found
                found[outcome.name] = outcome
    raise AssertionError(f"still waiting: {waiting}")


def test_a_run_beside_one_that_is_killed_three_times_is_finished(monkeypatch):
    for names in (["heavy", "a"], ["a", "heavy", "b", "c"], ["a", "b", "c", "heavy"]):
        found = outcomes(names, 3, monkeypatch)
        assert found.pop("heavy") == Outcome("heavy", FAILED, local.LOST)
        assert {name: outcome.status for name, outcome in found.items()} == dict.fromkeys(found, FINISHED)
        assert sorted([*found, "heavy"]) == sorted(names)
