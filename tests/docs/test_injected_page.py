"""docs/guides/port.md: its table of injected mistakes is what the committed measurement says."""

import importlib

import pytest

made = importlib.import_module("pages.ports.injected")


def test_right_ports_pass_and_at_least_15_of_16_mistakes_are_named():
    outcomes = made.PROGRAM.read()["outcomes"]
    mistakes = [o for o in outcomes if o["flag"]]
    assert len(mistakes) >= 80 and {o["port"] for o in mistakes} == set(made.PORTS)
    assert 16 * sum(o["named"][:1] == [o["flag"]] for o in mistakes) >= 15 * len(mistakes)
    assert all(o["refused"] == 0 and not o["named"] for o in outcomes if not o["flag"])


@pytest.mark.parametrize(
    "named, likeliest, says",
    [
        (["other", "flag"], "other", "names `other`, which changes the same outputs; it is named second"),
        ([], "flag", "puts it first among the candidates and names none: 2 of 5"),
        ([], "other", "names none; `other` comes first"),
    ],
)
def test_a_mistake_that_is_not_named_has_its_reason(named, likeliest, says):
    outcome = {
        "port": "c99", "flag": "flag", "named": named, "refused": 5, "likeliest": likeliest, "agrees": 2, "differs": 3,
    }  # fmt: skip
    right = outcome | {"flag": "", "refused": 0, "named": []}
    about = {"golden": "3.0.0", "seconds": 60.0, "machine": {"processor": "x", "cores": 2}, "date": "2026-11-23"}
    found = {**about, "outcomes": [outcome, right]}
    parts = made.fragments(found)
    assert says in parts["missed"] and "| together | 1 | 0 |" in parts["counts"]
    assert "Of the 1 right ports, 1 pass" in parts["counts"]
