"""`endotsr bench iteration`: one full training iteration, stage by stage, in the process and threads of the command.

In: the size of the common workload and the settings. Out: medians and quartiles by stage, because other work disturbs
the times on a shared machine. Every repeat is the same iteration of the schedule (all components and losses active,
between two densifications), after warm-up; compilation is timed separately.
"""

from typing import Any

from endotsr.bench.case import Case, prepare, time_iterations
from endotsr.bench.timing import spread
from endotsr.config import PAPER, Config
from endotsr.report.tables import plain
from endotsr.runs.machine import peak_memory_bytes
from endotsr.scene import workload


def benchmark_iteration(
    gaussians: int,
    repeats: int,
    width: int = workload.WIDTH,
    height: int = workload.HEIGHT,
    config: Config = PAPER,
) -> dict[str, Any]:
    """Milliseconds of the stages and of the whole iteration.

    gaussians, width, height   size of the workload (see `endotsr.scene.workload`)
    returns                    JSON-able: "stages" {name: {"median_ms", "quartiles_ms"}} of `bench.clock.STAGES` and
                               "rest"; "iteration" the same for the sum; "first_iteration_s" (compilation or loading of
                               compiled code included); sizes
    """
    state, shop = prepare(Case(gaussians=gaussians, width=width, height=height), config)
    iteration = state.iteration + 1
    first, times = time_iterations(state, shop, repeats)
    return {
        "gaussians": gaussians,
        "width": width,
        "height": height,
        "precision": config.training.precision,
        "iteration_of_schedule": iteration,
        "repeats": repeats,
        "stages": {name: spread([t[name] for t in times]) for name in times[0]},
        "iteration": spread([sum(t.values()) for t in times]),
        "first_iteration_s": first,
        "peak_memory_bytes": peak_memory_bytes(),
    }


def table(result: dict[str, Any]) -> str:
    """The result as a table for the terminal."""
    total = result["iteration"]["median_ms"]
    rows = []
    for name, times in [*result["stages"].items(), ("iteration", result["iteration"])]:
        low, high = times["quartiles_ms"]
        fraction = f"{times['median_ms'] / total:.0%}" if name != "iteration" else ""
        rows.append([name, f"{times['median_ms']:.2f}", f"{low:.2f} - {high:.2f}", fraction])
    return plain(("stage", "median ms", "quartiles", "fraction"), rows)
