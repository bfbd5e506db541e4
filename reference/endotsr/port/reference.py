"""The reference as a port of itself: its answers to every case, or to a folder of requests."""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.method.splatting.render import Compositor
from endotsr.port.contract import all_operations
from endotsr.port.judge.format import Precision, Request, Requests, read_struct
from endotsr.port.judge.npy import Refused, read_plain, write_npy
from endotsr.port.judge.store import Golden, in_precision
from endotsr.port.operations.operation import Inputs, Operation, Outputs


def reference(operation: Operation, inputs: Inputs, settings: dict, precision: str, compositor: Compositor) -> Outputs:
    """The reference's answer in one precision; compositor `blocks` uses fast compositing if applicable."""
    return operation.compute(in_precision(inputs, precision), settings | {"_compositor": compositor})


def stored(array: NDArray) -> NDArray:
    """The array in the dtype of the files: float64, 64-bit integers or booleans."""
    if array.dtype.kind == "f":
        return np.asarray(array, np.float64)
    return array if array.dtype.kind in "bu" else array.astype(np.int64)


def answer_requests(requests: Path, outputs: Path) -> int:
    """The reference as a port: reads only a folder of requests and writes outputs. Returns the number of cases."""
    try:
        head = read_struct(requests / "requests.json", Requests)
        for name in head.cases:
            root = requests / name
            request = read_struct(root / "request.json", Request)
            inputs = {key: read_plain(root / file, requests) for key, file in request.inputs.items()}
            _write(outputs / name, _answer(request.operation, inputs, request.settings, head.precision),
                   list(request.outputs), head.precision)  # fmt: skip
    except (OSError, msgspec.DecodeError, Refused) as error:
        raise InputError(f"{requests}: {error}") from None
    return len(head.cases)


def answer_all(golden: Golden, outputs: Path, precision: Precision) -> int:
    """The reference's own outputs for every case."""
    for case in golden.cases:
        found = _answer(case.operation, golden.inputs(case), case.settings, precision)
        _write(outputs / case.name, found, list(case.outputs), precision)
    return len(golden.cases)


def _answer(operation: str, inputs: dict, settings: dict[str, Any], precision: str) -> Outputs:
    """The answer with fast compositing if applicable; the expected values come from the other path."""
    return reference(all_operations()[operation], inputs, settings, precision, "blocks")


def _write(folder: Path, found: Outputs, names: list[str], precision: str) -> None:
    for name in names:
        if name in found:
            value = stored(found[name])
            real = value.dtype.kind == "f" and value.ndim > 0
            write_npy(folder / f"{name}.npy", value.astype(precision) if real else value)
