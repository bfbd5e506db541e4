"""The definition in NumPy as a port: python port.py REQUESTS OUTPUTS [OPERATION ...]

It answers every operation that `endotsr.definition` computes, in double precision, or the named ones.
"""

import sys
from pathlib import Path

import numpy as np

from endotsr.port.contract import OPERATIONS
from endotsr.port.judge.format import Request, Requests, read_struct
from endotsr.port.judge.npy import read_plain, write_npy
from endotsr.port.operations.definition import definition_operations
from endotsr.port.reference import stored


def main(words: list[str]) -> int:
    """Answer the requests; an operation without a definition is named in not_ported.txt."""
    requests, outputs = map(Path, words[:2])
    operations = {operation.name: operation for operation in OPERATIONS} | definition_operations()
    known, missing = set(words[2:]) or set(operations), set()
    for name in read_struct(requests / "requests.json", Requests).cases:
        request = read_struct(requests / name / "request.json", Request)
        if request.operation not in known & set(operations):
            missing.add(request.operation)
            continue
        inputs = {key: read_plain(requests / name / file, requests) for key, file in request.inputs.items()}
        with np.errstate(all="ignore"):
            found = operations[request.operation].compute(inputs, dict(request.settings))
        for key in set(request.outputs) & set(found):
            write_npy(outputs / name / f"{key}.npy", stored(found[key]))
    outputs.mkdir(parents=True, exist_ok=True)
    (outputs / "not_ported.txt").write_text("\n".join(sorted(missing)), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
