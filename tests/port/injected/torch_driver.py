"""Answers of the port in PyTorch with mistakes: python torch_driver.py JOBS.json REQUESTS OUTPUTS, where torch is.

A job has the source of the port and the operations to answer. Job k writes to OUTPUTS/k.
"""

import json
import sys
from pathlib import Path

import numpy as np
import torch


def answer_of(text):
    """The function `answer` of a port with this source."""
    port = {"__name__": "port_with_a_mistake"}
    exec(compile(text, "port.py", "exec"), port)
    return port["answer"]


def main(jobs, requests, outputs):
    """Run every job."""
    cases = json.loads((requests / "requests.json").read_text())["cases"]
    for k, job in enumerate(json.loads(jobs.read_text())):
        answer = answer_of(job["source"])
        for case in cases:
            request = json.loads((requests / case / "request.json").read_text())
            if request["operation"] not in job["operations"]:
                continue
            inputs = {name: np.load(requests / case / file) for name, file in request["inputs"].items()}
            found = answer(request["operation"], inputs, request["settings"]) or {}
            for name in set(found) & set(request["outputs"]):
                target = outputs / str(k) / case
                target.mkdir(parents=True, exist_ok=True)
                np.save(target / f"{name}.npy", np.array(found[name], order="C"))


if __name__ == "__main__":
    torch.set_num_threads(1)
    main(*map(Path, sys.argv[1:4]))
