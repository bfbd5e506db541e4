"""Judge each mistake of `training_mistakes.toml` alone, and print the answer: python training_mistakes.py [NAME ...]

The mistakes of the reference are judged on the operations of a training, in float64 and up to level 4, those of the
port in C99 up to level 2. A report that does not say the mistake is written again after the search for the cause. The
set is for tuning: it is no part of the rates that the guide to ports states.
"""

import re
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "injected"))
import inject

from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.records import Report
from endotsr.port.judge.report import answer
from endotsr.port.judge.store import Golden, golden_folder, in_precision, read_golden
from endotsr.port.judge.verdict import judge
from endotsr.port.reference import stored
from endotsr.port.search.find import explain
from makers.copies import Edit, changed_copy

OPERATIONS = ("calibration", "adam", "schedule", "density", "training")
TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def in_reference(golden: Golden, edits: tuple[Edit, ...], folder: Path) -> Report:
    """The report on a copy of the reference."""
    asked = golden._replace(cases=[case for case in golden.cases if case.operation in OPERATIONS])
    with changed_copy(edits) as operation, np.errstate(all="ignore"):
        for case in asked.cases:
            inputs = in_precision(golden.inputs(case), "float64")
            found = operation(case.operation).compute(inputs, dict(case.settings) | {"_compositor": "blocks"})
            for name in set(case.outputs) & set(found):
                write_npy(folder / case.name / f"{name}.npy", stored(found[name]))
    return judge(asked, folder, "float64", level=4)


def edits_of(entry: dict[str, Any]) -> tuple[Edit, ...]:
    """The changes of an entry."""
    return tuple(Edit(*change) for change in entry["changes"])


def says_it(golden: Golden, port: str, name: str) -> tuple[bool, list[str]]:
    """Whether the answer of the report on one mistake says what its entry asks for, and its lines.

    A search adds lines and takes none away, so a report that says it is not searched.
    """
    edits = edits_of(TABLE[port][name])
    asked_for = lambda lines: any(re.search(TABLE[port][name]["says"], line) for line in lines)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        if port == "c99":
            report = inject.CPort(folder, golden).report(inject.Mistake(name, edits, ()))
            folder /= "outputs"
        else:
            report = in_reference(golden, edits, folder)
        if not asked_for(answer(report)):
            explain(golden, report, folder)
    lines = answer(report)
    return asked_for(lines), lines


def main(words: list[str]) -> int:
    """Print every answer; the exit status is 0 if each says what its entry asks for."""
    golden, missed = read_golden(golden_folder()), []
    for port, entries in TABLE.items():
        for name in entries:
            if not words or name in words:
                right, lines = says_it(golden, port, name)
                print(f"{name}: {'said' if right else 'NOT SAID'}", *lines, sep="\n    ", flush=True)
                missed += [] if right else [name]
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
