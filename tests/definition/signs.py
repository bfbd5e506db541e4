"""Flip the signs of the definition, one at a time: a golden case must notice each.

All of them, by hand (minutes): python tests/definition/signs.py [file ...], for example deformation projection
"""

import ast
import contextlib
import importlib
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from endotsr.port.judge.compare import judged
from endotsr.port.judge.format import Case
from endotsr.port.judge.store import Golden, golden_folder, read_golden
from endotsr.port.operations.definition import definition_operations, twins
from notebook_signs import flipped, signs_of

FOLDER = Path(inspect.getfile(importlib.import_module("endotsr.definition"))).parent
NOT_IN_GOLDEN = {"__init__", "__main__", "metrics", "settings", "simulate"}
FILES = sorted(file.stem for file in FOLDER.glob("*.py") if file.stem not in NOT_IN_GOLDEN)
# Signs that no golden case can notice, by the start of their line, and why.
NOTICED_BY_NOBODY = {
    "half = half + 1e-5": "the margin of the box: the cutoff decides",
    "constant = decay(": "rates are not annealed in `paper`; test_training.py compares the schedules of every preset",
    "return max(1, (d.until": "no case grows to a budget; test_definition_training.py compares every iteration",
    "centres = np.array([-camera": "the extent is made of distances, which keep no sign",
    "return np.sort(squared": "the cases have one point or many; test_training.py compares two and three",
    "if k > first and count > 150": "the first frame of the cases is 0; test_training.py has another",
    "matrix[row, k if": "both axes change sign; test_laplacian.py compares the matrix with SciPy",
    "return np.unique(np.round": "the cases have few frames; test_training.py compares the positions",
}


def wrong_functions(module: ModuleType) -> Iterator[tuple[str, FunctionType, CodeType]]:
    """(line, function, its code with one sign flipped) of a file."""
    source = inspect.getsource(module)
    nodes = list(ast.walk(ast.parse(source)))
    functions = [f for _, f in inspect.getmembers(module, inspect.isfunction) if f.__module__ == module.__name__]
    for place in signs_of(source):
        text, line = flipped(source, place)
        code = compile(text, str(module.__file__), "exec")
        made = {c.co_name: c for c in code.co_consts if isinstance(c, CodeType)}
        for function in functions:
            lines, first = inspect.getsourcelines(function)
            if first <= nodes[place].lineno < first + len(lines) and function.__name__ in made:  # pyright: ignore
                yield line, function, made[function.__name__]


@contextlib.contextmanager
def installed(function: FunctionType, code: CodeType) -> Iterator[None]:
    """The function runs other code meanwhile."""
    right, function.__code__ = function.__code__, code
    try:
        yield
    finally:
        function.__code__ = right


def notices(golden: Golden, case: Case) -> bool:
    """Whether a golden case refuses the answers of the definition."""
    inputs = {name: golden.array(case, array.file) for name, array in case.inputs.items()}
    try:
        with np.errstate(all="ignore"):
            found = definition_operations()[case.operation].compute(inputs, case.settings)
            for number in range(case.answers):
                right = {name: golden.array(case, output.answer(number)) for name, output in case.outputs.items()}
                rules = {name: output.compare for name, output in case.outputs.items()}
                if all(judged(np.asarray(found[n]), right[n], rules[n], "float64").passed for n in rules):
                    return False
    except Exception:  # a wrong sign may also end in no answer, or in one of another shape
        return True
    return True


def cases_for(golden: Golden, name: str) -> list[Case]:
    """The cases that the definition answers right, those of the file first."""
    cases = [case for case in golden.cases if case.operation in twins() and case.name != "render/long_needle"]
    own = [n for n, twin in twins().items() if twin.function.__module__.endswith(f".{name}")]
    return sorted(cases, key=lambda case: case.operation not in own)


def survivors(name: str) -> tuple[int, list[str]]:
    """(number of flips of a file, the lines of those that no case noticed)."""
    golden, count, alive = read_golden(golden_folder()), 0, []
    for line, function, code in wrong_functions(importlib.import_module(f"endotsr.definition.{name}")):
        count += 1
        with installed(function, code):
            if not any(notices(golden, case) for case in cases_for(golden, name)):
                alive.append(line)
    return count, [line for line in alive if not line.startswith(tuple(NOTICED_BY_NOBODY))]


def main(names: list[str]) -> int:
    """Print what survived; the exit status is the number of files with survivors."""
    bad = 0
    for name in names or FILES:
        count, alive = survivors(name)
        print(f"{name}: {count} signs, {len(alive)} unnoticed", *alive, sep="\n    ", flush=True)
        bad += bool(alive)
    return bad


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
