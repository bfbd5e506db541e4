"""The search on the answers of the port by hand with some edits."""

import contextlib

import hand_port
from made_up_ports import cases_of

from endotsr.port.judge.npy import write_npy
from endotsr.port.search.find import explained

SECONDS = 60.0  # most searches end by themselves before


def search_on(golden, folder, operation, *edits, seconds=SECONDS):
    """The search for these edits; a case that ends the port with an error has no answer."""
    port = hand_port.operations(edits)
    for case in cases_of(golden, operation):
        with contextlib.suppress(ValueError, IndexError, ZeroDivisionError):
            found = hand_port.answer(port, operation, golden.inputs(case), case.settings)
            for name in case.outputs:
                write_npy(folder / case.name / f"{name}.npy", found[name])
    return explained(golden, folder, "float64", 3, operation, seconds)
