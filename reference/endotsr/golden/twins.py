"""Golden cases as requests to a compiled function and to its definition (`endotsr.gradcheck.twins`)."""

from collections.abc import Iterator

from endotsr.golden.judge.store import Golden
from endotsr.gradcheck.twins import Request

ANY_VALUE = 1.0  # a float64 tolerance from here on, in units of the scale, asks for nothing: the output is rounding


def golden_requests(golden: Golden) -> Iterator[tuple[str, Request]]:
    """(name of the stage, request) of every case."""
    for case in golden.cases:
        inputs = {name: golden.array(case, array.file) for name, array in case.inputs.items()}
        asked = tuple(name for name, output in case.outputs.items() if output.compare.float64 < ANY_VALUE)
        yield case.operation, Request(f"golden {case.name}", inputs, case.settings, asked)
