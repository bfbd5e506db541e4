"""No thread of a library works while a training iterates: the cores belong to the kernels."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/schedstat").is_file(), reason="reads the run time of every thread in /proc"
)

ITERATES = """
import os, sys, threading
from endotsr.studies.bench.case import BenchCase, prepare, time_iterations
from endotsr.method.kernels.threads import use_threads

def working():
    # Nanoseconds that the threads of libraries have run; the ticks of `stat` are too coarse for a short run.
    ours = {thread.native_id for thread in threading.enumerate()}
    others = [task for task in os.listdir("/proc/self/task") if int(task) not in ours]
    return sum(int(open(f"/proc/self/task/{task}/schedstat").read().split()[0]) for task in others)

case = BenchCase(gaussians=6000, width=96, height=80, precision=sys.argv[1], frames=3)
use_threads(2)
state, constants = prepare(case, case.config())
time_iterations(state, constants, 2)
before = working(), sum(os.times()[:2])
time_iterations(state, constants, 40)
print((working() - before[0]) / 1e9, sum(os.times()[:2]) - before[1])
"""


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_no_other_thread_works_during_the_iterations(precision):
    free = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    words = [sys.executable, "-c", ITERATES, precision]
    done = subprocess.run(words, env=free, check=True, capture_output=True, text=True)
    others, whole = map(float, done.stdout.split())
    assert others <= 0.02 * whole, (others, whole)
