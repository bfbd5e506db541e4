"""`docs/make.py bench measure start`: from the call of the interpreter to the end of the first training iteration.

A cold start begins with an empty kernel cache, a warm start with a full one. Each runs in a fresh process with the
initialisation of a real run, and ends with one iteration with all components active, which needs the remaining kernels.
The fresh process runs this module (`python docs/make.py bench.start`).
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

from endotsr.errors import InputError

MOMENTS = ("imported", "sequence made", "initialised", "first iteration", "first iteration with everything")


def measure_start(warm_repeats: int) -> dict[str, Any]:
    """{"cold": seconds by moment, "warm": medians of `warm_repeats` processes}, counted from the call."""
    with tempfile.TemporaryDirectory() as cache:
        cold = fresh_process(cache)
        warm = [fresh_process(cache) for _ in range(warm_repeats)]
    return {
        "cold": cold,
        "warm": {moment: statistics.median(w[moment] for w in warm) for moment in MOMENTS},
        "warm_repeats": warm_repeats,
    }


def fresh_process(cache: str) -> dict[str, float]:
    """Seconds from the call to each moment, with `cache` as the folder of compiled kernels."""
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    began = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-u", __file__], env=environment, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        seconds = {json.loads(line): time.perf_counter() - began for line in process.stdout}
    if process.returncode or set(seconds) != set(MOMENTS):
        raise InputError(f"bench start: the fresh process ended with {process.returncode} after {list(seconds)}")
    return seconds


def _first_iterations() -> None:
    """Print each milestone as it is reached; the parent process measures the time."""
    from endotsr.config import PAPER
    from endotsr.studies.bench.case import representative
    from endotsr.training.fitting.compile_ahead import compile_ahead
    from endotsr.training.fitting.state import new_training, training_constants
    from endotsr.training.fitting.trainer import training_step
    from endotsr.training.scene import workload

    say = lambda moment: print(json.dumps(moment), flush=True)
    say(MOMENTS[0])
    constants = training_constants(workload.sequence(), PAPER)
    say(MOMENTS[1])
    state = new_training(constants.sequence, PAPER)
    say(MOMENTS[2])
    compile_ahead(PAPER)
    training_step(state, constants)
    say(MOMENTS[3])
    for iteration in (PAPER.training.residual_activation, representative(PAPER)):
        state.iteration = iteration  # the residuals are activated at the first of the two
        training_step(state, constants)
    say(MOMENTS[4])


if __name__ == "__main__":
    _first_iterations()
