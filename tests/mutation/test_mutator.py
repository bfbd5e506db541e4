"""The mutator itself: what it changes, what it leaves alone, and that a changed function runs changed."""

import math

import pytest

from mutation.mutator import in_place, mutants, replaced


def area(first, second, flags):
    """A docstring - with a minus."""
    if first < 0:
        raise ValueError("first - second")
    total = 0.5 * first + second
    for k in range(len(flags)):
        if flags[k] and not first > second:
            total += math.sin(-second) * min(first, second) + k
    return total if total >= 1 else abs(total)


def outcome(function, *arguments):
    try:
        return function(*arguments)
    except Exception as error:
        return type(error)


CASES = (
    (1.0, 2.0, [True, False, False]), (3.0, 0.5, [True, True]), (2.0, 2.0, [True]), (0.2, 0.4, []), (0.0, -3.0, [True]),
    (2.0, -9.0, [False]), (0.2, 0.4, [False, True]), (0.5, 0.75, []), (0.6, 0.9, [True]),
)  # fmt: skip


def test_every_kind_of_change_is_made():
    kinds = {m.kind for m in mutants("area", area)}
    wanted = {"operator", "dropped term", "constant", "index", "comparison", "logic", "sign", "function"}
    assert kinds == wanted | {"dropped statement"}


def test_names_are_unique_and_tell_what_is_changed():
    names = [m.name for m in mutants("area", area)]
    assert len(set(names)) == len(names)
    assert (
        "area: `math.sin(-second)` -> `math.cos(-second)` in `total += math.sin(-second) * min(first, second) + k`"
        in names
    )
    assert "area: `k` -> `k - 1` in `if flags[k] and (not first > second)`" in names


def test_docstring_messages_and_argument_checks_are_left_alone():
    for mutant in mutants("area", area):
        assert "raise" not in mutant.name and "first < 0" not in mutant.name and "docstring" not in mutant.name


def test_a_mutant_runs_in_place_of_the_function_and_only_inside():
    right = [outcome(area, *case) for case in CASES]
    for mutant in mutants("area", area):
        with in_place(area, mutant.code):
            wrong = [outcome(area, *case) for case in CASES]
        assert [outcome(area, *case) for case in CASES] == right
        if not mutant.name.endswith("return total if total >= 1 else abs(total)`"):  # |total| is mostly total
            assert wrong != right, mutant.name


def test_equal_changes_of_one_statement_are_numbered():
    def twice(x):
        return x + x * 2 + x * 2

    names = [m.name for m in mutants("twice", twice)]
    assert sum("`2` -> `3`" in n for n in names) == 2 and sum(n.endswith("(2)") for n in names) > 0


def test_a_defect_must_stand_in_the_source_exactly_once():
    with in_place(area, replaced(area, ("0.5 * first", "0.25 * first"))):
        assert area(4.0, 1.0, []) == 2.0
    assert area(4.0, 1.0, []) == 3.0
    for text in ("0.125 * first", "second"):
        with pytest.raises(ValueError, match="times"):
            replaced(area, (text, "0"))
