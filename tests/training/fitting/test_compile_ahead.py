"""A cold start: two processes compile all that a training calls, and nothing is compiled twice."""

import json
import os
import subprocess
import sys

import msgspec
import pytest

from endotsr.config import DEMO, PAPER
from endotsr.method.kernels.machine import usable_cores
from endotsr.method.kernels.target import compiled_for
from endotsr.training.fitting import compile_ahead
from makers.files import machine_class

COMPILE = """
from endotsr.training.fitting import compile_ahead
from endotsr.config import PAPER
assert compile_ahead.compile_ahead(PAPER) and compile_ahead._helpers[0].wait() == 0
assert not compile_ahead.compile_ahead(PAPER), "a second time there is nothing to do"
"""
TRAIN = """
import json, sys
import msgspec
from endotsr.training.scene import workload
from endotsr.studies.bench.case import representative
from endotsr.config import PAPER
from endotsr.training.fitting.state import new_training, training_constants
from endotsr.training.fitting.trainer import training_step

small = msgspec.structs.replace(PAPER.initialisation, first_frame_points=500, other_frame_points=50)
config = msgspec.structs.replace(PAPER, initialisation=small)
constants = training_constants(workload.sequence(128, 96), config)
state = new_training(constants.sequence, config)
born = config.training.residual_activation
for before in (0, born, representative(config), born + 2 * config.density.interval - 1):  # the last one densifies
    state.iteration = before
    training_step(state, constants)
kernels = [(f"{n}.{k}", v) for n, m in list(sys.modules.items()) if n.startswith("endotsr") for k, v in vars(m).items()]
stats = {name: kernel.stats for name, kernel in kernels if hasattr(kernel, "stats") and hasattr(kernel, "overloads")}
missed = sorted(name for name, s in stats.items() if s.cache_misses)
print(json.dumps([missed, sum(bool(s.cache_hits) for s in stats.values())]))
"""


@pytest.mark.slow
@pytest.mark.skipif(usable_cores() < 2, reason="one core: nothing is compiled ahead")
@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="the compiler is off")
def test_a_training_finds_every_kernel_compiled(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", COMPILE], env=environment, check=True)
    done = subprocess.run([sys.executable, "-c", TRAIN], env=environment, check=True, capture_output=True, text=True)
    compiled, loaded = json.loads(done.stdout)
    assert compiled == []
    assert loaded > 30


@pytest.mark.parametrize("program", ["false", "/nowhere/python"])
def test_without_the_second_process_all_goes_on(tmp_path, monkeypatch, program):
    monkeypatch.setattr(compile_ahead, "done_before", lambda config: tmp_path / "marker")
    monkeypatch.setattr(compile_ahead, "usable_cores", lambda: 2)
    monkeypatch.setattr(sys, "executable", program)
    said = []
    assert compile_ahead.compile_ahead(DEMO, said.append) == (os.environ.get("NUMBA_DISABLE_JIT") != "1")
    assert not (tmp_path / "marker").exists()


def test_the_workload_is_compiled_for_an_extent_of_cameras_too(tmp_path, monkeypatch):
    """Its camera does not move, unlike that of the clip for which the kernels are compiled."""
    monkeypatch.setattr(compile_ahead, "done_before", lambda config: tmp_path / "marker")
    monkeypatch.setattr(compile_ahead, "usable_cores", lambda: 2)
    monkeypatch.setattr(sys, "executable", "false")
    config = msgspec.structs.replace(DEMO, density=msgspec.structs.replace(DEMO.density, extent="cameras"))
    assert compile_ahead.compile_ahead(config) == (os.environ.get("NUMBA_DISABLE_JIT") != "1")
    compile_ahead.rehearse(config)


def test_settings_that_call_other_kernels_have_another_marker():
    double = msgspec.structs.replace(PAPER, training=msgspec.structs.replace(PAPER.training, precision="float64"))
    static = msgspec.structs.replace(PAPER, model=msgspec.structs.replace(PAPER.model, deformation=False))
    assert len({compile_ahead.done_before(config) for config in (PAPER, double, static)}) == 3


def test_what_decides_the_last_bits_is_part_of_the_marker_and_of_the_class_of_a_machine(monkeypatch):
    here = compiled_for()
    assert here in machine_class() and here in done_before_name()
    seen = [here]
    monkeypatch.setattr("numba.config.CPU_NAME", "x86-64-v3")
    assert compiled_for().startswith("x86-64-v3")
    seen.append(compiled_for())
    for features in ("", "+avx2"):
        monkeypatch.setattr("numba.config.CPU_FEATURES", features)
        seen.append(compiled_for())
    for system, library in (("Windows", ("", "")), ("Darwin", ("", "")), ("Linux", ("", ""))):  # the last: no glibc
        monkeypatch.setattr("platform.system", lambda system=system: system)
        monkeypatch.setattr("platform.libc_ver", lambda library=library: library)
        seen.append(compiled_for())
        assert compiled_for() in machine_class() and compiled_for() in done_before_name()
    assert len(set(seen)) == len(seen) and not any(" " in name or "/" in name for name in seen)


def done_before_name():
    return compile_ahead.done_before(PAPER).name
