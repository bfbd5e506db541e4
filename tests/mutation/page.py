"""Make docs/discrimination.md from docs/results/discrimination.json: python tests/mutation/page.py"""

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from mutation.equivalents import EQUIVALENT, reasons  # noqa: E402

RESULT = ROOT / "docs/results/discrimination.json"
PAGE = ROOT / "docs/discrimination.md"
CHANGED = 1e-6


class Row(NamedTuple):
    """One mutant of the report."""

    kernel: str
    name: str
    kind: str
    suites: tuple[str, ...]  # those that detected it
    change: float | None
    equivalent: bool


def rows(result: dict[str, Any]) -> list[Row]:
    """The mutants of the report, those declared equivalent marked."""
    known, suites = reasons(), result["suites"]
    return [
        Row(kernel, name, kind, tuple(s for s, c in zip(suites, found) if c >= 0), change, name in known)
        for kernel, mutants in result["kernels"].items()
        for name, (kind, found, change) in mutants.items()
    ]


def cells(found: list[Row], suites: Iterable[str]) -> list[str]:
    """Numbers of mutants: all, detected by each suite, detected by any, equivalent, survivors."""
    each = [sum(s in r.suites for r in found) for s in suites]
    alive = [r for r in found if not r.suites and not r.equivalent]
    numbers = [len(found), *each, sum(bool(r.suites) for r in found), sum(r.equivalent for r in found), len(alive)]
    return [str(n) for n in numbers]


def table(title: str, groups: dict[str, list[Row]], suites: list[str]) -> list[str]:
    """One line a group."""
    head = [title, "mutants", *suites, "any", "equivalent", "survivors"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return lines + ["| " + " | ".join([f"`{name}`", *cells(g, suites)]) + " |" for name, g in groups.items()]


def grouped(found: list[Row], key) -> dict[str, list[Row]]:
    """Rows by key, in order of appearance."""
    out: dict[str, list[Row]] = {}
    for row in found:
        out.setdefault(key(row), []).append(row)
    return out


def defects(result: dict[str, Any]) -> list[str]:
    """The suites that detect each named defect."""
    suites = result["suites"]
    lines = ["| defect | function | " + " | ".join(suites) + " |", "|---" * (2 + len(suites)) + "|"]
    for name, (kernel, found) in result["defects"].items():
        marks = ["yes" if c >= 0 else "-" for c in found]
        lines.append(f"| {name} | `{kernel}` | " + " | ".join(marks) + " |")
    return lines


def reverse_part(found: list[Row]) -> list[str]:
    """The mutants that change a gradient, and how many of them the gradient checks alone detect."""
    changing = [r for r in found if r.change is not None and r.change > CHANGED and not r.equivalent]
    missed = [r for r in changing if "gradcheck" not in r.suites]
    lines = [
        f"Of the mutants that only the reverse pass runs, {len(changing)} change the gradient of some input by more "
        f"than {CHANGED:g} of its norm; the gradient checks alone detect {len(changing) - len(missed)} of them."
    ]
    return lines + ["", *(f"- {r.name}" for r in missed)] if missed else lines


def page(result: dict[str, Any]) -> str:
    """The whole page."""
    suites, found, run = result["suites"], rows(result), result["run"]
    alive = [r for r in found if not r.suites and not r.equivalent]
    sample = f", at most {run['sample']} a function, evenly spread over its source" if run["sample"] else ""
    sample += f", as many as {run['minutes']:g} minutes allow" if run["minutes"] else ""
    machine = run["machine"]
    later = run.get("again", [])
    again = ""
    if later:
        sample = sample.replace("at most", "at first at most")
        again = f" Survivors and new mutants were tested again with the tests of {later[-1]['commit']}"
        again += f" ({sum(r['seconds'] for r in later) / 60:.0f} minutes more)."
    lines = [
        "# What the tests can tell apart",
        "",
        "Every function of the numerical modules is changed in one place at a time: another operator, a dropped term "
        "or statement, another constant, a shifted index, a flipped comparison, sign or branch, sine for cosine, "
        "smallest for largest. Five suites test each wrong version (mutant). A suite detects a mutant when one of its "
        "checks fails, raises or does not end.",
        "",
        "- `gradcheck`: the public checker on the registered pairs. A mutant that only the reverse pass runs is "
        "compared with the differences of the correct forward pass, along every line of the checker. Any other mutant "
        "is compared along two joint lines, and along two lines of every block where the forward pass is fast.",
        "- `oracle`: tests that compare with an independent formula or library.",
        "- `golden`: the reference against the stored answers of `golden/`, both paths in float64, the definition in "
        "float32.",
        "- `hard`: the tests named after the catalogue of hard cases.",
        "- `properties`: all other tests of the numerical modules.",
        "",
        f"{run['finished'][:10]}, revision {run['commit']}; {len(found)} mutants of {len(result['kernels'])} functions"
        f"{sample}; {run['seconds'] / 60:.0f} minutes with {run['jobs']} process(es) on {machine['processor']} "
        f"({machine['cores']} cores). Made by `python tests/mutation/discrimination.py"
        f"{' --sample ' + str(run['sample']) if run['sample'] else ''}"
        f"{' --minutes ' + format(run['minutes'], 'g') if run['minutes'] else ''}`. "
        f"The kernels run as plain Python here. Checks that take longer than {run['slow']:g} s that way are left out "
        f"({len(result['left_out'])} of {len(result['left_out']) + len(result['checks'])}), so a suite may detect more "
        f"mutants than are counted.{again}",
        "",
        "## Summary",
        "",
        *table("module", {"all": found} | grouped(found, lambda r: r.kernel.rsplit(".", 1)[0]), suites),
        "",
        "## By kind of change",
        "",
        *table("kind", grouped(found, lambda r: r.kind), suites),
        "",
        "## Named defects",
        "",
        "Each is a mistake that ports or published programs have made, put into the source on purpose.",
        "",
        *defects(result),
        "",
        "## Reverse passes",
        "",
        *reverse_part(found),
        "",
        "## Survivors",
        "",
        *([f"- {r.name}" for r in alive] or ["None."]),
        "",
        "## Equivalent mutants",
        "",
        "These mutants compute the same results, or differ only in values on which no result depends.",
        "",
    ]
    tested = {r.name for r in found if r.equivalent}
    for group in EQUIVALENT:
        names = [n for n in group.names if n in tested]
        if names:
            lines += [f"**{group.reason}**", "", *(f"- {n}" for n in names), ""]
    lines += ["## Every function", "", *table("function", grouped(found, lambda r: r.kernel), suites), ""]
    return "\n".join(lines)


def main() -> None:
    """The command."""
    PAGE.write_text(page(json.loads(RESULT.read_text(encoding="utf-8"))), encoding="utf-8")


if __name__ == "__main__":
    main()
