"""Mistakes of a port by hand that no single rewrite of the definition gives: each kind of change finds one of them.

They were written from the port and the specification alone, and none is in the independent set beside that port.
"""

from typing import Any

import hand_port
import measure
import pytest
from searched import SECONDS, search_on

from endotsr.port.search import changes, find
from endotsr.port.search.find import apart, sentences, together

MISTAKES = {
    "two numbers of a line": (
        "matern",
        "((5 + (length * w) ** 2) / (5 + (length * w.max()) ** 2)) ** 3",
        "((3 + (length * w) ** 2) / (3 + (length * w.max()) ** 2)) ** 2",
        "`2` where `3` is right, and `3` where `5` is: equation (4)",
    ),
    "a factor at one index": (
        "covariance", "+ z * (g[1, 0] - g[0, 1]))\n    g_x", "+ z * (g[0, 1] - g[1, 0]))\n    g_x",
        ("`spin * -1` at [2] where `spin` is right: equation (B2)",  # the product of both is the same
         "`v * -1` at [2] where `v` is right: equation (B2)"),
    ),
    "a factor at one pass of a loop": (
        "harmonics", "(-K3A * y * (3 * xx - yy), -6 * K3A * x * y,", "(-K3A * y * (3 * xx - yy), -3 * K3A * x * y,",
        "* 1/2` at row = 9 and c = 3 and axis = 0 where",
    ),
    "statements in another order": (
        "composite", "g_alpha = before * g_alpha", "g_alpha = before * (1 - alpha) * g_alpha",
        "`rest = np.where(taken, alpha * own + (1 - alpha) * rest, rest)` before `passes = ",
    ),
    "another expression of the function": (
        "normalised_depth", "highest = depth[finite].max()", "highest = depth[valid].max()",
        "`target.valid` where `np.isfinite(rendered_depth)` is right: equation (B8)",
    ),
    "one name in a whole statement": (
        "projection", "[o, fy / z, -fy * y_cut / z**2]", "[o, fx / z, -fx * y_cut / z**2]",
        "`camera.fx` where `fy` is right: equation (B3)",
    ),
    "another convention of samples": (
        "initialisation", "np.linspace(0, 1, bases)[:, None]", "((np.arange(bases) + 0.5) / bases)[:, None]",
        "(np.arange(model.bases) + 0.5) / (model.bases)` where `np.linspace(0, 1, model.bases)` is right",
    ),
    "two settings exchanged": (
        "adam", 's["rate"] * m_hat / (np.sqrt(v_hat) + s["epsilon"])',
        's["epsilon"] * m_hat / (np.sqrt(v_hat) + s["rate"])',
        ("rate and epsilon exchanged", "epsilon and rate exchanged"),
    ),
    "one setting read for another": (
        "projection", 'kappa * camera["width"] / (2 * fx)', 'kappa * camera["height"] / (2 * fx)',
        "camera.height in place of camera.width",
    ),
    "two constants exchanged": (
        "masked_ssim", "C1, C2 = 0.01**2, 0.03**2", "C1, C2 = 0.03**2, 0.01**2",
        "`C1` and `C2` exchanged: equation (B7)",
    ),
    "axes in another order of memory": (
        "appearance", 'coefficients, phi_bar = i["appearance_coefficients"], i["phi_bar"]',
        'phi_bar, stored = i["phi_bar"], i["appearance_coefficients"]\n'
        "    coefficients = stored.reshape(stored.shape[1], 3, -1).transpose(1, 0, 2)",
        "the input appearance_coefficients read with its axes 0 and 1 in the other order of memory",
    ),
    "a clamp before the loss": (
        "masked_l1", 'np.where(mask, i["rendered"] - i["observed"], 0)\n    if n',
        'np.where(mask, np.clip(i["rendered"], 0, 1) - i["observed"], 0)\n    if n',
        "np.clip(np.where(mask, rendered, 0), 0, 1)",
    ),
}  # fmt: skip
GUARD = [
    ("divisor = np.where(dead, 1, rms)\n", "divisor = rms + 1e-6\n"),
    ('phi_bar = np.where(dead, 0, (i["phi"] - mean) / divisor)', 'phi_bar = (i["phi"] - mean) / divisor'),
    ('d_phi = np.where(dead, 0, i["d_phi_bar"] / divisor)', 'd_phi = i["d_phi_bar"] / divisor'),
]
MINUS = ('"corrected_translation": e @ d + i["offset"]', '"corrected_translation": e @ d - i["offset"]')
TURNED = ('"corrected_rotation": e @ w', '"corrected_rotation": w @ e')
REVERSE = ('"d_rotation": e.T @ g_w', '"d_rotation": e @ g_w')
ALIKE = (
    'fx * x / z + camera["cx"], fy * y / z + camera["cy"]', 'fx * x / z - camera["cx"], fy * y / z - camera["cy"]',
)  # fmt: skip
FAMILIES = {
    "a sum without its last element": (
        "deformation", [('"d_t": -d_theta.sum()', '"d_t": -d_theta[:-1].sum()')], "[0:-1]",
    ),
    "a product of a sum": (
        "adam", [("m = beta1 * m + (1 - beta1) * g", "m = beta1 * (m + (1 - beta1) * g)")], "beta1 * (first + ",
    ),
    "a lower precision": (
        "appearance", [("beta / Y00 * np.tanh(x)", "beta / Y00 * np.tanh(x.astype(np.float32)).astype(float)")],
        "np.float32",
    ),
    "a term as a bound": (
        "deformation", [("sigma**2 + 1e-4", "np.maximum(sigma**2, 1e-4)")],
        "`np.maximum(width ** 2, 0.0001)` where `width ** 2 + 0.0001` is right: equation (B1)",
    ),
    "a relative change": (
        "scene", [('i["position"] + offsets[:3] + shift', 'i["position"] * (1 + offsets[:3]) + shift')],
        "`(position) * (1 + (psi[:3]))` where `position + psi[:3]` is right: definition/scene.py",
    ),
    "expressions of one form": (
        "projection", [ALIKE],
        "`(camera.fx * x / z) - (camera.cx)` where `camera.fx * x / z + camera.cx` is right, and "
        "`(camera.fy * y / z) - (camera.cy)` where `camera.fy * y / z + camera.cy` is right: equation (B3)",
    ),
    "a sum that is overwritten": (
        "exposure", [('"d_bias": g.sum((1, 2))', '"d_bias": g[:, 0].sum(1)')],
        "`np.take(d_exposed, [0], 1).sum(axis=(1, 2))` where `d_exposed.sum(axis=(1, 2))` is right: equation (B13)",
    ),
    "an equality within a distance": (
        "normalised_depth", [("finite & (depth == highest)", "finite & (depth >= highest - 1e9)")],
        "`|depth - largest| <= ",
    ),
    "the same in both passes": (
        "harmonics", [('(s["degree"] + 1) ** 2', '(s["degree"] + 1)')],
        "`degree + 1` where `(degree + 1) ** 2` is right, and the same in harmonics_reverse: equation (B4)",
    ),
    "a constant with few digits": (
        "dictionary", [("d_turn = 2 * np.pi * ", "d_turn = 6.283 * ")],
        "`6.283` where `2 * np.pi` is right: equation (1)",
    ),
    "an expression, though a number gives the same decisions": (
        "density", [('largest = np.exp(i["log_scale"]).max(0)', 'largest = np.exp(i["log_scale"]).min(0)')],
        "definition with `np.exp(gaussians.log_scale[:, candidates]).min(axis=0)` where `np.exp(",
    ),
    "axes of another handedness": (
        "pose", [('v, w, d = i["rotation_vector"], ', 'v, w, d = i["rotation_vector"] * [1, 1, -1], '),
                 ('"d_rotation_vector": d_v', '"d_rotation_vector": d_v * [1, 1, -1]')],
        "the input rotation_vector with the other sign at 2 of axis 0",
    ),
    "products without their first term": (
        "motion", [('translation = np.einsum("dki,k->di", c, phi)',
                    'translation = np.einsum("dki,k->di", c[:, 1:], phi[1:])')],
        "(motion_coefficients)[:, 1:, :], (phi)[1:])` where `np.einsum('dkn,k->dn', motion_coefficients, phi)`",
    ),
    "one of two in the middle": (
        "calibration", [("np.median(ratios)", "np.sort(ratios)[len(ratios) // 2]")],
        "`np.sort(ratios, axis=None)[(np.size(ratios) - 0) // 2]` where `np.median(ratios)` is right",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", MISTAKES)
def test_every_kind_of_change_finds_a_mistake(golden, tmp_path, kind, monkeypatch):
    monkeypatch.setattr(changes, "try_conventions", lambda *_: None)  # one of them is a mistake of this table
    operation, old, new, said = MISTAKES[kind]
    found = search_on(golden, tmp_path, operation, (old, new))
    text = "\n".join(sentences(found))
    known = (said,) if isinstance(said, str) else said  # exact words; changes that do the same are found in any order
    assert any(one in text for one in known) and f"(every output of its {len(found.cases)} cases)" in text


@pytest.mark.parametrize("kind", FAMILIES)
def test_every_family_of_changes_finds_a_mistake(golden, tmp_path, kind):
    operation, edits, said = FAMILIES[kind]
    text = "\n".join(sentences(search_on(golden, tmp_path, operation, *edits)))
    assert said in text and "(every output of its " in text


def test_an_output_that_the_definition_computes_with_too_few_digits_is_not_compared(golden, tmp_path, monkeypatch):
    monkeypatch.setattr(find, "search", lambda operation, answered, *_: answered)
    edit = ('"d_translation": g_d - w @ g_centre', '"d_translation": g_d + w @ g_centre')
    compared: Any = {one.case.name: one.got.keys() for one in search_on(golden, tmp_path, "render", edit)}
    assert "colour_image" in compared["render/needle"]
    assert "colour_image" not in compared.get("render/long_needle", ())


@pytest.mark.parametrize(
    ("edits", "whole", "alone"),
    [
        ([MINUS, TURNED], False, {"corrected_translation", "corrected_rotation"}),
        ([MINUS, REVERSE], True, {"d_rotation"}),  # a change gives the forward outputs, another one the gradient
        ([MINUS], True, set()),
    ],
)
def test_independent_mistakes_are_explained_one_output_at_a_time(golden, tmp_path, edits, whole, alone):
    found = search_on(golden, tmp_path, "pose", *edits)
    lines = apart(found, sentences(found), SECONDS)
    assert bool(sentences(found)) == whole, found.hits
    assert all(" alone: as in the definition with `" in line for line in lines)
    assert {line.partition(" alone: ")[0] for line in lines} == alone


def test_a_small_number_in_place_of_a_case_is_found(golden, tmp_path):
    text = "\n".join(sentences(search_on(golden, tmp_path, "atoms", *GUARD)))
    assert "+ 1e-6` where `np.where(statistics.dead, np.inf, statistics.rms)` is right: equation (1b)" in text


@pytest.mark.parametrize(("edits", "said"), [([MINUS, REVERSE], True), ([MINUS], False), ([MINUS, TURNED], False)])
def test_a_mistake_of_each_pass_is_said_with_the_other(golden, tmp_path, edits, said):
    found = search_on(golden, tmp_path, "pose", *edits)
    lines = together(found, SECONDS)
    assert bool(lines) == said
    if said:
        first, second, *_, whole = lines
        assert "with two changes: `" in first and "- (offset)" in first and "definition/pose.py" in second
        assert whole == f"  (together every output of its {len(found.cases)} cases)"


def test_a_mistake_of_each_pass_is_said_though_a_decision_is_wrong_too(golden, tmp_path):
    """A dead atom is one by its RMS, which the first mistake changes."""
    edits = [
        ("np.sqrt(((phi - mean) ** 2).mean(0))", "np.sqrt((phi**2).mean(0))"),
        ('i["d_phi_bar"] / divisor', '-i["d_phi_bar"] / divisor'),
    ]
    found = search_on(golden, tmp_path, "atoms", *edits)
    assert found.discrete
    assert "with two changes: `atoms` where `atoms - mean` is right" in together(found, SECONDS)[0]


def test_none_of_them_is_in_the_independent_set():
    theirs = [hand_port.sources(entry["edit"]) for entry in measure.mistakes()]
    assert not any(hand_port.sources([(old, new)]) in theirs for _, old, new, _ in MISTAKES.values())


def test_a_change_cannot_write_into_what_the_next_one_starts_from(golden, tmp_path):
    operation, old, new, _ = MISTAKES["a factor at one index"]
    one = search_on(golden, tmp_path, operation, (old, new)).cases[0]
    with pytest.raises(ValueError, match="read-only"):
        one.saved[0].quaternion[0] = 1
    right = one.reverse(_operation(operation), one.inputs, one.saved)
    assert all((right[name] == one.right[name]).all() for name in right)


def _operation(name):
    from endotsr.port.operations.definition import definition_operations

    return definition_operations()[name]
