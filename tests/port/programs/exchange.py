"""The exchange of files of a port in Python, without endotsr: requests in, outputs out. The programs use it.

A program gives `answer(operation, inputs, settings)`, which returns outputs by name, or None for an operation that it
does not have. What it leaves out is written to not_ported.txt.
"""

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

Answer = Callable[[str, dict[str, Any], dict[str, Any]], Mapping[str, Any] | None]


def serve(answer: Answer) -> None:
    """The main function of a port: REQUESTS and OUTPUTS are the two words of the command line."""
    requests, outputs = map(Path, sys.argv[1:3])
    head, left_out = json.loads((requests / "requests.json").read_text()), set()
    for case in head["cases"]:
        request = json.loads((requests / case / "request.json").read_text())
        inputs = {name: np.load(requests / case / file) for name, file in request["inputs"].items()}
        real = {name: a.astype(head["precision"]) if a.dtype.kind == "f" else a for name, a in inputs.items()}
        found = answer(request["operation"], real, request["settings"])
        if found is None:
            left_out.add(request["operation"])
            continue
        (outputs / case).mkdir(parents=True, exist_ok=True)
        for name in set(found) & set(request["outputs"]):
            np.save(outputs / case / f"{name}.npy", np.array(found[name], order="C"))
    (outputs / "not_ported.txt").write_text("".join(f"{name}\n" for name in sorted(left_out)))
