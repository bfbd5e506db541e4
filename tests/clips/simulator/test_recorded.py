"""The true motion in a folder is that of the scene in memory, and a truth that does not fit is refused."""

import msgspec
import numpy as np
import pytest

from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.simulator import simulate
from endotsr.clips.simulator.folder import write_sequence
from endotsr.clips.simulator.recorded import check_truth, has_truth, recorded_positions
from endotsr.clips.simulator.scenes import named_scene
from endotsr.config import SequenceConfig
from endotsr.errors import InputError

SETTINGS = msgspec.structs.replace(named_scene("cutting"), width=48, height=40, frames=6, focal=1.2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("cutting")
    write_sequence(made, SETTINGS, "cutting")
    return made


@pytest.fixture
def changeable(folder, tmp_path):
    """A copy whose truth may be spoiled."""
    import shutil

    return shutil.copytree(folder, tmp_path / "copy")


def test_positions_are_those_in_memory_but_for_the_rounding_of_the_file(folder):
    """Material points are stored as float32; the scene moves, and frames of a wound have none."""
    simulated = simulate(SETTINGS)
    positions = recorded_positions(folder, read_sequence(folder, SequenceConfig()))
    assert positions is not None
    for pair in ((0, 4), (4, 1), (5, 5)):
        np.testing.assert_allclose(positions(*pair), simulated.true_positions(*pair), rtol=0, atol=2e-5)
    moved = np.abs(positions(0, 4) - positions(0, 0)).max()
    assert moved > 0.5 and np.isnan(positions(5, 0)).any()


def test_chosen_frames_keep_their_own_times(folder):
    """Frames 1, 3 and 5 of the files: the reader gives them new times, the scene keeps its own."""
    sequence = read_sequence(folder, SequenceConfig(frames="1::2"))
    positions, simulated = recorded_positions(folder, sequence), simulate(SETTINGS)
    assert sequence.count == 3 and positions is not None
    np.testing.assert_allclose(positions(0, 2), simulated.true_positions(1, 5), rtol=0, atol=2e-5)


def test_no_truth_and_another_size_have_no_positions(folder, changeable):
    import shutil

    assert recorded_positions(folder, read_sequence(folder, SequenceConfig(scale=0.5))) is None
    shutil.rmtree(changeable / "truth")
    assert not has_truth(changeable)
    assert recorded_positions(changeable, read_sequence(changeable, SequenceConfig())) is None


def test_tracks_of_other_settings_are_refused(changeable):
    path = changeable / "truth" / "truth.json"
    text = path.read_text(encoding="utf-8")
    assert f'"amplitude": {SETTINGS.breathing.amplitude}' in text
    path.write_text(text.replace(f'"amplitude": {SETTINGS.breathing.amplitude}', '"amplitude": 0.5', 1))
    with pytest.raises(InputError, match=r"tracks\.npz: position at time .* use those of truth.json"):
        check_truth(changeable)


def test_frames_of_another_scene_are_refused(folder):
    sequence = read_sequence(folder, SequenceConfig())
    sequence.names[2] = "000017"
    with pytest.raises(InputError, match=r"frame '000017' of the sequence .* use 000000 to 000005"):
        recorded_positions(folder, sequence)


def test_a_damaged_frame_is_refused_with_its_name(changeable):
    positions = recorded_positions(changeable, read_sequence(changeable, SequenceConfig()))
    assert positions is not None
    np.savez(changeable / "truth" / "frames" / "000002.npz", depth=np.zeros((2, 2), np.float32))
    with pytest.raises(InputError, match=r"000002\.npz"):
        positions(2, 0)
    positions(3, 0)
