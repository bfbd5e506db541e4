"""The search for a mistake that is on no list: what is wrong in the definition is found again, by its line."""

import time

import numpy as np
import pytest
from made_up_ports import cases_of

from endotsr.definition import (
    appearance,
    covariance,
    density_control,
    dictionary,
    masked_l1,
    masked_ssim,
    matern,
    motion,
)
from endotsr.port.judge.diagnose import PARTS, made_of
from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.store import in_precision
from endotsr.port.judge.verdict import judge
from endotsr.port.operations.definition import definition_operations
from endotsr.port.reference import stored
from endotsr.port.search.find import explained, sentences
from endotsr.port.search.places import executed


def causes(golden, folder, operation, *, inputs=lambda found: found, settings=lambda found: found, seconds=24.0):
    """What is said of the answers of the definition as it is patched now, for all cases of an operation."""
    for case in cases_of(golden, operation):
        given = inputs(in_precision(golden.inputs(case), "float64"))
        with np.errstate(all="ignore"):
            found = definition_operations()[operation].compute(given, settings(case.settings))
        for name in case.outputs:
            write_npy(folder / case.name / f"{name}.npy", stored(found[name]))
    return report(golden, folder, operation, seconds)


def report(golden, folder, operation, seconds=24.0):
    (family,) = {case.family for case in golden.cases if case.operation == operation}
    with pytest.MonkeyPatch.context() as right:
        for module, name, function in RIGHT:
            right.setattr(module, name, function)
        found = judge(golden, folder, "float64", level=4, only=family)
        if not found.first_wrong:
            return ""
        return "\n".join(sentences(explained(golden, folder, "float64", 4, operation, seconds)))


PATCHED = [
    (masked_ssim, "C1"),
    (covariance, "covariance_reverse"),
    (density_control, "densify"),
    (dictionary, "dictionary_reverse"),
    (masked_l1, "masked_l1_reverse"),
    (matern, "matern_penalty_forward"),
    (matern, "matern_penalty_reverse"),
    (matern, "matern_weights"),
    (motion, "motion_forward"),
    (motion, "motion_reverse"),
    (appearance, "appearance_reverse"),
]
RIGHT = [(module, name, getattr(module, name)) for module, name in PATCHED]


def line_of(module, text):
    """How a report names the line of a file of the definition."""
    with open(module.__file__, encoding="utf-8") as file:
        (number,) = [k for k, line in enumerate(file, start=1) if text in line]
    return f"definition/{module.__name__.rpartition('.')[2]}.py:{number}"


def every_output(golden, operation):
    """What is said of a change that explains all cases of an operation."""
    return f"every output of its {len(cases_of(golden, operation))} cases"


def test_a_constant_of_another_value_is_found_with_its_value(golden, tmp_path, monkeypatch):
    monkeypatch.setattr(masked_ssim, "C1", 0.02**2)
    said = causes(golden, tmp_path, "masked_ssim")
    assert said.startswith(
        "your outputs are those of the definition with `0.02` where `0.01` is right: equation (B7), "
    )
    assert line_of(masked_ssim, "C1, C2 =") in said and every_output(golden, "masked_ssim") in said


def test_a_part_that_is_left_out_is_found(golden, tmp_path, monkeypatch):
    right = covariance.covariance_reverse

    def whole(d_shape, saved):
        found, (q, inverse) = right(d_shape, saved), covariance.unit(saved.quaternion)
        return found._replace(d_quaternion=covariance.rotation_reverse(q, d_shape.rotation) * inverse)

    monkeypatch.setattr(covariance, "covariance_reverse", whole)
    said = causes(golden, tmp_path, "covariance")
    assert "with `g` where `g - (g * q).sum(axis=0) * q` is right: equation (B2), step (6.8), " in said
    assert line_of(covariance, "# (6.8)") in said


def test_a_comparison_without_its_end_is_found(golden, tmp_path, monkeypatch):
    right = density_control.densify

    def without_end(gaussians, statistics, config, *rest):
        above = np.nextafter(config.gradient_threshold, np.inf)
        return right(gaussians, statistics, config._replace(gradient_threshold=above), *rest)

    class Fields(dict):
        __getattr__ = dict.__getitem__

        def _replace(self, **changes):
            return Fields({**self, **changes})

    def converted(gaussians, statistics, config, *rest):
        fields = {name: getattr(config, name) for name in config.__struct_fields__}
        return without_end(gaussians, statistics, Fields(fields), *rest)

    monkeypatch.setattr(density_control, "densify", converted)
    said = causes(golden, tmp_path, "density")
    least = "config.gradient_threshold"
    assert f"`(steepness) > ({least})` where `steepness >= {least}` is right: equation (B11)" in said


def test_a_setting_that_is_fixed_is_found(golden, tmp_path):
    def fixed(settings):
        return {**settings, "raster": {**settings["raster"], "low_pass": 0.25}}

    said = causes(golden, tmp_path, "projection", settings=fixed)
    assert said.startswith("your outputs are those of the definition with raster.low_pass fixed at 0.25\n")


def test_an_input_in_another_order_is_found(golden, tmp_path):
    order = [3, 0, 1, 2]
    folder = tmp_path / "turned"
    for case in cases_of(golden, "covariance"):
        given = in_precision(golden.inputs(case), "float64")
        found = definition_operations()["covariance"].compute({**given, "quaternion": given["quaternion"][order]}, {})
        found["d_quaternion"] = found["d_quaternion"][np.argsort(order)]
        for name in case.outputs:
            write_npy(folder / case.name / f"{name}.npy", stored(found[name]))
    said = report(golden, folder, "covariance")
    assert "with the input quaternion read in the order [3, 0, 1, 2] along axis 0\n  (every output of" in said


def test_one_pass_alone_is_told(golden, tmp_path, monkeypatch):
    right = dictionary.dictionary_reverse

    def with_cosine_for_sine(d_phi, saved):
        return right(d_phi * np.repeat([1.0, -1.0], d_phi.size // 2), saved)

    monkeypatch.setattr(dictionary, "dictionary_reverse", with_cosine_for_sine)
    said = causes(golden, tmp_path, "dictionary")
    assert line_of(dictionary, "d_turns = 2") in said and every_output(golden, "dictionary") in said


def test_gradients_that_follow_a_wrong_forward_pass_are_told(golden, tmp_path, monkeypatch):
    (_, _, forward), (_, _, reverse) = RIGHT[5:7]
    monkeypatch.setattr(matern, "matern_penalty_forward", lambda c, rho: (2 * forward(c, rho)[0], forward(c, rho)[1]))
    monkeypatch.setattr(matern, "matern_penalty_reverse", lambda d, saved: 2 * reverse(d, saved))
    said = causes(golden, tmp_path, "matern")
    assert "`3` where `6` is right: equation (4)" in said and line_of(matern, "/ (6 *") in said
    assert "every forward output, of which the gradients of the port are the derivatives," in said


def test_gradients_that_are_wrong_otherwise_are_told(golden, tmp_path, monkeypatch):
    (_, _, forward), (_, _, reverse) = RIGHT[8:10]
    monkeypatch.setattr(motion, "motion_forward", lambda c, phi: (-forward(c, phi)[0], forward(c, phi)[1]))
    monkeypatch.setattr(motion, "motion_reverse", lambda d, saved: reverse(d**3, saved))
    said = causes(golden, tmp_path, "motion")
    assert line_of(motion, 'np.einsum("dkn,k->dn"') in said and "equation (3)" in said
    assert "every forward output; the gradients of the port are wrong in another way," in said


def test_a_mistake_of_some_cases_alone_is_said_to_be_of_these(golden, tmp_path, monkeypatch):
    """The gradient for 8 frequencies is right, that for 4, in two cases, has the opposite sign."""
    _, _, reverse = RIGHT[6]
    monkeypatch.setattr(
        matern, "matern_penalty_reverse", lambda d, saved: reverse(d, saved) * (1 if saved.rho.size == 8 else -1)
    )
    said = causes(golden, tmp_path, "matern")
    assert "every output of those that are refused; it would be wrong in others that pass" in said


def test_what_would_spoil_a_case_that_passes_is_no_explanation_of_two_passes(golden, tmp_path, monkeypatch):
    """As above, in both passes: the gradients are the derivatives, but the third case is right."""
    (_, _, forward), (_, _, reverse) = RIGHT[5:7]
    signs = {3: 1, 4: -1, 8: 1}
    wrong = lambda c, rho: (signs[rho.size] * forward(c, rho)[0], forward(c, rho)[1])
    monkeypatch.setattr(matern, "matern_penalty_forward", wrong)
    monkeypatch.setattr(matern, "matern_penalty_reverse", lambda d, saved: signs[saved.rho.size] * reverse(d, saved))
    said = causes(golden, tmp_path, "matern")
    assert "it would be wrong in others that pass" in said and "are the derivatives" not in said


def test_a_gradient_that_is_wrong_by_orders_of_magnitude_is_explained(golden, tmp_path, monkeypatch):
    """A missing 1 / cosh^2 far out, where it is 1e-27."""

    def without_slope(d_residual, saved):
        a, phi_bar, beta = saved
        d_x = beta / appearance.Y00 * d_residual
        return appearance.AppearanceGrads(np.einsum("cn,k->ckn", d_x, phi_bar), np.einsum("cn,ckn->k", d_x, a))

    monkeypatch.setattr(appearance, "appearance_reverse", without_slope)
    said = causes(golden, tmp_path, "appearance")
    assert "with `beta / Y00` where `beta / Y00 * (1 / np.cosh(" in said and every_output(golden, "appearance") in said


def test_a_number_that_fits_few_numbers_is_not_believed(golden, tmp_path):
    """Losses alone are wrong, by a factor that is no constant of the method, and their gradients in another way."""
    for case in cases_of(golden, "masked_l1"):
        for name, output in case.outputs.items():
            value = golden.array(case, output.file)
            write_npy(tmp_path / case.name / f"{name}.npy", value * (1.0137 if name == "loss" else 1 + value**2))
    assert report(golden, tmp_path, "masked_l1") == ""


def test_noise_is_not_explained_and_time_is_kept(golden, tmp_path, monkeypatch):
    random = np.random.default_rng(0)
    for case in cases_of(golden, "projection"):
        for name, output in case.outputs.items():
            value = golden.array(case, output.file)
            noise = 1 + random.uniform(0.1, 0.9, value.shape) if value.dtype.kind == "f" else 1
            write_npy(tmp_path / case.name / f"{name}.npy", stored(np.asarray(value * noise, value.dtype)))
    began = time.process_time()
    assert report(golden, tmp_path, "projection", seconds=1.0) == ""
    assert time.process_time() - began < 3.0


def test_the_definition_is_as_before(golden, tmp_path, monkeypatch):
    monkeypatch.setattr(masked_l1, "masked_l1_reverse", lambda d, saved: -RIGHT[4][2](d, saved))
    before = {name: value for name, value in vars(masked_l1).items() if name != "masked_l1_reverse"}
    assert line_of(masked_l1, "# (11.1)") in causes(golden, tmp_path, "masked_l1")
    assert {name: value for name, value in vars(masked_l1).items() if name != "masked_l1_reverse"} == before
    monkeypatch.undo()
    assert causes(golden, tmp_path, "masked_l1") == ""


def test_the_parts_of_an_operation_are_those_that_the_definition_calls(golden):
    operations = definition_operations()
    parts = {}
    for name, operation in operations.items():
        case = cases_of(golden, name)[0]
        given = in_precision(golden.inputs(case), "float64")
        with np.errstate(all="ignore"):
            places = executed({"forward": lambda g=given, s=operation, c=case: s.compute(g, c.settings)})
        parts[name] = {place.name for place in places if not place.is_constant}
    own = {name: f"{s.function.split('.')[-2]}.{s.function.rpartition('.')[2]}" for name, s in operations.items()}
    for name in PARTS.keys() & parts.keys():
        assert {part for part in operations if part != name and own[part] in parts[name]} - {"frequencies"} <= made_of(
            name
        )
        for part in set(PARTS[name]) & parts.keys() - {"exposure", "calibration"}:
            assert own[part] in parts[name], (name, part)
