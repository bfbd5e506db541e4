"""Rates at which the judge recognises unlisted mistakes: part of docs/guides/port.md.

Two kinds of sets, which are not mixed: *blind* ones, written by somebody who has not seen the judge and judged once
(docs/results/blind_mistakes.json; protocol: tests/port/blind.py), and the set beside which the judge was developed,
whose counts are those of `python tests/port/unseen/by_hand/measure.py --record now`.
"""

from collections.abc import Callable
from typing import Any

from endotsr.results.report.tables import markdown
from pages.store.marks import read_json
from pages.store.program import RESULTS, Program
from pages.store.tables import noted, where_with_cores


def fragments(runs: dict[str, Any]) -> dict[str, str]:
    """The rates of every run of the record, with their intervals."""
    titles = {"before": "when the set was written", "now": "after development beside it"}
    names = [name for name in titles if name in runs]
    last = runs[names[-1]]
    rows = [(what, *(_share(runs[name]["rates"][what]) for name in names)) for what in last["rates"]]
    heads = ("Of mistakes that are on no list", *(titles[name] for name in names))
    note = f"Version {last['golden']}, {last['rates']['refused'][1]} mistakes, float64 ({where_with_cores(last)})."
    changed = read_json(RESULTS / "golden_mutants.json", "python tests/port/mutants/survey.py by_hand --apart")
    return {
        "rates": noted(heads, rows, note),
        "blind": blind_table(read_json(RESULTS / "blind_mistakes.json", "tests/port/blind.py")),
        "changed": changed_table(changed),
    }


def changed_table(found: dict[str, Any]) -> str:
    """The share of the wrong versions of the port by hand that some versions of the vectors refuse."""
    of = found["observable"]
    cells = [f"{count} of {of}: {100 * count / of:.1f} %" for count in found["refused"].values()]
    heads = ("Wrong versions of a port in NumPy", *(f"refused by {one}" for one in found["vectors"].values()))
    return markdown(heads, [(f"each in one place ({found['date']}, float64)", *cells)])


def blind_table(found: dict[str, Any]) -> str:
    """One row for each blind set: the share of its observable mistakes with each outcome, with Wilson's interval.

    A set on which the search was developed afterwards has a second row, of the judge after that: it is not blind.
    """
    from scipy import stats

    def share(count: int, of: int) -> str:
        low, high = stats.binomtest(count, of).proportion_ci(0.95, method="wilson")
        return f"{count} of {of}: {100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"

    heads = ("Blind set", "refused", "named rightly", "named rightly or placed", "wrongly named", "nothing useful")
    rows = []
    for one in found["sets"]:
        about = f"{one['date']}, version {one['golden']}, a port {one['port']}"
        rows.append((about, *_shares(one, one, share)))
        if "afterwards" in one:
            rows.append(("the same set, after the search was developed on it (not blind)",
                         *_shares(one, one["afterwards"], share)))  # fmt: skip
    return markdown(heads, rows)


def _shares(one: dict[str, Any], counted: dict[str, Any], share: Callable[[int, int], str]) -> list[str]:
    """The cells of a set: the share refused, then those of the outcomes among its observable mistakes."""
    named = counted["named"]
    counts = (named, named + counted["near"] + counted["placed"], counted["wrongly_named"], counted["nothing"])
    return [share(counted["refused"], one["mistakes"]), *(share(count, one["observable"]) for count in counts)]


def _share(rate: list[float]) -> str:
    """Per cent with the interval of 95 %."""
    good, of, low, high = rate
    return f"{100 * good / of:.1f} % ({100 * low:.0f} to {100 * high:.0f})"


PROGRAM = Program(__name__, "guides/port.md", fragments, "../../tests/port/unseen/by_hand/record.json")
