"""The page on one iteration names the holders of a frame; signatures and annotations say the same."""

import re
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, get_type_hints

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "one_iteration.md"
ROW = re.compile(r"^\| `(\w+)` \| `(endotsr[\w.]+)` \| `(\w+)` \|$", re.MULTILINE)
HOLDERS = ROW.findall(PAGE.read_text(encoding="utf-8"))
MOST = 4


def found(name: str) -> tuple[Any, FunctionType]:
    """The class of a method or None, and the function of this dotted name."""
    words = name.split(".")
    module: ModuleType = import_module(".".join(words[:-2] if words[-2][0].isupper() else words[:-1]))
    owner = getattr(module, words[-2]) if words[-2][0].isupper() else None
    return owner, getattr(owner or module, words[-1])


def inputs(owner: Any, function: FunctionType) -> set[str]:
    """Names of the types that a function takes; those of the fields for a method."""
    hints = get_type_hints(function)
    given = [name for name, p in signature(function).parameters.items() if p.kind is not Parameter.VAR_KEYWORD]
    types = [hints[name] for name in given if name in hints]
    types += list(get_type_hints(owner).values()) if owner else []
    return {getattr(kind, "__name__", str(kind)) for kind in types}


@pytest.mark.parametrize(("holder", "maker", "source"), HOLDERS)
def test_a_holder_is_made_from_the_one_before(holder, maker, source):
    owner, function = found(maker)
    assert get_type_hints(function)["return"].__name__ == holder
    assert source in inputs(owner, function)


def test_the_chain_has_no_gap_and_at_most_four_holders():
    assert [source for *_, source in HOLDERS] == ["Path", *(holder for holder, *_ in HOLDERS[:-1])]
    assert HOLDERS[-1][0] == "ImageLoss" and len(HOLDERS) <= MOST


def test_every_layout_is_described_as_a_clip():
    from endotsr.clips.sequences.layouts import layouts

    for layout in layouts():
        assert get_type_hints(layout.describe)["return"].__name__ == "Clip", layout.name
