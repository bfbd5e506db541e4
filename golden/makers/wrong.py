"""Wrong ports: each is a copy of the reference with one plausible mistake in its source, forward and reverse.

In: the golden cases as inputs and settings. Out: the answers of a port with the mistake, for the examined operations.
These answers give the size and the fingerprints of the mistake. The judge must reject every wrong port and name its
mistake.
"""

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.store import Golden, in_precision
from endotsr.port.operations.operation import Inputs, Outputs
from endotsr.port.reference import stored
from makers.copies import Edit, changed_copy, without_compiler


class WrongPort(NamedTuple):
    """A port with one mistake."""

    flag: str  # the name of the mistake
    title: str
    wrong: str  # the wrong rule and the right one
    operations: tuple[str, ...]  # on which the mistake is examined
    edits: tuple[Edit, ...]  # the mistake, in the source of the reference
    rounding: bool = False  # loses digits and is right otherwise: its wrong digits differ from port to port

    def joined(self, other: "WrongPort") -> "WrongPort":
        """The same mistake in the operations of a further family, too."""
        return self._replace(operations=self.operations + other.operations, edits=self.edits + other.edits)


SLOW = ("render", "objective", "training")  # operations that take seconds without the compiler
ALWAYS = "render/paper"  # their only case on which every mistake in a kernel is examined


class Question(NamedTuple):
    """A case as a request to a wrong port."""

    name: str
    operation: str
    inputs: Inputs
    settings: Mapping[str, Any]
    made_for: tuple[str, ...]  # flags


def wrong_ports(family: str) -> Iterator[WrongPort]:
    """The mistakes of a family, from `<family>.toml` in this folder, if any.

    An entry has the keys `title`, `wrong` and `changes`, and may have `operations` and `rounding`. A change is [module,
    old text, new text, number of places]. The default module is in the head of the file, the default number is 1.
    `operations` in the head is the default of the entries. An entry without a title has the same mistake as the entry
    with this name in another family: it adds its operations and changes.
    """
    file = Path(__file__).with_name(f"{family}.toml")
    table = tomllib.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    module, operations = table.pop("module", ""), table.pop("operations", "")
    for flag, entry in table.items():
        edits = tuple(_edit(change, module) for change in entry["changes"])
        examined = tuple(entry.get("operations", operations).split())
        texts = (entry.get("title", ""), entry.get("wrong", ""))
        yield WrongPort(flag, *texts, examined, edits, entry.get("rounding", False))


def _edit(change: Sequence[Any], module: str) -> Edit:
    *texts, times = change if isinstance(change[-1], int) else (*change, 1)
    return Edit(texts[0] if len(texts) > 2 else module, texts[-2], texts[-1], times)


class Wrong(NamedTuple):
    """The answer of a wrong port to a case; `single` in float32, for mistakes that only lose digits."""

    double: Outputs
    single: Outputs | None


def answers(wrong_port: WrongPort, questions: Iterable[Question]) -> dict[str, Wrong]:
    """The answers of the wrong port, by case, to the questions on which it is examined."""
    found, examined = {}, [question for question in questions if is_examined(wrong_port, question)]
    if not examined:
        return {}
    with changed_copy(wrong_port.edits) as operation, np.errstate(all="ignore"):
        for question in examined:

            def run(precision: str, question: Question = question) -> Outputs:
                settings = dict(question.settings) | {"_compositor": "definition"}
                return operation(question.operation).compute(in_precision(question.inputs, precision), settings)

            found[question.name] = Wrong(run("float64"), run("float32") if wrong_port.rounding else None)
    return found


def is_examined(wrong_port: WrongPort, question: Question) -> bool:
    """Whether a mistake is examined on a case; changed kernels only on some of the slow operations."""
    if question.operation not in wrong_port.operations:
        return False
    slow = question.operation in SLOW and without_compiler(wrong_port.edits)
    return not slow or wrong_port.flag in question.made_for or question.name == ALWAYS


def answer_wrongly(golden: Golden, outputs: Path, wrong_port: WrongPort, *, spoiled_only: bool = False) -> int:
    """Write the outputs of a wrong port in float64; returns the number of cases on which its mistake is examined.

    All other cases have the expected outputs; with `spoiled_only` they are not written.
    """
    questions = [
        Question(case.name, case.operation, golden.inputs(case), case.settings, case.flags) for case in golden.cases
    ]
    made = answers(wrong_port, questions)
    for case in golden.cases:
        if case.name in made:
            found = {name: stored(array) for name, array in made[case.name].double.items() if name in case.outputs}
        elif spoiled_only:
            continue
        else:
            found = {name: golden.array(case, output.file) for name, output in case.outputs.items()}
        for name, value in found.items():
            write_npy(outputs / case.name / f"{name}.npy", value)
    return len(made)
