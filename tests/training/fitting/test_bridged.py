"""Bridged times between the training frames: which are drawn, what is kept of them, and that a training uses them."""

import itertools
import time
from collections import Counter

import msgspec
import numba
import numpy as np
import pytest

from endotsr.clips.flow import between
from endotsr.clips.flow.between import flows_between, frame_between, gap_between
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import DEMO, TrainingConfig
from endotsr.method.kernels.memory import Kept
from endotsr.training.fitting import bridged as module
from endotsr.training.fitting.bridged import BridgedTargets, TargetsAhead
from endotsr.training.fitting.objective import frame_targets
from endotsr.training.fitting.packed import STEPS
from endotsr.training.fitting.sampling import BridgedTime, draw_view
from endotsr.training.fitting.state import new_training, training_constants
from endotsr.training.fitting.trainer import train, training_step

FLOW = TrainingConfig(bridge_fraction=1.0)


@pytest.fixture(scope="module")
def sequence():
    """Eleven frames, of which 1 and 9 are held out: gaps of 2, 1, 1 ... and 2."""
    return simulate(SimulatorSettings(frames=11, width=64, height=48)).sequence


def test_every_time_of_every_gap_is_drawn_alike(sequence):
    rng = np.random.default_rng(0)
    views = [draw_view(rng, sequence, FLOW) for _ in range(6000)]
    found = Counter(view.bridged for view in views)
    train = [int(i) for i in sequence.train_index]
    wanted = {BridgedTime(a, b, k / (2 * (b - a))) for a, b in itertools.pairwise(train) for k in range(1, 2 * (b - a))}
    assert set(found) == wanted and len(wanted) == 2 * 3 + 6
    assert all(abs(count - 6000 / len(wanted)) < 5 * np.sqrt(6000 / len(wanted)) for count in found.values())
    for view in views[:200]:
        assert view.bridged is not None and view.index in (view.bridged.earlier, view.bridged.later)
        assert view.t == pytest.approx((view.bridged.earlier + view.bridged.fraction * (view.bridged.later -
                                        view.bridged.earlier)) / sequence.count)  # fmt: skip


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_the_targets_of_a_bridged_time_are_those_of_the_equation(sequence, precision):
    config = msgspec.structs.replace(DEMO, training=msgspec.structs.replace(DEMO.training, precision=precision))
    made = frame_between(sequence, gap_between(sequence, 0, 2, flows_between(sequence, 0, 2)), 0.75)
    stored = np.divide(np.rint(made.image * STEPS), STEPS, dtype=precision)
    wanted = frame_targets(made._replace(image=stored, depth=made.depth.astype(precision)), config)
    found, camera = BridgedTargets(sequence, config).observed(BridgedTime(0, 2, 0.75))
    assert np.abs(found.image - np.where(made.mask, made.image, 0)).max() <= 0.51 / STEPS
    assert camera == made.camera and found.image.dtype == precision
    assert found.depth.normalised.dtype == precision
    assert np.abs(found.depth.normalised - wanted.depth.normalised).max() <= 0.51 / STEPS
    depth = wanted.depth._replace(normalised=found.depth.normalised)
    for a, b in zip(flat(found), flat(wanted._replace(depth=depth)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_targets_of_a_frame_are_those_of_its_picture(sequence):
    constants = training_constants(sequence, DEMO)
    for a, b in zip(flat(constants.targets_of(3)), flat(frame_targets(sequence.frame(3), DEMO)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_is_kept_of_a_bridged_time_takes_nine_bytes_a_pixel(sequence):
    kept = BridgedTargets(sequence, DEMO)
    kept.observed(BridgedTime(0, 2, 0.5))  # and the two others of the gap
    height, width = sequence.images.shape[2:]
    assert 8.0 < kept.stored.bytes / (3 * height * width) < 9.0


def flat(value):
    """The arrays and numbers in nested tuples."""
    return [leaf for part in value for leaf in flat(part)] if isinstance(value, tuple) else [value]


def test_the_flows_and_the_pictures_of_a_gap_are_computed_once(sequence, monkeypatch):
    asked, filled = [], []
    real, fill = module.flows_between, between.tissue_colours
    monkeypatch.setattr(module, "flows_between", lambda *rest: asked.append(rest[1:]) or real(*rest))
    monkeypatch.setattr(between, "tissue_colours", lambda *rest: filled.append(rest[1]) or fill(*rest))
    kept = BridgedTargets(sequence, DEMO)
    for fraction in (0.25, 0.5, 0.75, 0.5):
        kept.observed(BridgedTime(0, 2, fraction))
    assert asked == [(0, 2)] and filled == [0, 2]


def test_a_training_compares_with_bridged_times(sequence):
    config = msgspec.structs.replace(
        DEMO,
        training=msgspec.structs.replace(DEMO.training, bridge_fraction=1.0, iterations=6),
        initialisation=msgspec.structs.replace(DEMO.initialisation, first_frame_points=300, other_frame_points=60),
    )
    constants, state = training_constants(sequence, config), new_training(sequence, config)
    entries = [training_step(state, constants) for _ in range(4)]
    assert not len(constants.supports) and len(constants.bridged.stored)  # no frame was looked at
    assert all(np.isfinite(entry["loss"]) for entry in entries)


def test_without_bridges_no_target_is_made(sequence):
    training = msgspec.structs.replace(DEMO.training, bridge_fraction=0.0)
    config = msgspec.structs.replace(DEMO, training=training)
    constants, state = training_constants(sequence, config), new_training(sequence, config)
    for _ in range(4):
        training_step(state, constants)
    assert not len(constants.bridged.stored)


needs_two_threads = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT) or numba.config.NUMBA_NUM_THREADS < 2, reason="targets are not computed ahead"
)


def wait_for(condition):
    limit = time.monotonic() + 60
    while not condition() and time.monotonic() < limit:
        time.sleep(0.01)
    assert condition()


def test_the_wait_for_targets_is_counted_once_for_each_gap(sequence):
    targets, clock = BridgedTargets(sequence, DEMO), time.perf_counter
    first = int(sequence.train_index[0]), int(sequence.train_index[1])
    began = clock()
    targets.observed(BridgedTime(*first, 0.5))
    whole, found = clock() - began, targets.making
    assert found.gaps == 1 and 0 < found.waited <= whole and found.beside == 0
    targets.observed(BridgedTime(*first, 0.5))
    assert targets.making == found


@needs_two_threads
def test_targets_computed_ahead_have_the_same_bits(sequence):
    numba.set_num_threads(2)
    ready, late = BridgedTargets(sequence, DEMO), BridgedTargets(sequence, DEMO)
    with TargetsAhead() as ahead:
        ahead.follow(ready)
        wait_for(lambda: len(ready.stored) == len(sequence.train_index) - 1)
    for a, b in itertools.pairwise(map(int, sequence.train_index)):
        for one, two in zip(flat(ready.observed(BridgedTime(a, b, 0.5))), flat(late.observed(BridgedTime(a, b, 0.5)))):
            np.testing.assert_array_equal(one, two)


@needs_two_threads
def test_nothing_is_computed_ahead_that_there_is_no_room_for(sequence):
    numba.set_num_threads(2)
    first = BridgedTargets(sequence, DEMO)
    first.of_gap(0, 2)
    limited = BridgedTargets(sequence, DEMO, Kept(2.5 * first.stored.bytes))
    with TargetsAhead() as ahead:
        ahead.follow(limited)
        wait_for(lambda: not ahead._thread.is_alive())
    assert limited.making.beside > 0 == limited.making.waited and limited.making.gaps >= len(limited.stored)
    kept = [(int(a), int(b)) for a, b in itertools.pairwise(sequence.train_index) if (a, b) in limited.stored]
    assert kept and kept[0] == (0, 2) and len(kept) < len(sequence.train_index) - 1


@pytest.mark.parametrize("threads", [1, 2])
def test_a_training_does_not_depend_on_what_was_ready(sequence, threads):
    training = {"bridge_fraction": 1.0, "iterations": 12, "threads": threads}
    points = msgspec.structs.replace(DEMO.initialisation, first_frame_points=300, other_frame_points=60)
    config = msgspec.structs.replace(
        DEMO, training=msgspec.structs.replace(DEMO.training, **training), initialisation=points
    )
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
    state, constants = new_training(sequence, config), training_constants(sequence, config)
    while state.iteration < 12:
        training_step(state, constants)
    numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    other = train(new_training(sequence, config), sequence, config, lambda _: None, lambda _: None)
    np.testing.assert_array_equal(other.gaussians.position, state.gaussians.position)
    np.testing.assert_array_equal(other.gaussians.harmonics, state.gaussians.harmonics)
