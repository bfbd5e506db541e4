"""From surveyed frames to windows, and windows.json."""

import json
from itertools import pairwise

import msgspec
import pytest
from small_recording import frames

from endotsr.clips.sequences.splits import split_frames
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.studies.windows.make import frame_range, waves
from endotsr.studies.windows.plan import Wanted, planned_windows
from endotsr.studies.windows.record import FILE, WindowsRecord, read_record, write_record

SPLIT, AUTO = SequenceConfig(), Wanted()


def spans(found, wanted=AUTO, split=SPLIT):
    windows, left_out = planned_windows(found, wanted, split)
    return [(w.first, w.end) for w in windows], [(g.first, g.end) for g in left_out]


def record_of(windows, left_out, count, chain=1):
    return WindowsRecord(source="x", frames=count, overlap=8, chain=chain, windows=windows, left_out=left_out)


@pytest.mark.parametrize("length", [32, 40, 56, 96])
@pytest.mark.parametrize("count", [100, 237, 400])
def test_every_frame_is_in_one_window_or_in_two_neighbours(length, count):
    windows, left_out = spans(frames(count), Wanted(length, 8))
    assert left_out == [] and windows[0][0] == 0 and windows[-1][1] == count
    for (first, end), (begins, ends) in pairwise(windows):
        assert end - begins == 8 and first < begins and end < ends
    for before, after in zip(windows, windows[2:]):
        assert before[1] <= after[0]
    assert max(end - first for first, end in windows) <= length + 7


def test_windows_are_shorter_where_the_tissue_moves_more():
    still, moving = {i: 1e-4 for i in range(200)}, {i: 4e-3 for i in range(200, 400)}
    windows, _ = spans(frames(400, motion=still | moving))
    lengths = [end - first for first, end in windows]
    assert lengths[0] > 80 and lengths[-1] < 40


@pytest.mark.parametrize(
    "split", [SPLIT, SequenceConfig(split="every_second"), SequenceConfig(split="blocks", block_length=4)]
)
def test_a_frame_is_held_out_in_both_windows_that_share_it(split):
    found, _ = planned_windows(frames(300), Wanted(64, 6), split)
    held_out = [{w.first + int(i) for i in split_frames(w.count, split.split, split.block_length)[1]} for w in found]
    assert len(found) > 3
    for k in range(1, len(found)):
        shared = set(range(found[k].first, found[k - 1].end))
        inner = shared - {found[k - 1].end - 1 - i for i in range(split.block_length if split.split == "blocks" else 0)}
        assert held_out[k - 1] & inner == held_out[k] & inner


@pytest.mark.parametrize("block, overlap", [(8, 8), (16, 8), (20, 4)])
def test_no_window_is_too_short_for_the_split(block, overlap):
    """A last window without room for a held-out block would end the training of a plan that is written already."""
    split = SequenceConfig(split="blocks", block_length=block)
    for count in range(64, 240):
        found, _ = planned_windows(frames(count), Wanted(64, overlap), split)
        assert found[-1].end == count
        for window in found:
            assert window.count >= 16 and len(split_frames(window.count, split.split, block)[1])


def test_a_cut_begins_a_window_that_shares_nothing():
    windows, left_out = planned_windows(frames(120, cut={61: "the camera jumps"}), Wanted(40, 8, 9), SPLIT)
    assert left_out == [] and 61 in [w.first for w in windows]
    at = next(k for k, w in enumerate(windows) if w.first == 61)
    assert windows[at - 1].end == 61 and windows[at].start == "cold" and "camera jumps" in windows[at].begins


def test_a_damaged_frame_is_left_out_and_named():
    windows, left_out = planned_windows(frames(100, fault={50: "000050.png: truncated PNG"}), Wanted(), SPLIT)
    assert [(w.first, w.end) for w in windows] == [(0, 50), (51, 100)]
    assert [(g.first, g.end, g.reason) for g in left_out] == [(50, 51, "000050.png: truncated PNG")]


def test_a_run_without_tissue_is_left_out_and_a_single_frame_is_not():
    windows, left_out = spans(frames(100, tissue=dict.fromkeys(range(40, 52), 0.0) | {70: 0.0}))
    assert windows == [(0, 40), (52, 100)] and left_out == [(40, 52)]


def test_a_scene_too_short_for_a_window_is_left_out():
    windows, left_out = spans(frames(100, cut={50: "x", 60: "y"}))
    assert windows == [(0, 50), (60, 100)] and left_out == [(50, 60)]


def test_chains_begin_cold_and_make_waves():
    found, left_out = planned_windows(frames(200), Wanted(40, 8, 3), SPLIT)
    assert [w.start for w in found] == ["cold", "warm", "warm"] * 2
    assert waves(record_of(found, left_out, 200, 3)) == [[0, 3], [1, 4], [2, 5]]


@pytest.mark.parametrize(
    ("wanted", "split", "words"),
    [
        (Wanted(20, 8), SPLIT, "at least 24"),
        (Wanted(40, 1), SPLIT, "--overlap 1"),
        (Wanted(40, 8, 0), SPLIT, "--chain 0"),
        (Wanted(), SequenceConfig(split="end"), "split end"),
    ],
)
def test_what_is_not_allowed_is_refused_with_what_is(wanted, split, words):
    with pytest.raises(InputError, match=words):
        planned_windows(frames(100), wanted, split)


def test_frames_of_a_window_are_a_range_of_the_folder():
    window = planned_windows(frames(100), Wanted(56, 8), SPLIT)[0][1]
    assert frame_range("", window) == f"{window.first}:{window.end}:1"
    chosen = range(400)[10:310:3]
    first, end, step = map(int, frame_range("10:310:3", window).split(":"))
    assert list(range(first, end, step)) == list(chosen[window.first : window.end])
    with pytest.raises(InputError, match="not negative"):
        frame_range("-20:", window)


def test_the_record_is_read_as_it_was_written(tmp_path):
    found, left_out = planned_windows(frames(100, fault={70: "lost"}), Wanted(40, 8, 2), SPLIT)
    record = record_of(found, left_out, 100, 2)
    write_record(tmp_path, record)
    assert read_record(tmp_path) == record


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"name": "../x"}, "name"), ({"first": -1}, "first"), ({"end": 9999}, "end <= 100"),
        ({"start": "tepid"}, "start"), ({"first": 0}, "no later"), ({"extra": 1}, "extra"),
        ({"first": 40, "start": "warm"}, "shares"),
    ],
)  # fmt: skip
def test_a_record_that_was_edited_is_refused_by_name(tmp_path, changes, words):
    found, left_out = planned_windows(frames(100), Wanted(40, 8), SPLIT)
    data = msgspec.to_builtins(record_of(found, left_out, 100))
    data["windows"][1] |= changes
    (tmp_path / FILE).write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_record(tmp_path)


def test_the_place_of_a_beginning_is_rounded_up_to_a_frame_and_then_down_to_the_period():
    """Half of the densities of 31 frames end at 15.5: the window begins at 16, a multiple of 8, and not at 8."""
    assert spans(frames(39), Wanted(24, 8))[0] == [(0, 24), (16, 39)]


def test_a_last_window_of_fewer_than_16_frames_is_part_of_the_one_before_it():
    """Also with a short overlap, of which 8 frames more would be fewer than 16."""
    assert spans(frames(37), Wanted(18, 2))[0] == [(0, 37)]
    assert spans(frames(33), Wanted(18, 2))[0] == [(0, 18), (16, 33)]


def test_a_section_with_too_few_frames_for_the_split_has_no_window():
    assert spans(frames(16), AUTO, SequenceConfig(split="blocks")) == ([], [(0, 16)])
