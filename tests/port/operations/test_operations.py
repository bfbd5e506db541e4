"""The registry of operations: what it says of itself is true, and what does not fit together is refused."""

import importlib
import re
from types import SimpleNamespace

import numpy as np
import pytest

from endotsr.config import LossConfig
from endotsr.port.contract import all_operations
from endotsr.port.gradcheck import all_pairs, pair_of
from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.operations import registry
from endotsr.port.operations.operation import Operation, Variant, real_of, split_blocks
from endotsr.port.operations.registry import method_operations
from endotsr.port.operations.scene import CHECKED
from makers.registry import JUDGED

OPERATIONS = method_operations()
OPERATIONS = all_operations()
STORED = [(case, OPERATIONS[case.operation]) for case in read_golden(golden_folder()).cases]


def cubed(inputs, settings):
    return {"out": settings["factor"] * inputs["x"] ** 3}, settings["factor"] * 3 * inputs["x"] ** 2


OPERATION = Operation(
    name="cubed",
    equation="0",
    text="a factor times the third power",
    function="tests.cubed",
    forward=cubed,
    reverse=lambda cotangents, saved: {"d_x": cotangents["out"] * saved},
    variants=(Variant("cubed", lambda rng: {"x": rng.uniform(1, 2, 4)}, {"factor": 2.0}),),
)


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=lambda operation: operation.name)
def test_the_function_of_a_operation_exists(operation):
    dotted = [operation.function, *(variant.function for variant in operation.variants)]
    for module, _, name in (text.rpartition(".") for text in dotted if text):
        assert callable(getattr(importlib.import_module(module), name))
    assert operation.function or not operation.equation


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=lambda operation: operation.name)
def test_a_operation_is_checked_exactly_if_it_has_a_reverse_pass(operation):
    assert bool(operation.variants) == (operation.reverse is not None)
    assert operation.trace is None or operation.variants


@pytest.mark.parametrize(
    "operation", [s for s in OPERATIONS.values() if s.variants], ids=lambda operation: operation.name
)
def test_inputs_of_a_check_are_apart_and_their_gradients_are_judged(operation):
    for variant in operation.variants:
        inputs = variant.inputs(np.random.default_rng(0))
        fixed = variant.fixed(np.dtype(np.float64)) if variant.fixed else {}
        assert not inputs.keys() & fixed.keys()
        assert {f"d_{name}" for name in inputs} <= JUDGED[operation.name].keys()


def test_every_operation_is_judged():
    assert JUDGED.keys() == OPERATIONS.keys()


def test_golden_cases_hold_outputs_of_their_operation_in_order_with_the_unit_that_is_judged():
    for case, operation in STORED:
        judged = {name: one.unit for name, one in JUDGED[operation.name].items() if name in case.outputs}
        assert [(name, output.unit) for name, output in case.outputs.items()] == list(judged.items()), case.name
        assert case.pairs == operation.checks(case.settings), case.name


def test_gradients_are_answered_where_every_cotangent_is_given():
    x = np.array([1.0, 2.0])
    assert set(OPERATION.compute({"x": x}, {"factor": 2.0})) == {"out"}
    found = OPERATION.compute({"x": x, "d_out": np.array([1.0, -1.0])}, {"factor": 2.0})
    np.testing.assert_array_equal(found["d_x"], [6.0, -24.0])
    loss = OPERATION._replace(is_loss=True).compute({"x": np.array(2.0)}, {"factor": 2.0})
    assert loss["d_x"] == 24.0


def test_extra_outputs_are_answered_and_missing_ones_left_out():
    operation = OPERATION._replace(extra=lambda inputs, settings, saved: {"slope": saved, "nothing": None})
    found = operation.compute({"x": np.array(1.0)}, {"factor": 2.0})
    assert set(found) == {"out", "slope"} and found["slope"] == 6.0


def test_a_pair_holds_settings_and_fixed_inputs():
    fixed = []

    def weighted(inputs, settings):
        return {"out": inputs["weight"] * inputs["x"]}, inputs["weight"]

    variant = Variant(
        "weighted",
        lambda rng: {"x": np.ones(2)},
        fixed=lambda dtype: fixed.append(dtype) or {"weight": np.full(2, 3.0, dtype)},
        covers=lambda settings: settings.get("weighted", False),
    )
    operation = OPERATION._replace(
        forward=weighted,
        reverse=lambda cotangents, saved: {"d_x": saved * cotangents["out"], "d_weight": cotangents["out"]},
        trace=lambda inputs, settings, saved: {"w": saved},
        variants=(variant,),
    )
    pair = pair_of(operation, variant)
    one = {"x": np.ones(2, np.float32)}
    assert pair.forward(one)["out"].dtype == np.float32 and fixed == [np.float32]
    assert pair.reverse(one, {"out": np.ones(2)}).keys() == {"x"}
    assert pair.trace is not None and pair.trace(one)["w"][0] == 3.0
    assert (operation.checks({}), operation.checks({"weighted": True})) == ((), ("weighted",))


def test_a_variant_of_a_operation_without_reverse_pass_is_refused():
    with pytest.raises(ValueError, match="operation cubed has no reverse pass that variant cubed could check"):
        pair_of(OPERATION._replace(reverse=None), OPERATION.variants[0])


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (OPERATION, "operation cubed is registered twice"),
        (OPERATION._replace(name="b"), "variant cubed is registered twice"),
    ],
)
def test_a_name_is_registered_once(monkeypatch, other, message):
    monkeypatch.setattr(registry, "MODULES", ("one",))
    monkeypatch.setattr(importlib, "import_module", lambda name: SimpleNamespace(OPERATIONS=[OPERATION, other]))
    with pytest.raises(ValueError, match=message):
        method_operations()


def test_the_checks_are_the_variants_in_the_order_of_the_specification():
    assert list(all_pairs()) == [variant.name for operation in OPERATIONS.values() for variant in operation.variants]
    labels = [pair.equation for pair in all_pairs().values()]
    *parts, whole = dict.fromkeys(labels)
    published = [label for label in parts if not re.fullmatch(r"B1[3-9]|B[2-9]\d", label)]  # the others are options
    assert published == ["1", "1b", "2", "3", "4", "5", *(f"B{k}" for k in range(1, 10))] and whole == "6"


def test_the_check_of_the_objective_has_every_weight():
    """A weight of 0 hides a wrong gradient of its term in `view_pass` or `image_loss`."""
    weights = {name for name in LossConfig.__struct_fields__ if name.endswith("_weight") or name.startswith("lambda_")}
    missing = {name for name in weights if not CHECKED["loss"].get(name)}
    assert not missing, f"add to CHECKED in reference/endotsr/port/operations/scene.py: {sorted(missing)}"


@pytest.mark.parametrize("seed", range(3))
def test_no_term_of_the_checked_objective_is_0(seed):
    """The gradient check does not see a term that is 0 in its scene, as one above a threshold may be."""
    (variant,) = OPERATIONS["objective"].variants
    inputs = variant.inputs(np.random.default_rng(seed)) | variant.fixed(np.dtype(np.float64))
    _, saved = OPERATIONS["objective"].forward(inputs, variant.settings)
    terms = OPERATIONS["objective"].extra(inputs, variant.settings, saved)
    values = {name: abs(float(value)) for name, value in terms.items() if name.startswith("term_")}
    assert len(values) >= 6 and {name for name, value in values.items() if value < 1e-6} == set()


def test_blocks_of_some_inputs_and_the_others_whole():
    blocks = split_blocks({"x": {"x first": slice(0, 1), "x rest": slice(1, None)}})
    found = blocks({"x": np.zeros(3), "y": np.zeros(2)})
    assert found == {"x first": ("x", slice(0, 1)), "x rest": ("x", slice(1, None)), "y": ("y", ...)}


def test_the_precision_of_a_request_is_that_of_its_first_real_input():
    assert real_of({"mask": np.ones(2, bool), "x": np.ones(2, np.float32)}) == np.float32
    assert real_of({"mask": np.ones(2, bool)}) == np.float64
