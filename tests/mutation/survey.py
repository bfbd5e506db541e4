"""Measurements with the right kernels before any mutant runs: differences, times, and the kernels of each check."""

import json
import os
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from endotsr.method.kernels.kernel_cache import kernel_source_hash
from endotsr.port.gradcheck import all_pairs
from endotsr.port.judge.store import golden_folder, read_golden
from mutation.checks import BLOCKS, Check, forward_only, of_case, of_item, of_pair, surveyed
from mutation.kernels import clear_caches, kernels, planted
from mutation.processes import Outcome

ROOT = Path(__file__).parents[2]


def recorded_pairs(keep: Path | None) -> dict[str, Any]:
    """Finite differences of the right kernels, taken in a process where they are compiled."""
    with tempfile.TemporaryDirectory() as folder:
        target = (keep or Path(folder)) / f"recorded-{kernel_source_hash()}.pickle"
        if not target.is_file():
            environment = {k: v for k, v in os.environ.items() if k != "NUMBA_DISABLE_JIT"}
            subprocess.run([sys.executable, ROOT / "tests/mutation/recording.py", target], env=environment, check=True)
        return pickle.loads(target.read_bytes())


class Survey:
    """Time and kernels of the checks, kept in a file so that a second run need not measure them again."""

    def __init__(self, keep: Path | None):
        path = self.path = keep / f"survey-{kernel_source_hash()}.json" if keep else None
        self.known: dict[str, Any] = json.loads(path.read_text()) if path and path.is_file() else {}
        self.written = time.monotonic()

    def of(self, check: Check, codes: dict) -> Check | str:
        if check.name not in self.known:
            found = surveyed(check, codes)
            done = found if isinstance(found, str) else [found.seconds, sorted(found.kernels)]
            self.known[check.name] = done
            if time.monotonic() > self.written + 20:
                self.write()
        done = self.known[check.name]
        return done if isinstance(done, str) else check._replace(seconds=done[0], kernels=frozenset(done[1]))

    def write(self) -> None:
        if self.path:
            self.path.write_text(json.dumps(self.known))
        self.written = time.monotonic()


class Checks:
    """All checks by the kernel they run, the best first."""

    def __init__(self, items: list, keep: Path | None, say):
        codes = {function.__code__: name for name, function in (kernels() | planted()).items()}
        self.left_out: dict[str, str] = {}
        self.all: list[Check] = []
        recorded, golden = recorded_pairs(keep), read_golden(golden_folder())
        say("finite differences taken")
        for pair in all_pairs().values():
            forward = surveyed(forward_only(pair, recorded[pair.name]), codes, 30.0)
            assert isinstance(forward, Check), (pair.name, forward)
            quick = forward.seconds < BLOCKS
            cost = (200 if quick else 20) * forward.seconds
            reverse, differentiate = of_pair(pair, recorded[pair.name], quick)
            whole = surveyed(reverse, codes, 30.0)
            assert isinstance(whole, Check), (pair.name, whole)
            self.all.append(whole._replace(kernels=whole.kernels - forward.kernels))
            self.all.append(differentiate._replace(kernels=forward.kernels, seconds=cost))
        candidates = [c for case in golden.cases for c in of_case(golden, case)] + [of_item(i) for i in items]
        known = Survey(keep)
        for check in candidates:
            found = known.of(check, codes)
            if isinstance(found, str):
                self.left_out[check.name] = found
            else:
                self.all.append(found)
        known.write()
        clear_caches()
        say(f"{len(self.all)} checks, {len(self.left_out)} left out")
        self.kills: dict[tuple[str, str], int] = {}

    def of(self, kernel: str, suite: str) -> list[Check]:
        found = [c for c in self.all if c.suite == suite and kernel in c.kernels]
        return sorted(found, key=lambda c: (c.seconds + 1e-3) / (1 + self.kills.get((kernel, c.name), 0)))

    def learn(self, kernel: str, outcome: Outcome) -> None:
        for name in filter(None, outcome.killed.values()):
            self.kills[kernel, name] = self.kills.get((kernel, name), 0) + 1
