"""Arrays inside an operation: a port is told the first wrong one, and one without any is no worse off."""

import re
from pathlib import Path

import hand_port
import numpy as np
from made_up_ports import cases_of

from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.report import as_table
from endotsr.port.judge.store import in_precision
from endotsr.port.judge.verdict import judge
from endotsr.port.operations.definition import definition_operations
from endotsr.port.search.find import explain
from endotsr.port.search.inside import INSIDE, values

ROOT = Path(__file__).parents[3]

RIGHT = 't = np.einsum("rjn,jln->rln", j, wr)'
# J is right where it is used for M and wrong by its middle column in T: two places, no single change of the definition
WRONG = [[RIGHT, "j = j * np.array([1.0, 1.25, 1.0])[None, :, None] + 0.01 * j**2\n    " + RIGHT]]


def written(golden, folder, edits, inside=()):
    """The outputs of the projection of the port by hand, and some of its arrays inside."""
    port = hand_port.operations(edits)
    module = port["projection"].__globals__
    for case in cases_of(golden, "projection"):
        given = golden.inputs(case)
        found = hand_port.answer(port, "projection", given, case.settings)
        for name in case.outputs:
            write_npy(folder / case.name / f"{name}.npy", found[name])
        p = module["project"](given, case.settings)
        arrays = {"point": np.array(p["view"]), "jacobian": p["jacobian"], "t": p["t"], "determinant": p["det"]}
        for name in inside:
            shown = np.where(p["visible"], arrays[name], 0)
            write_npy(folder / case.name / "inside" / f"{name}.npy", np.ascontiguousarray(shown))
    return folder


def report(golden, folder, seconds=0.05):
    found = judge(golden, folder, "float64", level=2, only="projection")
    if found.first_wrong:
        explain(golden, found, folder, seconds)
    return found


def test_the_first_wrong_array_is_named_with_what_is_right_before_it(golden, tmp_path):
    found = report(golden, written(golden, tmp_path, WRONG, ("t", "point", "jacobian")))
    (said,) = found.inside
    assert re.match(r"inside projection/\w+ the first wrong array is jacobian: .*; right before it: point$", said)
    assert said in as_table(found).splitlines()[1]


def test_arrays_that_are_right_put_the_mistake_behind_them(golden, tmp_path):
    after = [["a = (m[0] ** 2).sum(0) + eps", "a = (m[0] ** 2).sum(0) + eps * m[1, 0] ** 2"]]
    found = report(golden, written(golden, tmp_path, after, ("point", "jacobian", "t")))
    assert re.match(r"inside projection/\w+ point, jacobian, t are right: look at what follows", found.inside[0])


def test_what_cannot_be_read_or_has_another_shape_is_said(golden, tmp_path):
    written(golden, tmp_path, WRONG)
    for case in cases_of(golden, "projection"):
        write_npy(tmp_path / case.name / "inside" / "point.npy", np.zeros(7))
    assert "first wrong array is point: shape (7,); expected (3, " in report(golden, tmp_path).inside[0]
    for case in cases_of(golden, "projection"):
        (tmp_path / case.name / "inside" / "point.npy").write_bytes(b"no array")
    assert "first wrong array is point: " in report(golden, tmp_path).inside[0]


def test_a_port_without_such_arrays_is_asked_once_and_can_say_that_it_has_none(golden, tmp_path):
    written(golden, tmp_path, WRONG)
    found = report(golden, tmp_path)
    (asked,) = [note for note in found.notes if note.startswith("to look inside")]
    assert "/inside/: point (3, 12), jacobian (2, 3, 12), t (2, 3, 12), " in asked and found.inside == []
    (tmp_path / "not_ported.txt").write_text("inside  # nothing to show\n")
    silent = report(golden, tmp_path)
    assert silent.notes == [] and silent.claim == found.claim and silent.levels == found.levels


def test_a_right_port_is_told_nothing(golden, tmp_path):
    found = report(golden, written(golden, tmp_path, [], ("point",)))
    assert found.inside == [] and found.notes == [] and found.level == -1


def test_every_array_is_computed_in_some_case_and_stands_in_the_guide(golden):
    guide = (ROOT / "docs" / "guides" / "port.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", guide.split("(guide-port-inside)=")[1], re.M))
    operations = definition_operations()
    for operation, names in INSIDE.items():
        found = set()
        for case in cases_of(golden, operation):
            one = _Given(in_precision(golden.inputs(case), "float64"), case.settings)
            found |= values(operations[operation], one).keys()
        assert found == names.keys(), operation
        told = set(re.findall(r"`(\w+)`", rows[operation]))
        if operation == "render":
            told |= set().union(*(INSIDE[other].keys() for other in ("projection", "harmonics", "composite")))
        assert {re.sub(r"_[23]$", "_1", name) for name in names} <= told, operation


class _Given:
    def __init__(self, inputs, settings):
        self.inputs, self.settings = inputs, settings

    def forward(self, operation, inputs, settings):
        return operation.forward(inputs, settings)
