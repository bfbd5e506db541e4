"""Frames that repeat another one: found up to coding noise, told from pauses, and never held out beside a twin."""

import io
from itertools import pairwise

import numpy as np
import pytest
from common_folder import written
from moving_pictures import recorded, tissue

from data_folder import data_folder
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks.copies import (
    blended_finding,
    copied_frames,
    pattern_of,
    picture_numbers,
    steps_between,
    without_twins,
)
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sampling import small_picture
from endotsr.config import PAPER
from endotsr.errors import InputError


def steps_of(source: list[int], noise: float, seed: int = 0) -> np.ndarray:
    """Steps between frames that show these pictures; a copy differs by up to `noise` grey levels."""
    rng = np.random.default_rng(seed)
    moved = np.diff(source) != 0
    return np.where(moved, rng.uniform(0.8, 6.0, len(moved)), noise * rng.uniform(0.2, 1.0, len(moved)))


@pytest.mark.parametrize(("source", "frames"), [
    ([i // 2 for i in range(30)], "::2"),
    ([(i + 1) // 2 for i in range(30)], "1::2"),
    ([i // 3 for i in range(30)], "::3"),
    ([i - i // 3 for i in range(30)], "1::3,2::3"),
    ([i - i // 5 for i in range(40)], "1::5,2::5,3::5,4::5"),
    ([i - i // 6 for i in range(40)], "1::6,2::6,3::6,4::6,5::6"),
])  # fmt: skip
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_pattern_of_copies_is_found_with_the_frames_without_them(source, frames, noise):
    found = pattern_of(steps_of(source, noise))
    assert found is not None
    assert found.frames == frames
    kept = sorted(i for part in found.frames.split(",") for i in range(len(source))[_slice(part)])
    assert len({source[i] for i in kept}) == len(kept)


def _slice(part: str) -> slice:
    first, _, step = part.split(":")
    return slice(int(first or 0), None, int(step))


@pytest.mark.parametrize("name", ["", "endonerf_pulling", "endonerf_cutting"])
def test_every_second_picture_that_is_a_mean_of_its_neighbours_is_named(name):
    for pictures in recorded(name) if name else [tissue(30)]:
        readable = np.ones(len(pictures), bool)
        assert blended_finding(pictures, steps_between(pictures), readable, "clip") == []
        means = [(a + b) // 2 for a, b in pairwise(pictures)]
        for first, frames in ((pictures, "::2"), (pictures[1:], "1::2")):
            order = (first, means) if frames == "::2" else (means, first)
            mixed = [picture for both in zip(*order) for picture in both]
            (found,) = blended_finding(mixed, steps_between(mixed), np.ones(len(mixed), bool), "clip")
            assert found.code == "blended-frames" and found.what.endswith(f"--frames {frames}")
            assert blended_finding(mixed[:9], steps_between(mixed[:9]), readable[:9], "clip") == []


def test_steady_motion_pauses_and_single_copies_are_no_pattern():
    rng = np.random.default_rng(1)
    assert pattern_of(rng.uniform(0.5, 2.0, 60)) is None
    pause = rng.uniform(1.0, 2.0, 60)
    pause[20:40] = 0.06
    assert pattern_of(pause) is None
    single = rng.uniform(1.0, 2.0, 60)
    single[7] = 0.0
    assert pattern_of(single) is None and np.flatnonzero(copied_frames(single)).tolist() == [8]
    breathing = 1.2 * np.abs(np.sin(np.arange(60) * np.pi / 8)) + 0.06  # at rest every eighth frame
    assert pattern_of(breathing) is None


def test_a_copy_leaves_the_training_beside_its_held_out_twin():
    index = np.arange(12)
    held_out = (index - 1) % 8 == 0
    pictures = index // 2
    names = [f"{i:02d}" for i in index]
    train, notes = without_twins(index[~held_out], index[held_out], pictures, names, "clip")
    assert train.tolist() == [2, 3, 4, 5, 6, 7, 10, 11]  # 1 is a copy of 0, and 9 of 8
    assert "00, 08" in notes[0]
    same, nothing = without_twins(index[~held_out], index[held_out], index, names, "clip")
    assert nothing == [] and same.tolist() == index[~held_out].tolist()
    with pytest.raises(InputError, match="copies of held-out frames"):
        without_twins(index[::2], index[1::2], pictures, names, "clip")


def test_a_copy_that_returns_later_is_a_twin_too():
    rng = np.random.default_rng(0)
    first = [rng.integers(0, 255, (6, 8, 3)).astype(np.int16) for _ in range(5)]
    joined = [*first, *first]
    numbers = picture_numbers(joined, copied_frames(steps_between(joined)))
    assert numbers[:5].tolist() == numbers[5:].tolist() and len(set(numbers.tolist())) == 5
    paused = [first[0], first[1], first[1], first[0]]
    assert len(set(picture_numbers(paused, copied_frames(steps_between(paused))).tolist())) == 2
    other = [first[0], first[0] + np.int16(1)]
    assert len(set(picture_numbers(other, copied_frames(steps_between(other))).tolist())) == 2


@pytest.mark.parametrize(("source", "copy", "twin"), [(0, 1, 0), (1, 3, 3)])
def test_a_reader_leaves_out_a_twin_also_one_that_returns_later(source, copy, twin, tmp_path):
    written(tmp_path / "clip")
    write_png(tmp_path / f"clip/images/{copy:06d}.png", read_png(tmp_path / f"clip/images/{source:06d}.png"))
    found = read_sequence(tmp_path / "clip", PAPER.sequence)
    assert found.test_index.tolist() == [1] and found.train_index.tolist() == [i for i in (0, 2, 3, 4) if i != twin]
    assert any(f"held-out frames repeat them: {twin:06d}" in note for note in found.notes)
    returns = any("returning-frames: frame 3: 1 frame repeats" in note for note in found.notes)
    assert returns == (copy - source > 1)


@pytest.mark.parametrize(("copied", "found"), [(0.4, True), (0.6, False)])
def test_copies_after_lossy_coding_have_a_limit(copied, found):
    """A conversion from 24 to 30 frames a second: a copy differs by the noise of the coding."""
    rng, copy = np.random.default_rng(4), np.arange(1, 60) % 5 == 0
    steps = np.where(copy, copied, 1.0) * rng.uniform(0.95, 1.05, 59)
    pattern = pattern_of(steps)
    assert (pattern is not None) == found
    assert pattern is None or pattern.frames == "1::5,2::5,3::5,4::5"


@pytest.mark.parametrize(("copied", "found"), [(0.2, True), (0.4, False)])
def test_most_frames_are_copies_where_they_differ_little(copied, found):
    """Where the exposure jumps every five frames, the other steps are smaller by the jump."""
    steps = np.where(np.arange(1, 60) % 5 == 0, 1.0, copied) * np.random.default_rng(4).uniform(0.95, 1.05, 59)
    assert (pattern_of(steps) is not None) == found


def coded(pictures, quality):
    """The pictures after H.264 at a constant rate factor."""
    av, file = pytest.importorskip("av"), io.BytesIO()
    with av.open(file, "w", "mp4") as video:
        stream = video.add_stream("libx264", rate=30)
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt, stream.options = "yuv420p", {"crf": str(quality), "preset": "veryfast"}
        for picture in pictures:
            video.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        video.mux(stream.encode())
    file.seek(0)
    return [frame.to_ndarray(format="rgb24") for frame in av.open(file).decode(video=0)]


@pytest.mark.data
def test_copies_of_a_recorded_clip_are_found_after_lossy_coding():
    files = sorted((data_folder("endonerf_cutting") / "images").iterdir())[:40]
    pictures = [read_png(file) for file in files]
    shown = [pictures[i - i // 5] for i in range(49)]
    pattern = pattern_of(steps_between([small_picture(picture) for picture in coded(shown, 28)]))
    assert pattern is not None and pattern.period == 5
    assert pattern_of(steps_between([small_picture(picture) for picture in coded(pictures, 28)])) is None
