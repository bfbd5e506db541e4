"""Dense flows of a clip and their cache."""

import io

import numpy as np
import pytest

from endotsr.clips.flow import clip_flows
from endotsr.clips.flow.clip_flows import STEPS, motion_of
from endotsr.clips.opencv.flow import dense_flow


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(clip_flows, "flow_folder", lambda: tmp_path / "flows")
    return tmp_path / "flows"


@pytest.fixture
def pictures():
    """Four frames of a texture that slides by 2 px to the right."""
    plane = np.random.default_rng(1).integers(0, 256, (8, 12), np.uint8).repeat(8, 0).repeat(8, 1)
    return [np.roll(np.repeat(plane[:, :, None], 3, 2), 2 * i, 1) for i in range(4)]


def test_flows_are_those_of_the_pairs_rounded_to_a_step(folder, pictures):
    motion = motion_of(pictures)
    planes = [np.ascontiguousarray(picture.transpose(2, 0, 1)) for picture in pictures]
    assert len(motion.forward) == len(motion.backward) == 3
    for i in range(3):
        for found, pair in ((motion.forward[i], (i, i + 1)), (motion.backward[i], (i + 1, i))):
            assert found.dtype == np.float32
            exact = dense_flow(planes[pair[0]], planes[pair[1]])
            np.testing.assert_allclose(found, exact, rtol=0, atol=0.5 / STEPS)
    assert len(list(zip(motion.forward, range(9)))) == 3, "iteration ends"


def test_another_picture_order_or_size_has_flows_of_its_own(folder, pictures):
    changed = [picture.copy() for picture in pictures]
    changed[2][5, 5, 0] ^= 1
    for clip in (pictures, changed, pictures[::-1], pictures[:3], [p[:, :80] for p in pictures]):
        motion_of(clip)
    assert len(list(folder.glob("*.npy"))) == 5


def stored(array):
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


WRONG = {
    "empty": b"", "a head alone": b"\x93NUMPY\x01", "no array": b"no array",
    "another shape": stored(np.zeros((2, 3), np.int16)),
    "another type": stored(np.zeros((2, 3, 2, 64, 96), np.int32)),
    "the last byte is missing": stored(np.zeros((2, 3, 2, 64, 96), np.int16))[:-1],
}  # fmt: skip


@pytest.mark.parametrize("content", WRONG.values(), ids=WRONG)
def test_a_damaged_file_is_computed_again(folder, pictures, content):
    good = motion_of(pictures).forward.levels.copy()
    (file,) = folder.glob("*.npy")
    whole = file.read_bytes()
    file.unlink()
    file.write_bytes(content)
    assert np.array_equal(motion_of(pictures).forward.levels, good)
    assert file.read_bytes() == whole


def test_the_oldest_files_make_room(folder, pictures, monkeypatch):
    motion_of(pictures)
    size = next(folder.glob("*.npy")).stat().st_size
    monkeypatch.setattr(clip_flows, "MOST_BYTES", int(2.5 * size))
    motion_of(pictures[::-1])
    motion_of(pictures)  # used again: now the newest
    kept = set(folder.glob("*.npy"))
    motion_of([picture[::-1] for picture in pictures])
    left = set(folder.glob("*.npy"))
    assert len(left) == 2 and len(left & kept) == 1
    monkeypatch.setattr(clip_flows, "dense_flow", lambda *_: pytest.fail("the file that was used last is gone"))
    motion_of(pictures)


def test_a_clip_beyond_the_limit_and_a_folder_that_cannot_be_written_cost_nothing(folder, pictures, monkeypatch):
    monkeypatch.setattr(clip_flows, "MOST_BYTES", 10)
    assert len(motion_of(pictures).forward) == 3 and not folder.exists()
    monkeypatch.undo()
    monkeypatch.setattr(clip_flows, "flow_folder", lambda: folder)
    folder.write_text("a file")
    assert len(motion_of(pictures).forward) == 3


def test_one_picture_has_no_flows(folder, pictures):
    assert motion_of(pictures[:1]) == ([], [])
