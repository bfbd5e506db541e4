"""Folders and commands of ports that tests make up: expected values, the port of three functions, a racing port."""

import sys
from pathlib import Path

from endotsr.port.judge.npy import write_npy

THREE = Path(__file__).parent / "delivery" / "three_functions.py"


def case_of(golden, name):
    """The case of this name."""
    return next(case for case in golden.cases if case.name == name)


def cases_of(golden, operation):
    return [case for case in golden.cases if case.operation == operation]


def write_expected(golden, cases, folder):
    """The outputs of a port that gives the expected values of these cases."""
    for case in cases:
        for name, output in case.outputs.items():
            write_npy(folder / case.name / f"{name}.npy", golden.array(case, output.file))


def short_version(golden):
    """major.minor of the vectors, as a claim names them."""
    return ".".join(golden.manifest.version.split(".")[:2])


def command(script=THREE):
    """The command of a port in Python."""
    return f'"{sys.executable}" "{script}" {{requests}} {{outputs}}'


def three_functions(folder, right, wrong):
    """The program of the port of three functions with one change of its text."""
    text = THREE.read_text()
    assert right in text
    changed = folder / "changed.py"
    changed.write_text(text.replace(right, wrong))
    return changed


# The port of three functions, whose translation is off by SIZES[run] of itself; the run is counted in a file.
RACING = """
import pathlib, sys
sys.path.insert(0, {folder!r})
import numpy as np
import three_functions  # answers when it is imported
count = pathlib.Path({count!r})
run = int(count.read_text() or 0) if count.is_file() else 0
count.write_text(str(run + 1))
for path in pathlib.Path(sys.argv[2]).glob("motion/*/translation.npy"):
    np.save(path, np.load(path) * (1 + {sizes}[run % len({sizes})]))
"""


def racing(folder, sizes):
    """The command of a port with these deviations of its runs."""
    program = folder / "racing.py"
    program.write_text(RACING.format(folder=str(THREE.parent), count=str(folder / "count"), sizes=sizes))
    return command(program)
