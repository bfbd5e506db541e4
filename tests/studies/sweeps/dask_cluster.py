"""A real Dask scheduler with real worker processes."""

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path

from tiny_sweep import kill, wait_until


class Cluster:
    """A scheduler and its workers, each a process."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._processes = folder, []
        file = folder / "scheduler.json"
        self._start("scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
        wait_until(lambda: file.exists() and file.read_text().strip().endswith("}"))
        self.address = json.loads(file.read_text())["address"]

    def worker(self, name: str, *more: str, **environment: str) -> subprocess.Popen:
        """Start a worker."""
        words = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--name", name)
        local = ("--local-directory", str(self._folder / name))
        return self._start("worker", self.address, *words, *local, *more, **environment)

    def _start(self, kind: str, *words: str, **environment: str) -> subprocess.Popen:
        log = (self._folder / f"{kind}.log").open("ab")
        process = subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words],
            env=os.environ | {"MPLBACKEND": "Agg"} | environment,
            stdout=log,
            stderr=log,
        )
        self._processes.append(process)
        return process

    def end(self) -> None:
        """End all processes."""
        for process in self._processes:
            with contextlib.suppress(ProcessLookupError):
                kill(process)


def in_the_middle(pid: int, length: int) -> bool:
    """Whether a process trains a run that has a checkpoint and is not in the last third of its `length` iterations."""
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            log = link.readlink()
            if log.name == "log.jsonl" and (log.parent / "checkpoint.npz").exists():
                return 7 < len(log.read_text().splitlines()) < length * 2 // 3
    return False
