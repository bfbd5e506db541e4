"""Hard cases N1 to N4: threads, floating-point flags, precision. They concern every kernel at once."""

import ast
import math
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from made_up_scenes import as_dtype, assert_close_l2, plain_camera, random_scene, run, threads

from endotsr.method.kernels.jit import jit
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER
from endotsr.port.gradcheck import all_pairs, pair_stream

__all__ = ["threads"]
PACKAGE = Path(__file__).parents[2] / "reference" / "endotsr"
PAIRS = all_pairs()
CAMERA = plain_camera(33, 29, 25.0)


def _sum_and_nan(values):
    total = values[0]
    for i in range(1, values.size):
        total += values[i]
    return total, math.isnan(values[-1] - values[-1])


@pytest.mark.parametrize("name", list(PAIRS))
def test_hard_N1_no_bit_of_any_pair_depends_on_threads(name, threads):
    """Outputs and gradients on one and on two threads, in float32 where the pair has it."""
    pair = PAIRS[name]
    dtype = np.float64 if pair.single else np.float32
    inputs = {key: a.astype(dtype) for key, a in pair.inputs(pair_stream(name, 0)).items()}
    results = []
    for count in (1, 2):
        threads(count)
        outputs = pair.forward(inputs)
        rng = np.random.default_rng(0)
        given = {key: rng.normal(0, 1, np.shape(a)).astype(np.asarray(a).dtype) for key, a in outputs.items()}
        gradients = pair.reverse(inputs, given)
        results.append([np.asarray(a).tobytes() for group in (outputs, gradients) for a in group.values()])
    assert results[0] == results[1]


def test_hard_N1_there_is_no_parallel_loop():
    """`prange` with += into a shared cell is the classic race; the tasks of `share` own their cells."""
    for file in PACKAGE.rglob("*.py"):
        names = {n.id for n in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(n, ast.Name)}
        assert "prange" not in names, file


@pytest.mark.parametrize("contract", [False, True])
def test_hard_N2_sums_keep_their_order_and_nan_stays_visible(contract):
    """With fast-math the sum may be re-ordered (here to 1 or 2) and isnan folds to False."""
    kernel = jit(_sum_and_nan, contract=contract)
    total, is_nan = kernel(np.array([1e16, 1.0, -1e16, 1.0, np.inf]))
    assert total == np.inf and is_nan
    assert kernel(np.array([1e16, 1.0, -1e16, 1.0]))[0] == 1.0


# Corners of pixel boxes: whole numbers, which Numba unifies (int64 with float32) to double. Exact.
WHOLE_NUMBERS = {"endotsr.method.splatting.binning._boxes_kernel"}

# Computed in double and rounded once (`method/kernels/elementary.py`), as the C library does.
ROUNDED_ONCE = ("_exponential_float32_v", "_logarithm_float32_v")


def float64_variables(kernel):
    """Lines of the typed program in which a variable, not a literal on its way to a cast, is a double."""
    for signature, compiled in kernel.overloads.items():
        if "float64" in str(signature) or "float32" not in str(signature):
            continue
        for line in str(compiled.type_annotation).splitlines():
            literal = "= const(" in line or "= global(" in line
            if line.rstrip().endswith(":: float64") and not literal and not any(name in line for name in ROUNDED_ONCE):
                yield line.strip()


def test_hard_N3_the_float32_rasteriser_holds_no_double():
    """A literal beside a float32 promotes it: typed once by Numba, read here from the compiled kernels."""
    scene = random_scene(0, 50, CAMERA, dtype=np.float32)
    for path, settings in (("definition", EXACT), ("blocks", PAPER), ("definition", LEGACY)):
        run(scene, CAMERA, settings, path)
    kernels = {
        f"{module}.{name}": value
        for module, content in sorted(sys.modules.items())
        if module.startswith("endotsr.method.splatting.")
        for name, value in vars(content).items()
        if getattr(value, "overloads", None) and f"{module}.{name}" not in WHOLE_NUMBERS
    }
    if not kernels:
        pytest.skip("kernels are not compiled (NUMBA_DISABLE_JIT)")
    found = {name: lines for name, kernel in kernels.items() if (lines := list(float64_variables(kernel)))}
    assert len(kernels) > 15 and found == {}


def _promoted(values):
    return values[0] * 0.5


def test_hard_N3_a_literal_beside_a_float32_is_seen():
    kernel = numba.njit(_promoted)
    kernel(np.ones(1, np.float32))
    if getattr(kernel, "overloads", None):
        assert list(float64_variables(kernel))


@pytest.mark.parametrize("preset", ["exact", "paper", "legacy"])
def test_hard_N4_float32_gradients_of_a_scene_of_one_thousandth(preset):
    """Relative L2 <= 1e-4 of every gradient also in units a thousand times smaller, near plane included."""
    settings = {"exact": EXACT, "paper": PAPER, "legacy": LEGACY}[preset]._replace(near=2e-4)
    scene = random_scene(3, 60, CAMERA)
    scene = as_dtype(
        scene._replace(position=scene.position * 1e-3, log_scale=scene.log_scale + np.log(1e-3)), np.float32
    )
    path = "blocks" if preset == "paper" else "definition"
    images, _ = run(as_dtype(scene, np.float64), CAMERA, settings, path)
    rng = np.random.default_rng(4)
    given = [rng.normal(0, 1, images[name].shape).astype(np.float32) for name in ("colour", "depth", "opacity")]
    narrow = run(scene, CAMERA, settings, path, given=given)
    wide = run(as_dtype(scene, np.float64), CAMERA, settings, path, given=[g.astype(np.float64) for g in given])
    for one, two in zip(narrow, wide):
        assert all(a.dtype == np.float32 for a in one.values())
        assert_close_l2(one, two, 1e-4)
