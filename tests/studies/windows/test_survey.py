"""One pass over a recording."""

import cv2
import numpy as np
import pytest
from small_recording import FRAMES, write_recording

from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.studies.windows.survey import survey


@pytest.fixture
def copy(tmp_path):
    return write_recording(tmp_path / "copy")


def test_a_whole_recording_is_one_scene_that_moves(recording):
    found = survey(recording, SequenceConfig())
    assert len(found) == FRAMES and all(not frame.fault and not frame.cut for frame in found)
    assert all(0.5 < frame.tissue <= 1 for frame in found)
    assert found[0].motion == 0 and 1e-4 < max(frame.motion for frame in found) < 0.05


def test_the_selected_frames_alone_are_read(recording):
    names = [frame.name for frame in survey(recording, SequenceConfig(frames="8:40:4"))]
    assert names == [f"{i:06d}" for i in range(8, 40, 4)]


@pytest.mark.parametrize("kind", ["images", "masks", "depth"])
def test_a_damaged_file_is_named_and_the_rest_is_read(copy, kind):
    file = copy / kind / "000020.png"
    file.write_bytes(file.read_bytes()[:-40])
    found = survey(copy, SequenceConfig())
    assert [i for i, frame in enumerate(found) if frame.fault] == [20]
    assert str(file) in found[20].fault and "truncated" in found[20].fault
    assert found[21].motion == 0 and not found[21].cut, "nothing is measured across a frame that is missing"


def test_another_picture_is_a_cut_and_another_exposure_is_none(copy):
    random = np.random.default_rng(3).integers(0, 256, (40, 48, 3), np.uint8)
    for i in range(30, FRAMES):
        file = str(copy / "images" / f"{i:06d}.png")
        cv2.imwrite(file, cv2.GaussianBlur(random, (0, 0), 2) if i >= 40 else (cv2.imread(file) * 0.6).astype(np.uint8))
    found = survey(copy, SequenceConfig())
    assert [i for i, frame in enumerate(found) if frame.cut] == [40]
    assert "correlation" in found[40].cut


def test_a_camera_that_jumps_is_a_cut(copy):
    rows = np.load(copy / "poses_bounds.npy")
    rows[25:, 8] += 20.0  # 20 mm to the side, of a depth of 50
    np.save(copy / "poses_bounds.npy", rows)
    cuts = {i: frame.cut for i, frame in enumerate(survey(copy, SequenceConfig())) if frame.cut}
    assert list(cuts) == [25] and "jumps by 20" in cuts[25]


def test_a_range_outside_of_the_recording_is_refused(recording):
    with pytest.raises(InputError, match="is outside"):
        survey(recording, SequenceConfig(frames="0:999"))
