"""`docs/make.py bench measure effects`: the cost of each optional component; a disabled one is free.

For each component, iterations of two states of the common workload alternate, one with everything and one with the
component off. Other work on the machine then disturbs both equally. A third build alternates with them: the second
state, with the functions of the component removed. It must need the same time and memory. It uses the same arrays,
because the address of an array alone changes the time by a few percent. Memory is the size of Gaussians and moments
created in such a build, and the peak allocation of one iteration beyond it.
"""

import statistics
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple
from unittest import mock

import msgspec

from endotsr.config import PAPER, Config, config_from_dict
from endotsr.studies.bench.case import BenchCase, representative
from endotsr.training.fitting import model, objective
from endotsr.training.fitting.fused import step
from endotsr.training.scene import workload
from endotsr.training.scene.gaussians import arrays


class Part(NamedTuple):
    """A component, the setting that disables it, and the functions that only it calls."""

    name: str
    key: str
    off: Any
    functions: tuple[tuple[Any, str], ...]


PARTS = (
    Part("deformation", "model.deformation", False,
         ((model, "deformation_forward"), (step, "deformation_adam_step"))),
    Part("spectral_motion", "model.spectral_motion", False, ((model, "motion_forward"),)),
    Part("appearance", "model.appearance", False, ((model, "appearance_forward"),)),
    Part("harmonics", "model.harmonics_degree", 0, ()),
    Part("laplacian", "model.laplacian", False, ((objective, "laplacian_loss_forward"),)),
    Part("depth", "loss.depth_weight", 0.0, ((objective, "normalised_depth_forward"),)),
    Part("smoothness", "loss.smoothness_weight", 0.0, ((objective, "smoothness_forward"),)),
)  # fmt: skip


def benchmark_effects(gaussians: int, repeats: int, width: int, height: int, config: Config = PAPER) -> dict[str, Any]:
    """Seconds of processor time of an iteration with everything, with a component off, and without its functions.

    returns  JSON-able: "parts" {name: {"saved": 1 - off / everything, "off_over_absent", "memory_saved", ...}}, medians
             of `repeats` turns; stored bytes and peak allocated bytes of an iteration, of all three; sizes
    """
    found = {part.name: _one(part, gaussians, repeats, width, height, config) for part in PARTS}
    return {"gaussians": gaussians, "width": width, "height": height, "repeats": repeats, "parts": found}


def _one(part: Part, gaussians: int, repeats: int, width: int, height: int, config: Config) -> dict[str, Any]:
    case = BenchCase(gaussians=gaussians, width=width, height=height)
    everything, off = _prepared(case, config), _prepared(case, changed(config, part))
    with _without(part.functions):
        absent = _prepared(case, changed(config, part))
    made = {"everything": (*everything, ()), "off": (*off, ()), "absent": (*absent, part.functions)}
    sizes = {name: _numbers(state) for name, (state, _, _) in made.items()}
    allocated = {name: _allocated(*entry) for name, entry in made.items()}  # each draws the same views so far
    builds: dict[str, tuple[Any, Any, tuple[tuple[Any, str], ...]]] = {
        "everything": (*everything, ()), "off": (*off, ()), "absent": (*off, part.functions),
    }  # fmt: skip
    seconds: dict[str, list[float]] = {name: [] for name in builds}
    for turn in range(repeats + 2):
        for name, (state, constants, missing) in builds.items():
            _iteration(state, constants, missing)  # fills the caches with the data of this state
            taken = _iteration(state, constants, missing)
            if turn >= 2:  # after compilation and one warm turn
                seconds[name].append(taken)
    pairs = list(zip(seconds["off"], seconds["absent"]))
    medians = {name: statistics.median(values) for name, values in seconds.items()}
    return {
        "everything_ms": 1e3 * medians["everything"],
        "off_ms": 1e3 * medians["off"],
        "absent_ms": 1e3 * medians["absent"],
        "saved": 1.0 - statistics.median([o / e for o, e in zip(seconds["off"], seconds["everything"])]),
        "off_over_absent": statistics.median([o / a for o, a in pairs]),
        "memory_saved": 1.0 - sizes["off"] / sizes["everything"],
        "memory_over_absent": sizes["off"] / sizes["absent"],
        "held_bytes": sizes,
        "allocated_bytes": allocated,
        "allocated_over_absent": allocated["off"] / allocated["absent"],
    }


def changed(config: Config, part: Part) -> Config:
    """The configuration with a component off."""
    data = msgspec.to_builtins(config)
    section, name = part.key.split(".")
    data[section][name] = part.off
    return config_from_dict(data, "bench effects")


def _prepared(case: BenchCase, config: Config) -> tuple[Any, Any]:
    """State at a representative iteration of the published schedule, and its constants."""
    from endotsr.training.fitting.state import bench_state, training_constants

    constants = training_constants(workload.sequence(case.width, case.height, frames=case.frames), config)
    for index in constants.sequence.train_index:
        constants.targets_of(int(index))
    return bench_state(workload.gaussians(case.gaussians, config), config, representative(PAPER)), constants


def _iteration(state: Any, constants: Any, missing: tuple[tuple[Any, str], ...]) -> float:
    """Seconds of processor time of one iteration without the functions `missing`."""
    with _without(missing):
        began = time.process_time()
        _step(state, constants)
        return time.process_time() - began


def _allocated(state: Any, constants: Any, missing: tuple[tuple[Any, str], ...]) -> int:
    """Peak bytes allocated by NumPy and Python in one iteration beyond the stored state; kernels are not included."""
    with _without(missing):
        for _ in range(3):  # compiles, and allocates lasting arrays
            _step(state, constants)
        tracemalloc.start()
        try:
            _step(state, constants)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()


def _step(state: Any, constants: Any) -> None:
    """One iteration; the iteration count of the state is restored."""
    from endotsr.training.fitting.trainer import training_step

    iteration = state.iteration
    training_step(state, constants)
    state.iteration = iteration


@contextmanager
def _without(functions: tuple[tuple[Any, str], ...]) -> Iterator[None]:
    """A build in which these functions do not exist: calling one is an error."""
    with ExitStack() as stack:
        for module, name in functions:
            stack.enter_context(mock.patch.object(module, name, None))
        yield


def _numbers(state: Any) -> int:
    """Bytes of the Gaussians and of their moments."""
    moments = [*state.adam.first.values(), *state.adam.second.values()]
    return sum(a.nbytes for a in (*arrays(state.gaussians).values(), *moments))
