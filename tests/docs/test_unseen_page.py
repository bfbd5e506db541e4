"""docs/guides/port.md: its rates of mistakes on no list are what the committed record says."""

import importlib

from pages.store.marks import read_json, replaced

made = importlib.import_module("pages.ports.unseen")


def test_the_rates_are_those_of_the_record():
    text = made.PAGE.read_text(encoding="utf-8")
    parts = made.fragments(read_json(made.FILE, made.MADE_BY))
    assert replaced(text, parts, made.PAGE, "unseen") == text
