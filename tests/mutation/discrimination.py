"""Run every suite on every mutant of every kernel and write docs/results/discrimination.json.

    python tests/mutation/discrimination.py [--jobs 2] [--only losses.similarity] [--sample 20] [--minutes 30]
                                            [--keep FOLDER] [--survivors]

--only    kernels whose name starts with this; may be given several times
--sample  at most this number of mutants of a kernel, evenly spread
--survivors   only what survived the run in the JSON file and is not listed as equivalent, what is not in the file, and
              what was detected by a check that is gone; the file is brought up to date (a run that is cut short by
              --minutes is continued so); --sample then chooses among what is not in the file
The page docs/discrimination.md is made from the result by tests/mutation/page.py.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

os.environ["NUMBA_DISABLE_JIT"] = "1"
os.environ["HYPOTHESIS_PROFILE"] = "ci"  # the same examples for every mutant
ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

import pytest  # noqa: E402

from endotsr.training.runs.machine import machine, now, versions  # noqa: E402
from mutation.checks import COLLECTING, SLOW, SUITES, Check, run  # noqa: E402
from mutation.equivalents import reasons  # noqa: E402
from mutation.kernels import kernels, planted  # noqa: E402
from mutation.merge import added, names, of_today, still_checked, survivors, whole  # noqa: E402
from mutation.mutator import Mutant, in_place, mutants  # noqa: E402
from mutation.processes import Outcome, in_processes  # noqa: E402
from mutation.registry import DEFECT, defect_mutants  # noqa: E402
from mutation.survey import Checks  # noqa: E402

FOLDERS = (
    "method/kernels/test_exponential.py",
    "method/kernels/test_gather.py",
    "method/kernels/test_sums.py",
    "definition",
    "method/equations",
    "method/splatting",
    "method/losses",
    "training/scene",
    "training/fitting",
    "hard",
    "properties",
    "port/checker/test_ranges.py",
    "port/checker/pieces_without_compiler.py",
)
FIRST = {"gradcheck": 4.0}  # s of checks of one suite; 1 s of the others
LATER = 30.0  # s of further checks for a mutant that no suite has detected and that is not listed as equivalent


def examine(mutant: Mutant, function, checks: Checks) -> Outcome:
    """Run every suite until its first check that detects the mutant; the remaining checks only if no suite did."""
    facts: dict[str, Any] = {}
    later: list[tuple[str, Check]] = []
    killed = dict.fromkeys(SUITES, "")
    with in_place(function, mutant.code):
        for suite in SUITES:
            spent = 0.0
            for check in checks.of(mutant.kernel, suite):
                if spent > FIRST.get(suite, 1.0):
                    later.append((suite, check))
                    continue
                spent += check.seconds
                if run(check, 2 + 10 * check.seconds, facts):
                    killed[suite] = check.name
                    break
        if not any(killed.values()) and mutant.name not in reasons():
            spent = 0.0
            for suite, check in sorted(later, key=lambda entry: entry[1].seconds):  # as many as there is time for
                spent += check.seconds
                if spent > LATER:
                    break
                if run(check, 2 + 10 * check.seconds, facts):
                    killed[suite] = check.name
                    break
    return Outcome(killed, facts.get("change"))


def every(found: list[Mutant], sample: int) -> list[Mutant]:
    """At most `sample` of them, evenly spread; 0 = all."""
    if not sample or len(found) <= sample:
        return found
    return [found[k * len(found) // sample] for k in range(sample)]


class Plugin:
    """Collects the tests as pytest does, then runs them on the mutants instead of once."""

    def __init__(self, options: argparse.Namespace):
        self.options, self.begin = options, time.monotonic()
        self.result: dict[str, Any] = {}
        self.before = json.loads(options.json.read_text(encoding="utf-8")) if options.survivors else {}

    def say(self, text: str) -> None:
        print(f"{time.monotonic() - self.begin:7.0f} s  {text}", flush=True)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of pytest's own loop."""
        if session.testsfailed:
            raise session.Interrupted(f"{session.testsfailed} files of tests could not be read: nothing is examined")
        functions = kernels() | planted()
        wanted = [k for k in kernels() if not self.options.only or k.startswith(tuple(self.options.only))]
        chosen = [d for d in defect_mutants(functions) if not self.options.only or d.kernel in wanted]
        groups = [every(mutants(k, functions[k]), self.options.sample) for k in wanted]
        chosen += [m for row in zip_longest(*groups) for m in row if m is not None]  # so that a stop is fair to all
        checks = Checks(session.items, self.options.keep, self.say)
        if self.options.survivors:
            self.before = still_checked(
                of_today(self.before, functions), {c.name for c in checks.all} | set(checks.left_out)
            )
            old, there = survivors(self.before), names(self.before)
            chosen = [m for m in chosen if m.name not in there]
            chosen += [m for k in wanted for m in mutants(k, functions[k]) if m.name in old]
        self.say(f"{len(chosen)} mutants of {len(wanted)} functions")
        work = [(m, partial(examine, m, functions[m.kernel], checks)) for m in chosen]
        outcomes: dict[str, Outcome] = {}
        for mutant, outcome in in_processes(work, self.options.jobs):
            outcomes[mutant.name] = outcome
            checks.learn(mutant.kernel, outcome)
            if not any(outcome.killed.values()):
                self.say(f"survivor: {mutant.name}")
            if len(outcomes) % 100 == 0:
                self.say(f"{len(outcomes)} of {len(chosen)}")
            if self.options.minutes and time.monotonic() - self.begin > 60 * self.options.minutes:
                break
        chosen = [m for m in chosen if m.name in outcomes]
        alarms = self.false_alarms(outcomes, checks)
        outcomes = {name: _without(outcome, alarms) for name, outcome in outcomes.items()}
        self.result = self.report(chosen, outcomes, checks) | {"false_alarms": sorted(alarms)}
        if self.options.survivors:
            self.result = added(self.before, self.result)
            if whole(self.result, kernels()):
                self.result["run"] |= {"sample": 0, "minutes": 0.0}
        return True

    def false_alarms(self, outcomes: dict[str, Outcome], checks: Checks) -> set[str]:
        """Checks that detected a mutant but also fail with the right kernels."""
        used = {name for outcome in outcomes.values() for name in outcome.killed.values() if name}
        work = [(Mutant("", "", c.name, kernels.__code__), partial(_alone, c)) for c in checks.all if c.name in used]
        return {m.name for m, outcome in in_processes(work, self.options.jobs) if any(outcome.killed.values())}

    def report(self, chosen: list[Mutant], outcomes: dict[str, Outcome], checks: Checks) -> dict[str, Any]:
        """The report, with checks by number so that the file stays small."""
        number = {c.name: k for k, c in enumerate(checks.all)} | {"": -1}
        by_kernel: dict[str, dict[str, Any]] = {}
        defects: dict[str, Any] = {}
        for mutant in chosen:
            killed, change = outcomes[mutant.name]
            found = [number.get(killed[suite], -2) for suite in SUITES]
            if mutant.kind == DEFECT:
                defects[mutant.name] = [mutant.kernel, found]
            else:
                by_kernel.setdefault(mutant.kernel, {})[mutant.name] = [mutant.kind, found, change]
        commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True)
        about = {
            "commit": commit.stdout.strip(), "finished": now(), "seconds": round(time.monotonic() - self.begin),
            "jobs": self.options.jobs, "sample": self.options.sample, "minutes": self.options.minutes, "slow": SLOW,
            "machine": machine(), "versions": versions(),
        }  # fmt: skip
        names = [c.name for c in checks.all]
        return {
            "run": about, "suites": SUITES, "checks": names, "left_out": checks.left_out, "defects": defects,
            "kernels": by_kernel,
        }  # fmt: skip


def _alone(check: Check) -> Outcome:
    """The check with the right kernels."""
    return Outcome({check.suite: run(check, 2 + 10 * check.seconds, {})}, None)


def _without(outcome: Outcome, alarms: set[str]) -> Outcome:
    return outcome._replace(killed={s: "" if name in alarms else name for s, name in outcome.killed.items()})


def written(result: dict[str, Any]) -> str:
    """JSON with one line a mutant."""
    head = {key: value for key, value in result.items() if key != "kernels"}
    lines = [f"{json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
    blocks = []
    for kernel, found in result["kernels"].items():
        inner = ",\n".join(f"{json.dumps(name, ensure_ascii=False)}: {json.dumps(row)}" for name, row in found.items())
        blocks.append(f"{json.dumps(kernel)}: {{\n{inner}\n}}")
    return "{\n" + "\n".join(lines) + '\n"kernels": {\n' + ",\n".join(blocks) + "\n}\n}\n"


def main(words: list[str]) -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder that keeps what was measured with the right kernels")
    parser.add_argument("--minutes", type=float, default=0.0, help="stop after so long, 0 = never")
    parser.add_argument("--survivors", action="store_true", help="bring the JSON file up to date")
    parser.add_argument("--tests", nargs="+", default=FOLDERS, help="folders and files of tests")
    parser.add_argument("--json", type=Path, default=ROOT / "docs/results/discrimination.json")
    options = parser.parse_args(words)
    if options.keep:
        options.keep.mkdir(parents=True, exist_ok=True)  # now, not after the first quarter of an hour
    plugin = Plugin(options)
    folders = [str(ROOT / "tests" / name) for name in options.tests]
    if missing := [name for name in folders if not Path(name).exists()]:
        parser.error(f"--tests: no such folder or file: {', '.join(missing)}")
    pytest.main([f"--rootdir={ROOT}", *COLLECTING, *folders], plugins=[plugin])
    if not plugin.result:
        return 1
    options.json.write_text(written(plugin.result), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
