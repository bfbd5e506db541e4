"""Time one full training iteration, stage by stage: render, all losses, reverse passes, optimiser.

Every repeat is the same iteration of the schedule (all components and losses active, between two densifications), after
warm-up; compilation is timed apart. Medians and quartiles, because a shared machine is never quiet.
"""

import time
from typing import Any

from endotsr.bench.case import WARM_UP, representative
from endotsr.bench.timing import spread
from endotsr.config import PAPER, Config
from endotsr.runs.machine import peak_memory_bytes
from endotsr.scene import workload


class StageTimer:
    """Seconds by stage name; a stage ends at its mark and began at the mark before."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = {}
        self._last = 0.0

    def begin(self) -> None:
        """The iteration begins."""
        self._last = time.perf_counter()

    def mark(self, stage: str) -> None:
        """The stage of this name has just ended."""
        now = time.perf_counter()
        self.seconds.setdefault(stage, []).append(now - self._last)
        self._last = now


def benchmark_iteration(
    gaussians: int,
    repeats: int,
    width: int = workload.WIDTH,
    height: int = workload.HEIGHT,
    config: Config = PAPER,
) -> dict[str, Any]:
    """Milliseconds of the stages and of the whole iteration.

    gaussians, width, height   size of the workload (see `endotsr.scene.workload`)
    returns                    JSON-able: "stages" {name: {"median_ms", "quartiles_ms"}}, "iteration" the same for the
                               sum, "first_iteration_s" (compilation or loading of compiled code included), sizes
    """
    from endotsr.fitting.state import bench_state, workshop
    from endotsr.fitting.trainer import training_step

    iteration = representative(config)
    shop = workshop(workload.sequence(width, height), config)
    for index in shop.sequence.train_index:
        shop.targets_of(int(index))  # a run makes them once a frame
    state = bench_state(workload.gaussians(gaussians, config), config, iteration)
    began = time.perf_counter()
    training_step(state, shop)
    first = time.perf_counter() - began
    timer = StageTimer()
    totals = []
    for repeat in range(-WARM_UP, repeats):
        if repeat == 0:
            timer.seconds.clear()
        state.iteration = iteration
        began = time.perf_counter()
        timer.begin()
        training_step(state, shop, timer)
        if repeat >= 0:
            totals.append(time.perf_counter() - began)
    return {
        "gaussians": gaussians,
        "width": width,
        "height": height,
        "precision": config.training.precision,
        "iteration_of_schedule": iteration + 1,
        "repeats": repeats,
        "stages": {name: spread(seconds) for name, seconds in timer.seconds.items()},
        "iteration": spread(totals),
        "first_iteration_s": first,
        "peak_memory_bytes": peak_memory_bytes(),
    }


def table(result: dict[str, Any]) -> str:
    """The result for a person."""
    head = f"{'stage':<18}{'median ms':>12}{'quartiles':>20}{'share':>8}"
    total = result["iteration"]["median_ms"]
    rows = [*result["stages"].items(), ("iteration", result["iteration"])]
    lines = []
    for name, times in rows:
        low, high = times["quartiles_ms"]
        share = f"{times['median_ms'] / total:8.0%}" if name != "iteration" else ""
        lines.append(f"{name:<18}{times['median_ms']:>12.2f}{f'{low:.2f} - {high:.2f}':>20}{share}")
    return "\n".join([head, *lines])
