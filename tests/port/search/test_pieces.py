"""The pieces of the search: changes of the syntax tree, numbers, intervals of thresholds and their words."""

import ast
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from endotsr.port.operations.definition import definition_operations
from endotsr.port.search import inside
from endotsr.port.search.decisions import Interval, said, threshold
from endotsr.port.search.find import sentences
from endotsr.port.search.inside import bisected
from endotsr.port.search.numbers import plain_first, said_number
from endotsr.port.search.places import Statement, spots, syntax, written
from endotsr.port.search.rewrites import rewrites
from endotsr.port.search.second import Counter
from endotsr.port.search.trial import Hit

OPERATIONS = definition_operations()


def place(module, function):
    module = sys.modules[f"endotsr.definition.{module}"]
    statement: Any
    (statement,) = (one for one in syntax(module).body if getattr(one, "name", "") == function)
    return Statement(module, statement, frozenset({"forward"}))


@pytest.mark.parametrize("name", ["masked_ssim.masked_ssim_forward", "projection.jacobian", "compositing.layers_of"])
def test_a_change_leaves_every_node_where_it_was(name):
    one = place(*name.split("."))
    nodes = [id(node) for node in ast.walk(one.statement)]
    text = ast.dump(one.statement, include_attributes=True)
    for spot in spots(one):
        with written(spot, "0.5"):
            pass
    assert ast.dump(one.statement, include_attributes=True) == text
    assert [id(node) for node in ast.walk(one.statement)] == nodes


def test_a_text_that_is_no_expression_leaves_the_tree_as_it_was():
    one = place("projection", "jacobian")
    text = ast.dump(one.statement)
    for spot in (spot for spot in spots(one) if len(spot.holders) > 1):
        with pytest.raises(SyntaxError), written(spot, "a +"):
            pass
    assert ast.dump(one.statement) == text


@pytest.mark.parametrize(("number", "expected"), [(2.0, (2.0, True)), (0.5, (0.5, True)), (-1.0, (-1.0, True))])
def test_a_number_that_is_exactly_plain_counts_as_plain(number, expected):
    assert plain_first(number)[0] == expected
    assert [value for value, _ in plain_first(number)].count(number) == 1


def test_a_number_near_a_plain_one_comes_after_it():
    assert plain_first(2.0000001) == [(2.0, True), (2.0000001, False)]
    assert plain_first(0.7312345)[-1] == (0.7312345, False)


@pytest.mark.parametrize("text", ["a if t else b", "a < b", "a and b", "not a", "a & b", "a * b", "-a", "a + b"])
def test_an_expression_with_a_number_reads_as_it_was_computed(text):
    node = ast.parse(text, mode="eval").body
    for a in (-1, 0, 3):
        names = {"a": a, "b": 2, "t": True}
        assert eval(said_number(node, 1.0, 7.0), names) == 7 * eval(text, names)
        assert eval(said_number(node, 0.0, 0.5), names) == eval(text, names) + 0.5


def test_the_interval_of_a_threshold_has_no_number_that_is_known_to_be_wrong():
    def wrong(number):
        return 0 if 0.4 <= number <= 0.6 or 1.8 <= number <= 2.2 else 5

    found = threshold(wrong, 1.0)
    assert found is not None and not any(map(wrong, np.linspace(found.low, found.high, 101))), found


def test_the_interval_of_a_threshold_is_said_of_the_case_it_was_found_on():
    text = said(0.005, Interval(0.0049, 0.0051), 0.004, "composite/plain")
    assert text == "0.005` (any number from 0.0049 to 0.0051 gives the decisions of composite/plain) where `0.004"


def test_one_evaluation_is_said_with_its_numbers_or_as_one():
    counter = Counter()
    assert counter.words() == "at one evaluation alone"

    def evaluated(given):
        k = 3 * given
        return counter.nth(1.0, 1, 2.0) + 0 * k

    assert [evaluated(1), evaluated(2), evaluated(3)] == [1.0, 2.0, 1.0]
    assert counter.words() == "at k = 6"


def hit(text, whole, function="f"):
    return Hit(text, f"definition/{text}.py:1", function, whole, (1, 1, 0, 0))


def test_changes_that_explain_another_part_are_not_called_equal():
    hits = [hit("a", "forward"), hit("b", "forward"), hit("c", "refused")]
    trial: Any = SimpleNamespace(hits=hits, cases=[0, 0])
    lines = sentences(trial)
    assert lines[1] == "  or equally with b: definition/b.py:1"
    assert lines[2].startswith("  or with c: definition/c.py:1, which gives every output of those that are refused")


def test_only_arrays_before_the_first_wrong_one_are_said_to_be_right_before_it(monkeypatch):
    arrays = {name: np.arange(6.0) + k for k, name in enumerate(("first", "second", "third"))}
    got = {**arrays, "second": arrays["second"] * 2 + np.sin(np.arange(6.0))}
    monkeypatch.setattr(inside, "values", lambda operation, one: arrays)
    monkeypatch.setattr(inside, "read_plain", lambda path, root, most: got[path.stem])
    one: Any = SimpleNamespace(folder=Path("a"), case=SimpleNamespace(name="a/b"), tolerance=1e-9, inputs={})
    operation: Any = None
    (line,) = bisected(operation, one)
    assert line.startswith("inside a/b the first wrong array is second: ") and line.endswith("; right before it: first")


def test_a_statement_is_omitted_where_it_stands_in_a_block():
    one = place("compositing", "layers_of")
    omitted = [spot for spot in spots(one) if isinstance(spot.node, ast.stmt)]
    assert omitted and all(spot.holders[0][0] is not one.statement for spot in omitted)
    assert list(rewrites(omitted[0].node, [True], False)) == [("pass", 0)]


def test_arrays_inside_are_in_the_order_in_which_the_definition_computes_them():
    names = list(inside.INSIDE["render"])
    screen = ["point", "jacobian", "t", "mean2d", "covariance2d", "determinant", "conic", "direction"]
    assert [name for name in names if name in screen] == screen
    assert list(inside.INSIDE["normalised_depth"]) == ["prior", "largest", "residual"]


def test_rewrites_of_values_that_are_not_all_numbers_do_not_end_the_search():
    node = ast.parse("a + b", mode="eval").body
    texts = [text for text, _ in rewrites(node, [np.array([1.0, 2.0]), None], False)]
    assert "np.sqrt(a + b)" in texts


@pytest.mark.parametrize(
    ("text", "other"),
    [
        ("a ** 2 + 0.0001", "(a + 0.0001) ** 2"),
        ("(a + 0.0001) ** 2", "a ** 2 + 0.0001"),
        ("np.exp(np.clip(a, -1, 1))", "np.clip(np.exp(a), -1, 1)"),
        ("np.maximum(a, 0) * b", "np.maximum(a * b, 0)"),
        ("np.maximum(a, 1)", "(a) + 1e-8"),
        ("a[:, 1:4]", "a[:, 0:3]"),
        ("a.sum() / n", "(a.sum()) / np.size(a)"),
        ("a + b", "np.maximum(a, b)"),
        ("a.any(axis=0)", "a.sum(axis=0) > 1"),
        ("a.sum(axis=(1, 2))", "np.take(a, [-1], 1).sum(axis=(1, 2))"),
        ("a.sum(axis=(1, 2))", "np.delete(a, 0, 2).sum(axis=(1, 2))"),
        ("np.median(a)", "np.sort(a, axis=None)[(np.size(a) - 1) // 2]"),
        ("np.einsum('cki,k->ci', a, b)", "np.einsum('cki,k->ci', (a)[:, 1:, :], (b)[1:])"),
        ("a @ b", "(a)[..., :-1] @ (b)[:-1]"),
    ],
)
def test_a_number_a_clamp_a_slice_or_a_count_in_another_place_is_tried(text, other):
    node = ast.parse(text, mode="eval").body
    assert other in [new for new, _ in rewrites(node, [np.ones(3)], False)]
    assert ast.unparse(node) == text  # the syntax tree stays as it is


def test_a_real_number_in_a_condition_has_no_truth_value_in_its_place():
    node = ast.parse("a", mode="eval").body
    assert "True" in [text for text, _ in rewrites(node, [np.array([True, False])], truth=True)]
    assert "True" not in [text for text, _ in rewrites(node, [np.float64(3.0)], truth=True)]


def test_a_constant_is_tried_with_a_few_digits_rounded_and_cut_off():
    texts = [text for text, _ in rewrites(ast.parse("2 * np.pi", mode="eval").body, [2 * np.pi], False)]
    assert {"6.28", "6.2831", "6.2832", "6.283185"} <= set(texts)
