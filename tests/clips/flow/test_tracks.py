"""Tests of `sequences.tracks`: points followed along optical flow, on simulated tissue whose motion is known."""

import dataclasses
import threading
import time

import numba
import numpy as np
import pytest

from endotsr.clips.flow import tracks
from endotsr.clips.flow.tracks import follow
from endotsr.clips.simulator import SimulatorSettings, simulate, with_effects
from endotsr.method.splatting.camera import backproject

SIZE = {"width": 96, "height": 80, "frames": 10}


def lifted(sequence, place: int, step: int = 8) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions of a grid of tissue pixels of a training frame, and their columns and rows."""
    frame = sequence.train_index[place]
    row, column = (a.ravel() for a in np.mgrid[12 : sequence.height - 12 : step, 12 : sequence.width - 12 : step])
    tissue = sequence.masks[frame, row, column]
    row, column = row[tissue], column[tissue]
    depth = sequence.depth[frame, row, column].astype(float)
    return backproject(sequence.cameras[frame], column.astype(float), row.astype(float), depth), column, row


def truth(simulated, place: int, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """(n, 3, P) true positions at the training frames."""
    train = simulated.sequence.train_index
    return np.stack([simulated.true_positions(train[place], i)[:, row, column] for i in train])


@pytest.fixture(scope="module")
def breathing():
    return simulate(with_effects(SimulatorSettings(**SIZE), "breathing"))


@pytest.fixture(scope="module")
def still():
    return simulate(with_effects(SimulatorSettings(**SIZE))).sequence


def from_the_start(sequence, change=lambda position: None):
    """Points of the first training frame, changed in place, and where they are followed to."""
    position, *_ = lifted(sequence, 0)
    change(position)
    return position, follow(sequence, np.zeros(position.shape[1], int), position)


@pytest.mark.parametrize("place", [0, 4, 7])
def test_points_follow_the_tissue_forwards_and_backwards(breathing, place):
    position, column, row = lifted(breathing.sequence, place)
    found = follow(breathing.sequence, np.full(column.size, place), position)
    true = truth(breathing, place, column, row)
    moved = np.linalg.norm(true - true[place], axis=1).mean()
    error = np.linalg.norm(found.position - true, axis=1)
    assert moved > 0.5 and error[found.followed].mean() < 0.15 * moved
    assert found.followed.mean() > 0.8
    np.testing.assert_array_equal(found.position[place], position.astype(np.float32))


def test_points_of_different_frames_do_not_affect_one_another_while_all_are_followed(still):
    first, third = (lifted(still, place)[0] for place in (0, 2))
    start = np.repeat([0, 2], [first.shape[1], third.shape[1]])
    both = follow(still, start, np.concatenate([first, third], axis=1))
    assert both.followed.all()
    alone = follow(still, np.full(third.shape[1], 2), third)
    np.testing.assert_array_equal(both.position[:, :, first.shape[1] :], alone.position)


def test_points_of_a_scene_that_does_not_move_stay(still):
    position, found = from_the_start(still)
    assert np.abs(found.position - position).max() < 1e-3  # mm; the prior depth is float32 and sampled between pixels


def test_a_moving_camera_does_not_move_the_points():
    sequence = simulate(with_effects(SimulatorSettings(**SIZE), "camera_motion")).sequence
    position, found = from_the_start(sequence)
    travelled = max(np.linalg.norm(c.translation - sequence.cameras[0].translation) for c in sequence.cameras)
    assert travelled > 2 and np.median(np.linalg.norm(found.position - position, axis=1)) < 0.1


def covered_for_a_while(simulated):
    """The same sequence with a part of the tissue excluded in the third to the fifth training frame."""
    sequence = simulated.sequence
    masks = sequence.masks.copy()
    for frame in sequence.train_index[2:5]:
        masks[frame, 24:56, 32:64] = False
    return dataclasses.replace(sequence, masks=masks)


def test_a_covered_point_moves_with_the_tissue_around_it_and_is_found_again(breathing):
    sequence = covered_for_a_while(breathing)
    position, column, row = lifted(sequence, 0, step=3)
    found = follow(sequence, np.zeros(column.size, int), position)
    true = truth(breathing, 0, column, row)
    inside = (column > 36) & (column < 60) & (row > 28) & (row < 52)
    assert not found.followed[2:5, inside].any() and found.followed[5, inside].mean() > 0.9
    error = np.linalg.norm(found.position - true, axis=1)[2:5, inside].mean()
    assert error < 0.2 * np.linalg.norm(true - true[0], axis=1)[2:5, inside].mean()


def test_a_lost_point_without_points_around_it_stays(breathing):
    sequence = covered_for_a_while(breathing)
    position, column, row = lifted(sequence, 0)
    inside = (column > 36) & (column < 60) & (row > 28) & (row < 52)
    found = follow(sequence, np.zeros(inside.sum(), int), position[:, inside])
    np.testing.assert_array_equal(found.position[4], found.position[1])


def test_a_jump_of_the_depth_loses_a_point(still):
    depth = still.depth.copy()
    depth[still.train_index[1]] *= 1.5
    _, found = from_the_start(dataclasses.replace(still, depth=depth))
    assert not found.followed[1].any() and found.followed[2].all()
    np.testing.assert_array_equal(found.position[1], found.position[0])


def test_no_held_out_frame_is_read(breathing):
    sequence = breathing.sequence
    images, depth = sequence.images.copy(), sequence.depth.copy()
    images[sequence.test_index], depth[sequence.test_index] = 0, 1
    changed = dataclasses.replace(sequence, images=images, depth=depth)
    np.testing.assert_array_equal(from_the_start(changed)[1].position, from_the_start(sequence)[1].position)


def test_a_point_behind_a_camera_is_not_followed(still):
    def behind(position):
        position[2, 0] *= -1

    _, found = from_the_start(still, behind)
    assert not found.followed[1:, 0].any() and np.isfinite(found.position).all()


def test_one_training_frame_needs_no_flow(monkeypatch, breathing):
    monkeypatch.setattr(tracks, "flows_between", lambda *a: pytest.fail("no pair of frames"))
    sequence = breathing.sequence
    position, found = from_the_start(dataclasses.replace(sequence, train_index=sequence.train_index[:1]))
    np.testing.assert_array_equal(found.position, position[None].astype(np.float32))


@pytest.mark.parametrize("threads, kept_bytes", [(1, 1e9), (2, 1e9), (1, 1.0), (2, 1.0)])
def test_tracks_are_bitwise_equal_for_every_number_of_threads_and_for_flows_made_again(
    threads, kept_bytes, breathing, monkeypatch
):
    sequence = breathing.sequence
    places = range(len(sequence.train_index))
    position, start = [], []
    for place in places:
        position.append(lifted(sequence, place, 16)[0])
        start += [place] * position[-1].shape[1]
    position, start, before = np.concatenate(position, axis=1), np.array(start), numba.get_num_threads()
    expected = follow(sequence, start, position)
    monkeypatch.setattr(tracks, "KEPT_BYTES", kept_bytes)
    numba.set_num_threads(min(threads, before))
    try:
        found = follow(sequence, start, position)
    finally:
        numba.set_num_threads(before)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_an_error_in_one_direction_stops_the_other(breathing, monkeypatch):
    """Both directions need flows until the last frame; with the stop, the other one asks for one more at most."""
    asked, failed = [], threading.Event()
    real = tracks.flows_between

    def failing(sequence, earlier, later):
        if earlier == int(sequence.train_index[0]):
            failed.set()
            raise RuntimeError("no flow")
        assert failed.wait(30)
        time.sleep(0.2)  # for the other thread to leave
        asked.append(earlier)
        return real(sequence, earlier, later)

    monkeypatch.setattr(tracks, "flows_between", failing)
    position, *_ = lifted(breathing.sequence, 4)
    with pytest.raises(RuntimeError, match="no flow"):
        follow(breathing.sequence, np.full(position.shape[1], 4), position)
    assert len(asked) <= 1
