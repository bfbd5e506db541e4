"""How long a sweep takes, planned from the time of one run.

The model: W workers make R runs of equal length in ceil(R / W) rounds. A run on one thread takes its core minutes; a
run on k threads takes 1 / k of them at best, so that threads never finish a sweep sooner than workers do. The start of
a worker (imports, kernels, the sequence) is paid once. Assumed: workers do not slow each other down, which holds on
separate machines; on one machine they compete for memory bandwidth, and the measured time of a run holds this already
if it was measured with as many runs at a time.
"""

import math

BEGIN_MINUTES = 1.0  # of a worker before its first iteration, kernels not compiled before


def planned_hours(runs: int, cores: int, core_minutes: float, threads: int = 1, begin: float = BEGIN_MINUTES) -> float:
    """Hours until the last of the runs has ended.

    runs          in the sweep
    cores         of all machines together, divided among workers of `threads` threads
    core_minutes  of one run: minutes on one thread
    begin         minutes of a worker before its first iteration
    Raises:       ValueError if there is no worker.
    """
    workers = cores // threads
    if workers < 1:
        raise ValueError(f"{cores} cores give no worker of {threads} threads")
    return (begin + math.ceil(runs / workers) * core_minutes / threads) / 60 if runs else 0.0
