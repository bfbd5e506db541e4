"""Frames in a file instead of the memory: the same numbers, the same training, and nothing left behind."""

import tempfile
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from endonerf_writer import write_endonerf
from endotsr.clips.sequences.frame_store import FrameStore
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import DEMO, SequenceConfig
from endotsr.method.kernels.memory import ASSUMED, Kept, bytes_of, memory_limit
from endotsr.training.fitting.state import new_training, training_constants
from endotsr.training.fitting.trainer import training_step
from endotsr.training.scene.gaussians import arrays

FRAMES = 9
TINY = 2e-6  # GB: less than the clip needs, and a quarter of it holds the masks of one frame


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("clip") / "clip"
    write_endonerf(simulate(SimulatorSettings(width=64, height=48, frames=FRAMES)).sequence, place)
    return place


@pytest.mark.parametrize("scale", [1.0, 0.5])
@pytest.mark.parametrize("masks", ["masks", "none"])
def test_a_clip_in_a_file_is_the_clip_in_memory(folder, scale, masks, monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    here = read_sequence(folder, SequenceConfig(scale=scale, masks=masks))
    there = read_sequence(folder, SequenceConfig(scale=scale, masks=masks, memory=TINY))
    for name in ("images", "masks", "depth"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))
    assert isinstance(there.images.base, np.memmap) and not isinstance(here.images.base, np.memmap)
    extra = set(there.notes) - set(here.notes)
    assert len(extra) == 1 and "are stored in an unnamed file" in extra.pop()
    assert list(tmp_path.iterdir()) == []


def trained(folder, memory, steps=24):
    training = msgspec.structs.replace(DEMO.training, iterations=steps)
    config = msgspec.structs.replace(DEMO, sequence=SequenceConfig(memory=memory), training=training)
    sequence = read_sequence(folder, config.sequence)
    state, constants = new_training(sequence, config), training_constants(sequence, config)
    log = [training_step(state, constants) for _ in range(steps)]
    return arrays(state.gaussians), log, constants


def test_a_lowered_limit_changes_no_number_of_a_training(folder):
    """The presets with targets along optical flow use frames and moments between them; few of either are kept."""
    here, log, constants = trained(folder, 0.0)
    there, same, short = trained(folder, TINY)
    assert log == same
    for name, array in here.items():
        np.testing.assert_array_equal(array, there[name])
    assert len(short.supports) < len(constants.supports)  # a mask of one bit a pixel is small
    assert len(short.bridged.stored) <= 1 < len(constants.bridged.stored)


def test_values_are_dropped_oldest_first_and_made_again():
    made: list[int] = []

    def make(key):
        made.append(key)
        return (np.full(10, key, np.uint8), (np.zeros(10, np.uint8),))

    kept = Kept[int, tuple](limit=50)
    for key in (1, 2, 3, 1):
        assert kept.get(key, lambda key=key: make(key))[0][0] == key
    assert made == [1, 2, 3, 1] and len(kept) == 2 and 2 not in kept and kept.bytes == 40
    shared = np.zeros(8)
    assert bytes_of((shared, [shared], {"a": np.zeros(2, np.int16)}, None)) == 68


def disk_of(free, monkeypatch):
    """The free disk is stated: that of the machine of the tests may be as good as full."""
    monkeypatch.setattr("shutil.disk_usage", lambda place: SimpleNamespace(free=free))


def test_the_limit_is_half_of_the_machine_unless_it_is_stated(monkeypatch):
    disk_of(1e11, monkeypatch)
    assert memory_limit(2.5) == 2.5e9
    monkeypatch.setattr("endotsr.method.kernels.memory.memory_of_machine", lambda: 8e9)
    assert memory_limit(0.0) == 4e9 and FrameStore(2000, 640, 512, 0.0, "clip").in_file
    assert not FrameStore(500, 640, 512, 0.0, "clip").in_file
    monkeypatch.setattr("endotsr.method.kernels.memory.memory_of_machine", lambda: None)
    assert memory_limit(0.0) == ASSUMED / 2


def test_unknown_memory_is_said_and_refuses_what_no_machine_holds(monkeypatch):
    disk_of(1e11, monkeypatch)
    monkeypatch.setattr("endotsr.method.kernels.memory.memory_of_machine", lambda: None)
    assert "4 GB assumed; sequence.memory states it" in FrameStore(2000, 640, 512, 0.0, "clip").note
    assert "assumed" not in FrameStore(2000, 640, 512, 1.0, "clip").note
    with pytest.raises(ValueError, match=r"need 29491\.2 GB, more than half .* 4 GB assumed; sequence\.memory"):
        FrameStore(10_000_000, 640, 512, 0.0, "clip")


def test_a_full_disk_is_an_error_of_one_line(monkeypatch):
    def full(*arguments, **more):
        raise OSError(28, "No space left on device")

    store = FrameStore(4, 64, 48, 1e-6, Path("clip"))
    monkeypatch.setattr("tempfile.TemporaryFile", full)
    with pytest.raises(ValueError, match=r"clip: 4 frames of 64x48 need 0\.0 GB: no file for them in .*No space left"):
        store.array((4, 48, 64), bool)
