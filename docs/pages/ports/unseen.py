"""Rates at which the judge recognises unlisted mistakes: part of docs/guides/port.md, by

    python docs/make.py ports.unseen

Two kinds of sets, which are not mixed: *blind* ones, written by somebody who has not seen the judge and judged once
(docs/results/blind_mistakes.json; protocol: tests/port/blind.py), and the set beside which the judge was developed,
whose counts are those of `python tests/port/unseen/by_hand/measure.py --record now`.
"""

from pathlib import Path
from typing import Any

from endotsr.results.report.tables import markdown
from pages.effects.parts import machine
from pages.store.marks import read_json, write_marked

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "guides" / "port.md"
FILE = ROOT / "tests" / "port" / "unseen" / "by_hand" / "record.json"
BLIND = ROOT / "docs" / "results" / "blind_mistakes.json"
CHANGED = ROOT / "docs" / "results" / "golden_mutants.json"
MADE_BY = "python tests/port/unseen/by_hand/measure.py --record now"


def fragments(runs: dict[str, Any]) -> dict[str, str]:
    """The rates of every run of the record, with their intervals."""
    titles = {"before": "when the set was written", "now": "after development beside it"}
    names = [name for name in titles if name in runs]
    last = runs[names[-1]]
    rows = [(what, *(_share(runs[name]["rates"][what]) for name in names)) for what in last["rates"]]
    table = markdown(("Of mistakes that are on no list", *(titles[name] for name in names)), rows)
    note = f"Version {last['golden']}, {last['rates']['refused'][1]} mistakes, float64 ({machine(last)})."
    changed = read_json(CHANGED, "python tests/port/mutants/survey.py by_hand --apart")
    return {
        "rates": f"{table}\n\n{note}",
        "blind": blind_table(read_json(BLIND, "tests/port/blind.py")),
        "changed": changed_table(changed),
    }


def changed_table(found: dict[str, Any]) -> str:
    """The share of the wrong versions of the port by hand that some versions of the vectors refuse."""
    of = found["observable"]
    cells = [f"{count} of {of}: {100 * count / of:.1f} %" for count in found["refused"].values()]
    heads = ("Wrong versions of a port in NumPy", *(f"refused by {one}" for one in found["vectors"].values()))
    return markdown(heads, [(f"each in one place ({found['date']}, float64)", *cells)])


def blind_table(found: dict[str, Any]) -> str:
    """One row for each blind set: the share of its observable mistakes with each outcome, with Wilson's interval."""
    from scipy import stats

    def share(count: int, of: int) -> str:
        low, high = stats.binomtest(count, of).proportion_ci(0.95, method="wilson")
        return f"{count} of {of}: {100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"

    heads = ("Blind set", "refused", "named rightly", "named rightly or placed", "wrongly named", "nothing useful")
    rows = []
    for one in found["sets"]:
        seen = one["observable"]
        counts = (one["named"], one["named"] + one["near"] + one["placed"], one["wrongly_named"], one["nothing"])
        about = f"{one['date']}, version {one['golden']}, a port {one['port']}"
        rows.append((about, share(one["refused"], one["mistakes"]), *(share(count, seen) for count in counts)))
    return markdown(heads, rows)


def _share(rate: list[float]) -> str:
    """Per cent with the interval of 95 %."""
    good, of, low, high = rate
    return f"{100 * good / of:.1f} % ({100 * low:.0f} to {100 * high:.0f})"


def main(words: list[str]) -> None:
    """Write the part of the page; takes no words."""
    write_marked(PAGE, fragments(read_json(FILE, MADE_BY)), "unseen")
