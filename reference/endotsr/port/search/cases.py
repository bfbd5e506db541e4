"""The cases of one operation with the port's answers, and comparisons of other answers with them."""

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.about import axes_of
from endotsr.port.judge.compare import scale_of
from endotsr.port.judge.diagnose import made_of
from endotsr.port.judge.format import FLIP_BUDGET, Case
from endotsr.port.judge.npy import Refused, read_plain
from endotsr.port.judge.records import CaseReport
from endotsr.port.judge.relate import FITS
from endotsr.port.judge.store import Golden, in_precision
from endotsr.port.operations.definition import definition_operations
from endotsr.port.operations.operation import Inputs, Operation, Outputs, Settings, tidy
from endotsr.port.search.places import executed

AFTER = 2  # compared iterations of a trajectory from its first wrong one on; those before it are compared too
PIECE = 1e-6  # step length of a derivative, in units of the input
DERIVATIVE = 1e-4  # its allowed error, relative to the sum of the magnitudes of its terms


class Answered:
    """One case: the outputs of the port that can be compared, and the tolerances of rounding.

    A trajectory is cut soon after its first wrong iteration: later errors may follow from it.
    """

    def __init__(self, golden: Golden, case: Case, report: CaseReport, outputs: Path, precision: str) -> None:
        self.case, self.settings, self.folder = case, case.settings, outputs / case.name
        rules = [asked.compare for asked in case.outputs.values() if asked.dtype == "real"]
        self.tolerance = max((r.float64 if precision == "float64" else r.float32 for r in rules), default=0.0)
        self.inputs: Inputs = in_precision(golden.inputs(case), "float64")
        along = [name for name, asked in case.outputs.items() if asked.order == "iteration"]
        # the first wrong entry of each output of a trajectory, and the number of its compared iterations
        self.wrong_from = {o.name: o.index[0] for o in report.outputs if o.index and o.name in along}
        self.length = min(self.wrong_from.values()) + AFTER if self.wrong_from else 0
        self.inputs = {name: self._short(name, array) for name, array in self.inputs.items()}
        _lock(tuple(self.inputs.values()))
        late = {name for name, first in self.wrong_from.items() if first >= self.length}
        self.refused = {o.name for o in report.outputs if o.status == "refused"} - late
        self.got: dict[str, NDArray] = {}
        self.unit: dict[str, NDArray | float] = {}
        self.expected: Outputs = {}
        for name in (o.name for o in report.outputs if o.status in ("passed", "refused")):
            if self.length and name.startswith("final_"):
                continue  # after the last iteration
            asked, rule = case.outputs[name], case.outputs[name].compare
            expected = golden.array(case, asked.answer(report.answer))
            try:
                got = read_plain(outputs / case.name / f"{name}.npy", outputs, 8 * max(expected.size, 1))
            except Refused:
                continue
            tolerance = rule.float64 if precision == "float64" else rule.float32
            if got.shape == expected.shape and rule.kind != "identical":
                self.got[name] = self._short(name, got.astype(np.float64))
                self.expected[name] = self._short(name, expected.astype(np.float64))
                finite = np.where(np.isfinite(self.got[name]), self.got[name], 0.0)
                kind = rule.scale or "max"
                scale = scale_of(expected, kind)
                if finite.any():  # an error of orders of magnitude has roundings of its own size
                    scale = np.maximum(scale, scale_of(finite, kind))
                self.unit[name] = 0.0 if rule.kind == "exact" else FITS * tolerance * scale
        self.refused &= self.got.keys()
        self.right: Outputs = {}
        self.saved: Any = None
        self.forward_names: list[str] = []
        self.gradient_names: list[str] = []

    def _short(self, name: str, array: NDArray) -> NDArray:
        """The compared iterations of an array with one entry per iteration; other arrays unchanged."""
        return array[: self.length] if self.length and axes_of(name, array.ndim) == "iteration" else array

    def keep_reproduced(self, operation: Operation) -> None:
        """Compare only outputs that the definition computes as the vectors have them; of a needle it loses digits."""
        self.begin(operation)
        got, self.got = self.got, self.expected
        self.got = {name: array for name, array in got.items() if self.same(self.right, [name])}
        self.refused &= self.got.keys()

    def begin(self, operation: Operation) -> None:
        """Compute the right outputs, and separate forward outputs from gradients."""
        forward, self.saved = self.forward(operation, self.inputs, self.settings)
        _lock(self.saved)
        self.right = {**forward, **self.reverse(operation, self.inputs, self.saved)}
        self.forward_names = [name for name in self.got if name in forward]
        self.gradient_names = [name for name in self.got if name not in forward]

    def alone(self, name: str, wrong: Collection[str]) -> "Answered":
        """The same case with one of its wrong outputs, and without the others."""
        one = copy(self)
        one.got = {key: array for key, array in self.got.items() if key == name or key not in wrong}
        one.refused = self.refused & {name}
        return one

    def beside(self, operation: Operation) -> "Answered":
        """The same case against the definition as it stands now, with a first change: what that explains is right."""
        one = copy(self)
        one.begin(operation)
        one.refused = {name for name in one.got if not one.same(one.right, [name])}
        return one

    def forward(self, operation: Operation, inputs: Inputs, settings: Settings) -> tuple[Outputs, Any]:
        """Outputs without gradients, and the saved tuple of the reverse pass."""
        found, saved = operation.forward(inputs, settings)
        more = {} if operation.extra is None else operation.extra(inputs, settings, saved)
        kept = {name: self._short(name, array) for name, array in tidy({**found, **more}).items()}
        return kept, (saved, tuple(found))

    def reverse(self, operation: Operation, inputs: Inputs, saved: Any) -> Outputs:
        """Gradients, if the case requests them."""
        own, names = saved
        given = {name: inputs[f"d_{name}"] for name in names if f"d_{name}" in inputs}
        if operation.is_loss:
            given = dict.fromkeys(names, np.array(1.0)) | given
        return (
            tidy(operation.reverse(given, own)) if operation.reverse is not None and given.keys() == set(names) else {}
        )

    def same(self, found: Mapping[str, NDArray], names: Sequence[str] | set[str]) -> bool:
        """Whether all of these outputs equal the port's, within rounding and the allowed flips."""
        return all(name in found and self._same(name, np.asarray(found[name])) for name in names)

    def _same(self, name: str, value: NDArray) -> bool:
        rule = self.case.outputs[name].compare
        if value.shape != self.got[name].shape or value.dtype.kind == "c":
            return False
        return self.off(name, value) <= (rule.flips if rule.kind == FLIP_BUDGET else 0)

    def off(self, name: str, value: NDArray, until: int | None = None) -> int:
        """Number of entries of an output that differ from the port's; of a trajectory, up to an iteration."""
        got = self.got[name]
        got, value = (got, value) if until is None else (got[:until], value[:until])
        with np.errstate(all="ignore"):
            near = (np.abs(value - got) <= self.unit[name]) | (value == got)
        return int((~(near | (np.isnan(value) & np.isnan(got)))).sum())

    def spoiled(self, found: Mapping[str, NDArray]) -> int:
        """Number of outputs that passed, or were right at the start of a trajectory, and no longer are."""
        passed = sum(not self.same(found, [name]) for name in self.got if name not in self.refused)
        begun = ((name, self.wrong_from[name]) for name in self.refused if name in self.wrong_from)
        return passed + sum(self.off(name, found[name], first) > 0 for name, first in begun)

    def wrong(self, names: Sequence[str]) -> int:
        """Number of entries of some outputs that a change must explain."""
        return sum(self.off(name, self.right[name]) for name in self.refused.intersection(names))

    def distance(self, found: Mapping[str, NDArray], names: Sequence[str]) -> NDArray | None:
        """Differences of real outputs from the port's, relative to the largest magnitude of each.

        Where the port's is not finite, the difference counts as 0. None: another shape, or a number that is not finite.
        """
        parts = []
        for name in names:
            value, got = np.asarray(found.get(name, np.nan), np.float64), self.got[name]
            size = float(np.abs(got[np.isfinite(got)]).max(initial=0)) or 1.0
            if value.shape != got.shape:
                return None
            parts.append(np.where(np.isfinite(got), value - got, 0).reshape(-1) / size)
        joined = np.concatenate(parts) if parts else np.zeros(0)
        return joined if np.isfinite(joined).all() else None

    def is_derivative(self, operation: Operation) -> bool | None:
        """Whether the port's gradients are the derivatives of the current forward pass, along one line.

        None: undecidable here
        """
        names = [name for name in self.inputs if f"d_{name}" in self.got]
        if not names:
            return None
        random = np.random.default_rng(0)
        along = {name: random.uniform(-1, 1, self.inputs[name].shape) for name in names}
        values: list[Any] = []
        if not all(np.isfinite(array).all() for array in self.inputs.values() if array.dtype.kind == "f"):
            return None
        for sign in (1, -1):
            moved = {**self.inputs, **{name: self.inputs[name] + sign * PIECE * along[name] for name in names}}
            found, _ = operation.forward(moved, self.settings)
            values.append(sum((np.asarray(self.inputs.get(f"d_{n}", 1.0)) * found[n]).sum() for n in found))
        parts = [float((self.got[f"d_{name}"] * along[name]).sum()) for name in names]
        size = float(np.abs([(np.abs(self.got[f"d_{n}"] * along[n])).sum() for n in names]).sum())
        found = (values[0] - values[1]) / (2 * PIECE)
        return bool(abs(found - sum(parts)) <= DERIVATIVE * size) if size > 0 and np.isfinite(found + size) else None


def _lock(value: Any) -> None:
    """Make arrays read-only: a change that wrote into them would affect the next one."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, tuple | list):
        for part in value:
            _lock(part)


def of_the_parts(operation: str, golden: Golden) -> set[str]:
    """Functions of the definition that the parts of an operation execute, each part in its last case."""
    operations = definition_operations()
    parts = made_of(operation) & operations.keys()
    cases = {case.operation: case for case in golden.cases if case.operation in parts}
    calls = {
        part: lambda part=part: operations[part].compute(
            in_precision(golden.inputs(cases[part]), "float64"), cases[part].settings
        )
        for part in parts & cases.keys()
    }
    return {place.name for place in executed(calls)}
