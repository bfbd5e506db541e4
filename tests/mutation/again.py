"""Run the checks that detected some mutants of the last report again: python tests/mutation/again.py COUNT

Prints the names of those that are no longer detected; the exit status is their number. Gradient checks are left
out, because their differences take long. All named defects are among the mutants.
"""

import json
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

os.environ["NUMBA_DISABLE_JIT"] = "1"
os.environ["HYPOTHESIS_PROFILE"] = "ci"  # the same examples for every mutant
ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

import pytest  # noqa: E402

from endotsr.port.judge.store import golden_folder, read_golden  # noqa: E402
from mutation.checks import COLLECTING, SLOW, SUITES, Check, of_case, of_item, run  # noqa: E402
from mutation.kernels import kernels, planted  # noqa: E402
from mutation.mutator import Mutant, in_place, mutants  # noqa: E402
from mutation.processes import Outcome, in_processes  # noqa: E402
from mutation.registry import defect_mutants  # noqa: E402

RESULT = ROOT / "docs/results/discrimination.json"


def noticed_by(result: dict[str, Any], found: list[int]) -> list[str]:
    """Names of the checks of a row, gradient checks left out."""
    return [result["checks"][k] for suite, k in zip(result["suites"], found) if k >= 0 and suite != "gradcheck"]


def chosen(result: dict[str, Any], count: int, functions: dict) -> list[tuple[Mutant, list[str]]]:
    """All defects, and mutants of the report that today's source still has, evenly spread."""
    out = [(d, noticed_by(result, result["defects"][d.name][1])) for d in defect_mutants(functions)]
    rows = [(k, n, noticed_by(result, row[1])) for k, found in result["kernels"].items() for n, row in found.items()]
    rows = [row for row in rows if row[2] and row[0] in functions]
    for kernel, name, checks in (rows[k * len(rows) // count] for k in range(min(count, len(rows)))):
        out += [(m, checks) for m in mutants(kernel, functions[kernel]) if m.name == name]
    return [(mutant, checks) for mutant, checks in out if checks]


def examine(mutant: Mutant, function, checks: list[Check]) -> Outcome:
    """Whether one of the checks detects the mutant."""
    with in_place(function, mutant.code):
        seen = next((c.name for c in checks if run(c, 10 * SLOW, {})), "")
    return Outcome(dict.fromkeys(SUITES, seen), None)


class Plugin:
    """Collects the tests as pytest does, then runs the chosen mutants."""

    def __init__(self, count: int):
        self.count, self.missed = count, ["nothing was run"]

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of pytest's own loop."""
        functions = kernels() | planted()
        golden = read_golden(golden_folder())
        cases = [check for case in golden.cases for check in of_case(golden, case)]
        checks = {c.name: c for c in cases + [of_item(item) for item in session.items]}
        result = json.loads(RESULT.read_text(encoding="utf-8"))
        work = []
        for mutant, names in chosen(result, self.count, functions):
            known = [checks[name] for name in names if name in checks]
            work.append((mutant, partial(examine, mutant, functions[mutant.kernel], known)))
        self.missed = [m.name for m, outcome in in_processes(work, 1) if not any(outcome.killed.values())]
        print(f"{len(work)} mutants, {len(self.missed)} not noticed")
        return True


def main(count: int) -> int:
    """The command."""
    plugin = Plugin(count)
    result = json.loads(RESULT.read_text(encoding="utf-8"))
    files = {name.split("::")[0] for name in result["checks"] if name.startswith("tests/")}
    pytest.main([f"--rootdir={ROOT}", *COLLECTING, *(str(ROOT / f) for f in sorted(files))], plugins=[plugin])
    print("\n".join(plugin.missed))
    return len(plugin.missed)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
