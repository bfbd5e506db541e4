"""The list of everything that `endotsr check` can find: complete, used, and readable as a sentence."""

import ast
import re
from pathlib import Path

import pytest

from endotsr.clips import sequences
from endotsr.clips.sequences.checks.kinds import KINDS, finding, worst_first

SOURCES = [ast.parse(path.read_text(encoding="utf-8")) for path in Path(sequences.__path__[0]).rglob("*.py")]


def test_every_kind_can_be_found():
    calls = [node for tree in SOURCES for node in ast.walk(tree) if isinstance(node, ast.Call)]
    used = {
        argument.value
        for call in calls
        for argument in call.args[:2]
        if isinstance(argument, ast.Constant) and isinstance(argument.value, str)
    }
    assert set(KINDS) <= used | {f"{what}-files" for what in ("images", "masks", "depth")}


@pytest.mark.parametrize("code", KINDS)
def test_a_finding_reads_as_one_line(code):
    found = finding(code, Path("clip/images"), "something is wrong", 3)
    assert re.fullmatch(r"[a-z]+(-[a-z]+)*", code)
    assert found.line == f"clip/images, frame 3: something is wrong; {KINDS[code].why}; {KINDS[code].remedy}"
    named = finding(code, "clip/images", "clip/images: something is wrong")
    assert named.line == f"clip/images: something is wrong; {KINDS[code].why}; {KINDS[code].remedy}"
    assert not any(text.endswith(".") or "\n" in text for text in found[4:])


def test_worst_first_keeps_the_order_within_a_level():
    found = [finding(code, "x", "") for code in ("grey-pictures", "black-frame", "size", "white-frame")]
    assert [entry.code for entry in worst_first(found)] == ["size", "black-frame", "white-frame", "grey-pictures"]
