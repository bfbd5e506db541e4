"""The wrong versions of ports: each changes one place, and the cases refuse those that the record says."""

import ast
import json
import tomllib
from pathlib import Path

import pytest
from made_up_ports import case_of
from mutants import fuzz, ports, survey
from mutants.kinds import Source, habits, wrong_versions

from mutation.mutator import in_place

RECORD = json.loads((Path(__file__).parents[3] / "docs/results/golden_mutants.json").read_text("utf-8"))
KINDS = {
    "np.maximum(x, 0) * 2": "clamp removed", "np.clip(x, 0, 1)": "clamp removed", "np.where(y, x, 0)": "selection",
    "x and y": "part of a condition", "x & y": "part of a condition", "x if y else 0": "part of a condition",
    "x / y": "small number added", "np.sqrt(x)": "small number added", "x * y": "dropped factor",
    "x.mean()": "reduction", "np.tanh(x)": "reduction", "np.sort(x)": "call left out", "x[::-1]": "call left out",
    "x.T": "transpose left out", "f(x, y)": "arguments exchanged", "x.fx": "neighbouring name", "x + 1.5": "constant",
}  # fmt: skip


@pytest.mark.parametrize("text", KINDS)
def test_a_habit_changes_one_place(text):
    tree = ast.parse(f"def one(x, y):\n    z = {text}\n    return z")
    found = {(change.kind, change.name) for change in habits(tree.body[0])}
    assert KINDS[text] in {kind for kind, _ in found}
    assert {"clamp added", "single precision"} <= {kind for kind, _ in found}
    assert all(name for _, name in found) and ast.unparse(tree).count(text) == 1


def test_a_wrong_version_runs_in_place_of_the_right_one():
    space: dict = {}
    text = "def half(x, y):\n    return x / 2\n"
    exec(compile(text, "half.py", "exec"), space)
    source = Source("m", text, {"half": space["half"]})
    answers = set()
    for function, mutant in wrong_versions(source):
        assert mutant.kernel == "m.half" and mutant.name.startswith("m.half: ")
        with in_place(function, mutant.code):
            try:
                answers.add(space["half"](8, 3))
            except NameError:  # np is not in this module
                continue
    assert space["half"](8, 3) == 4 and {16, 8, 1.5} <= answers


def test_the_cases_refuse_what_the_record_says(golden):
    found = survey.surveyed(ports.by_hand(), golden, "hand_losses")
    results = {result: {n for n, (_, r, _) in found.items() if r == result} for _, result, _ in found.values()}
    listed = {name for name in RECORD["apart"]["by_hand"] if name.startswith("hand_losses.")}
    assert listed <= results["passed"] and len(results["refused"]) > 4 * len(results["passed"])


def test_a_survivor_that_the_cases_lose_is_seen(golden):
    """Without the case of numbers beyond 1, a clamp of the coefficients passes and another request tells it apart."""
    port = ports.definition()
    few = golden._replace(cases=[case for case in golden.cases if case.name == "motion/generic"])
    found = survey.surveyed(port, few, "motion")
    clamped = {n for n, (kind, result, _) in found.items() if kind == "clamp added" and result == "passed"}
    assert clamped
    apart = survey.apart(port, survey.other_requests(port, few), clamped)
    assert apart and {operation for _, _, operation in apart.values()} == {"motion"}


def test_requests_are_repeatable_and_in_single_precision(golden):
    case = case_of(golden, "appearance/generic")
    inputs = golden.inputs(case)
    one, other = (fuzz.drawn(case, inputs, [case], 3) for _ in range(2))
    assert not fuzz.apart(one[0], other[0]) and one[1] == other[1]
    assert fuzz.apart(one[0], inputs)
    for array in one[0].values():
        assert (array == array.astype("float32")).all()


def free_groups():
    """The survivors that stay, by reason."""
    return tomllib.loads(Path(__file__).with_name("free.toml").read_text("utf-8"))["group"]


def test_what_stays_unseen_has_a_reason_and_is_a_wrong_version_of_today():
    names = [name for group in free_groups() for name in group["names"]]
    assert len(set(names)) == len(names) and all(group["reason"].endswith(".") for group in free_groups())
    changed, known = {name.partition(":")[0] for name in names}, set()
    for source in (*ports.definition().sources, *ports.by_hand().sources):
        own = {name: one for name, one in source.functions.items() if f"{source.name}.{name}" in changed}
        known |= {mutant.name for _, mutant in wrong_versions(source._replace(functions=own))}
    assert not set(names) - known
    assert set(names) == {name for listed in RECORD["apart"].values() for name in listed}
    refused, of = RECORD["refused"], RECORD["observable"]
    assert of - refused["now"] == sum(len(group["names"]) for group in free_groups() if group["left"])
