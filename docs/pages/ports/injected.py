"""Rates at which the judge names mistakes: the table of docs/guides/port.md.

The counts are those of `python tests/port/injected/inject.py --json docs/results/injected.json`.
"""

from typing import Any

from endotsr.results.report.tables import markdown
from pages.store.program import Program
from pages.store.tables import noted, where_with_cores

PORTS = {
    "c99": "in C99",
    "reference": "the reference itself, float32",
    "torch": "by automatic differentiation",
}


def fragments(result: dict[str, Any]) -> dict[str, str]:
    """Counts by port, and every unnamed mistake with the reason."""
    mistakes = [o for o in result["outcomes"] if o["flag"]]
    rows = [(title, str(len(of)), str(sum(map(_right, of)))) for name, title in PORTS.items()
            if (of := [o for o in mistakes if o["port"] == name])]  # fmt: skip
    rows.append(("together", str(len(mistakes)), str(sum(map(_right, mistakes)))))
    missed = [(f"`{o['flag']}`", PORTS[o["port"]], _reason(o)) for o in mistakes if not _right(o)]
    right_ports = [o for o in result["outcomes"] if not o["flag"]]
    clean = sum(not o["refused"] and not o["named"] for o in right_ports)
    note = (
        f"Version {result['golden']} ({where_with_cores(result)}). Of the "
        f"{len(right_ports)} right ports, {clean} pass with no mistake named."
    )
    counts = noted(("Port", "Single mistakes", "Named rightly"), rows, note)
    return {"counts": counts, "missed": markdown(("Mistake", "Port", "What the report says"), missed)}


def _right(outcome: dict[str, Any]) -> bool:
    return outcome["named"][:1] == [outcome["flag"]]


def _reason(outcome: dict[str, Any]) -> str:
    """The content of the report instead."""
    others = [flag for flag in outcome["named"] if flag != outcome["flag"]]
    if others:
        second = "; it is named second" if outcome["named"][1:2] == [outcome["flag"]] else ""
        return f"names `{others[0]}`, which changes the same outputs{second}"
    if outcome["likeliest"] == outcome["flag"]:
        return (
            f"puts it first among the candidates and names none: {outcome['agrees']} of {outcome['refused']} refused "
            f"outputs have its values, {outcome['differs']} have others"
        )
    if not outcome["likeliest"]:
        return "refuses it and names none"
    return f"names none; `{outcome['likeliest']}` comes first"


PROGRAM = Program(__name__, "guides/port.md", fragments, "injected.json")
