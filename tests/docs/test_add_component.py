"""The guide *Add a component* is executed: its definition, code, operation, twin and notebook cell fit the package."""

import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import endotsr.definition
import endotsr.method.losses  # noqa: F401
from endotsr.port.gradcheck import check_pair, check_precision, one_thread, pair_of, pair_stream
from endotsr.port.operations.definition import twin_of
from makers.twins import distances, made_up

GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "add_component.md"
SQUARED, DEFINITION = "reference/endotsr/method/losses/squared.py", "reference/endotsr/definition/squared.py"
OPERATIONS, FAMILY = "reference/endotsr/port/operations/losses.py", "golden/makers/masked_squared.py"
NOTEBOOK = "notebooks/11_base_losses.py"
BLOCKS = re.findall(r"^```python\n# (\S+)\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.fixture
def component(monkeypatch):
    """Path of every block -> its names; the first two blocks are modules that the others import."""
    found = {}
    for path, text in BLOCKS:
        name = path.removeprefix("reference/").removesuffix(".py").replace("/", ".")
        module = ModuleType(name)
        if name.endswith(".squared"):
            monkeypatch.setitem(sys.modules, name, module)
            monkeypatch.setattr(sys.modules[name.rpartition(".")[0]], "squared", module, raising=False)
        exec(compile(text, path, "exec"), module.__dict__)
        found[path] = module
    return found


def test_the_guide_has_a_block_for_each_step():
    assert [path for path, _ in BLOCKS] == [DEFINITION, SQUARED, OPERATIONS, FAMILY, NOTEBOOK]
    root = GUIDE.parents[2]
    assert all((root / path).is_file() for path in (OPERATIONS, NOTEBOOK)), "the guide names files that exist"
    assert all((root / path).parent.is_dir() for path, _ in BLOCKS), "a new file is in a folder that exists"


def test_the_component_agrees_with_its_definition(component):
    rng = np.random.default_rng(0)
    rendered, observed = rng.random((2, 3, 5, 7))
    mask = rng.random((5, 7)) > 0.4
    loss, _ = component[SQUARED].masked_squared_forward(rendered, observed, mask)
    np.testing.assert_allclose(
        loss, component[DEFINITION].masked_squared_forward(rendered, observed, mask)[0], rtol=1e-14
    )
    rendered[:, ~mask] = np.nan
    assert component[SQUARED].masked_squared_forward(rendered, observed, mask)[0] == loss


def test_the_operation_agrees_with_its_twin(component):
    (operation,), judged = component[OPERATIONS].OPERATIONS, component[FAMILY].DECLARED["masked_squared"].outputs
    twin = twin_of(operation)
    assert twin.forward.__self__.forward is component[DEFINITION].masked_squared_forward
    found = distances(
        operation, operation._replace(forward=twin.forward, reverse=twin.reverse), made_up(operation), judged
    )
    assert {d.output for d in found} == {"loss", "d_rendered"} and all(d.distance <= d.bound for d in found)


def test_the_operation_passes_the_gradient_check(component):
    (operation,) = component[OPERATIONS].OPERATIONS
    (variant,) = operation.variants
    pair = pair_of(operation, variant)
    with one_thread():
        report = check_pair(pair, pair_stream(pair.name, 0))
        precision = check_precision(pair, pair_stream(pair.name, 0))
    assert report.passed, report.failures
    assert precision.passed, precision.failures


def test_the_operation_answers_what_is_judged(component):
    (operation,) = component[OPERATIONS].OPERATIONS
    rng = np.random.default_rng(1)
    inputs = {"rendered": rng.random((3, 4, 4)), "observed": rng.random((3, 4, 4)), "mask": np.ones((4, 4), bool)}
    found = operation.compute({**inputs, "d_loss": np.array(1.0)}, {})
    assert set(found) == set(component[FAMILY].DECLARED[operation.name].outputs)
