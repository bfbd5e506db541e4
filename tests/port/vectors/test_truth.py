"""The golden values are those of the definition, computed in plain NumPy; a few are also those of more digits."""

import numpy as np
import pytest

import endotsr.definition as definition
from endotsr.port.judge.compare import judged, largest
from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.operations.definition import definition_operations
from makers.registry import JUDGED
from oracle import adam, fourier_oracle, matern_oracle, pose_oracle

GOLDEN = read_golden(golden_folder())
TWINS = definition_operations()
NO_TWIN = {"generator", "reading", "determinism"}  # how files are read, and the same bits twice
LONG_NEEDLE = "render/long_needle"  # the inverse of Sigma loses (length / width)^2 roundings: this much of the scale
LOST = {"d_log_scale": 1e-5}
LOST_ELSEWHERE = 1e-8
CASES = [case for case in GOLDEN.cases if case.operation in TWINS]


def inputs_of(case):
    return {name: GOLDEN.array(case, array.file) for name, array in case.inputs.items()}


def answers(case):
    """The expected outputs of every legal answer."""
    for number in range(case.answers):
        yield {name: GOLDEN.array(case, output.answer(number)) for name, output in case.outputs.items()}


def answered(case, inputs):
    with np.errstate(all="ignore"):
        found = TWINS[case.operation].compute(inputs, case.settings)
    return {name: np.asarray(found[name]) for name in case.outputs}


@pytest.mark.parametrize("case", [c for c in CASES if c.name != LONG_NEEDLE], ids=lambda case: case.name)
def test_the_definition_gives_every_expected_value(case):
    found, failed = answered(case, inputs_of(case)), []
    for right in answers(case):
        verdicts = {n: judged(found[n], right[n], o.compare, "float64") for n, o in case.outputs.items()}
        failed.append({name: verdict for name, verdict in verdicts.items() if not verdict.passed})
    assert {} in failed, failed


def test_a_long_needle_loses_digits_in_the_definition_and_only_there():
    """In float64 all outputs to a stated bound, in long doubles the images to the tolerance of the case."""
    case = next(c for c in CASES if c.name == LONG_NEEDLE)
    (right,) = answers(case)
    found = answered(case, inputs_of(case))
    off = {n: largest(found[n], right[n], o.compare.scale) for n, o in case.outputs.items() if o.dtype == "real"}
    assert {name: value for name, value in off.items() if value > LOST.get(name, LOST_ELSEWHERE)} == {}
    if np.finfo(np.longdouble).eps < np.finfo(np.float64).eps:
        wide = {name: array.astype(np.longdouble) for name, array in inputs_of(case).items()}
        found = answered(case, wide)
        for name in ("colour_image", "depth_image", "opacity_image"):
            rule = case.outputs[name].compare
            assert judged(found[name].astype(float), right[name], rule, "float64").passed, name


def test_every_case_is_answered_by_the_definition_or_has_no_twin():
    assert {case.operation for case in GOLDEN.cases} - TWINS.keys() == NO_TWIN
    assert len(CASES) > 100


# ---- truths from elsewhere ----


def frequencies(i, s):
    return {"omega": fourier_oracle.frequencies(s["count"], s["low"], s["high"])}


def dictionary(i, s):
    return {"phi": fourier_oracle.dictionary(float(i["t"]), i["omega"])}


def atoms(i, s):
    """The oracle normalises phi(t) for a time; two times give mean and gain of every atom."""
    times = sorted(set(i["times"][i["train_index"]]))
    gains, means = [], []
    for k in range(i["phi"].size):
        (t0, t1) = (0.1, 0.23)
        a, b = (fourier_oracle.normalised(times, i["omega"], t)[k] for t in (t0, t1))
        p, q = (float(fourier_oracle.dictionary(t, i["omega"])[k]) for t in (t0, t1))
        gains.append(0.0 if a is None or b is None else (a - b) / (p - q))
        means.append(0.0 if a is None or gains[-1] == 0 else p - a / gains[-1])
    return {"phi_bar": (i["phi"] - np.array(means)) * np.array(gains)}


def matern(i, s):
    length, omega = s["correlation_length"], i["omega"]
    return {"rho": np.ones(omega.size) if length == 0 else matern_oracle.weights(omega, length)}


def pose(i, s):
    given = [i[name] for name in ("rotation", "translation", "rotation_vector", "offset")]
    gradients = pose_oracle.gradients(*given, i["d_corrected_rotation"], i["d_corrected_translation"])
    names = ("d_rotation", "d_translation", "d_rotation_vector", "d_offset")
    found = dict(zip(("corrected_rotation", "corrected_translation"), pose_oracle.corrected(*given), strict=True))
    return found | dict(zip(names, gradients, strict=True))


def adam_case(i, s):
    out = np.empty_like(i["parameter"])
    for at in np.ndindex(out.shape):
        gradients = iter([g[at] for g in i["gradients"]])
        arguments = (len(i["gradients"]), s["rate"], s["beta1"], s["beta2"], s["epsilon"])
        out[at] = adam.adam_scalar(i["parameter"][at], lambda p, g=gradients: next(g), *arguments)[-1]
    return {"parameter_after": out}


ELSEWHERE = {
    "frequencies": frequencies, "dictionary": dictionary, "atoms": atoms, "matern": matern, "pose": pose,
    "adam": adam_case,
}  # fmt: skip
DIGITS = [case for case in GOLDEN.cases if case.operation in ELSEWHERE]


@pytest.mark.parametrize("case", DIGITS, ids=lambda case: case.name)
def test_a_library_or_more_digits_give_the_expected_value(case):
    (right,) = answers(case)
    for name, value in ELSEWHERE[case.operation](inputs_of(case), case.settings).items():
        got = np.array([float(v) for v in np.ravel(value)]).reshape(right[name].shape)
        assert judged(got, right[name], case.outputs[name].compare, "float64").passed, name


# ---- what the files say of their truth ----


def test_every_independent_program_that_a_file_names_exists():
    modules = {
        module.__name__.rpartition(".")[2]: module for module in (adam, fourier_oracle, matern_oracle, pose_oracle)
    }
    named = {o.truth.oracle for case in GOLDEN.cases for o in case.outputs.values() if o.truth.kind == "oracle"}
    named |= {judged.oracle for outputs in JUDGED.values() for judged in outputs.values() if judged.oracle}
    for program in sorted(named):
        module, function = program.split(".")
        homes = [home for home in (modules.get(module), getattr(definition, module, None)) if home]
        assert any(callable(getattr(home, function, None)) for home in homes), program


def test_most_values_up_to_level_2_have_an_oracle():
    outputs = [o for c in GOLDEN.cases for o in c.outputs.values() if o.level in (1, 2)]
    assert sum(o.truth.kind == "oracle" for o in outputs) > 0.6 * len(outputs)
