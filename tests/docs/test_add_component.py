"""The guide *Add a component* is executed: its code, oracle, stage and notebook cell fit the package."""

import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from endotsr.gradcheck import check_pair, check_precision, one_thread, pair_of, pair_stream

GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "add_component.md"
SQUARED, ORACLE = "reference/endotsr/losses/squared.py", "tests/oracle/losses.py"
STAGES = "reference/endotsr/stages/losses.py"
BLOCKS = re.findall(r"^```python\n# (\S+)\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.fixture
def component(monkeypatch):
    """Path of every block -> its names; the first block is the module that the others import."""
    found = {}
    for path, text in BLOCKS:
        name = path.removeprefix("reference/").removesuffix(".py").replace("/", ".")
        module = ModuleType(name)
        if name == "endotsr.losses.squared":
            monkeypatch.setitem(sys.modules, name, module)
        exec(compile(text, path, "exec"), module.__dict__)
        found[path] = module
    return found


def test_the_guide_has_a_block_for_each_step():
    assert [path for path, _ in BLOCKS] == [SQUARED, ORACLE, STAGES, "notebooks/10_base_losses.py"]
    root = GUIDE.parents[2]
    assert all((root / path).is_file() for path, _ in BLOCKS[1:]), "the guide names files that exist"


def test_the_component_agrees_with_its_oracle(component):
    rng = np.random.default_rng(0)
    rendered, observed = rng.random((2, 3, 5, 7))
    mask = rng.random((5, 7)) > 0.4
    loss, _ = component[SQUARED].masked_squared_forward(rendered, observed, mask)
    np.testing.assert_allclose(loss, component[ORACLE].masked_squared(rendered, observed, mask), rtol=1e-14)
    rendered[:, ~mask] = np.nan
    assert component[SQUARED].masked_squared_forward(rendered, observed, mask)[0] == loss


def test_the_stage_passes_the_gradient_check(component):
    (stage,) = component[STAGES].STAGES
    (variant,) = stage.variants
    pair = pair_of(stage, variant)
    with one_thread():
        report = check_pair(pair, pair_stream(pair.name, 0))
        precision = check_precision(pair, pair_stream(pair.name, 0))
    assert report.passed, report.failures
    assert precision.passed, precision.failures


def test_the_stage_answers_what_it_asks(component):
    (stage,) = component[STAGES].STAGES
    rng = np.random.default_rng(1)
    inputs = {"rendered": rng.random((3, 4, 4)), "observed": rng.random((3, 4, 4)), "mask": np.ones((4, 4), bool)}
    found = stage.compute({**inputs, "d_loss": np.array(1.0)}, {})
    assert set(found) == set(stage.asked)
    assert set(inputs) == set(stage.inputs)
