"""The coarse start (B17): when it ends, what it is compared with, and that a stopped run goes on the same way."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from endotsr.clips.sequences.smaller import halved
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import DEMO, Config
from endotsr.training.fitting import coarse_start
from endotsr.training.fitting.checkpoint import load_checkpoint
from endotsr.training.fitting.coarse_start import CHECK_EVERY, coarse_ends, expected_end, lacking
from endotsr.training.fitting.state import new_training, save_state, state_from_checkpoint
from endotsr.training.fitting.trainer import train
from endotsr.training.scene.gaussians import arrays


@pytest.fixture(scope="module")
def sequence():
    return simulate(SimulatorSettings(frames=11, width=64, height=48)).sequence


def settings(iterations=120, **training) -> Config:
    points = msgspec.structs.replace(DEMO.initialisation, first_frame_points=300, other_frame_points=60)
    training = {"coarse_start": True, "iterations": iterations, "checkpoint_every": 40} | training
    return msgspec.structs.replace(
        DEMO, initialisation=points, training=msgspec.structs.replace(DEMO.training, **training)
    )


def run(sequence, config, state=None):
    """The last state, and the size of the frames by iteration."""
    state, sizes, said = state or new_training(sequence, config), [], []
    step = coarse_start.training_constants

    def watched(frames, changed):
        sizes.append((state.iteration, frames.width))
        return step(frames, changed)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coarse_start, "training_constants", watched)
        patch.setattr("endotsr.training.fitting.trainer.training_constants", watched)
        train(state, sequence, config, lambda entry: None, lambda _: None, on_message=said.append)
    return state, sizes, said


def test_half_the_size_is_what_the_reader_makes(sequence):
    half = halved(sequence, 0.0)
    assert (half.width, half.height, half.count) == (32, 24, 11)
    blocks = sequence.images.reshape(11, 3, 24, 2, 32, 2).mean((3, 5))
    assert np.abs(half.images - blocks).max() <= 0.5
    np.testing.assert_array_equal(half.masks, sequence.masks.reshape(11, 24, 2, 32, 2).all((2, 4)))
    assert half.cameras[0].fx == sequence.cameras[0].fx / 2 and len({id(c) for c in half.cameras}) == 1
    assert isinstance(halved(sequence, 1e-9).images.base, np.memmap), "what does not fit lies in a file"
    odd = halved(simulate(SimulatorSettings(frames=3, width=65, height=49)).sequence, 0.0)
    assert (odd.width, odd.height) == (32, 24)


def test_it_ends_when_the_fit_is_as_near_as_the_frames(sequence, monkeypatch):
    errors = iter([2.0, 1.1, 0.9])
    monkeypatch.setattr(coarse_start, "lacking", lambda *_: 1.0)
    monkeypatch.setattr(coarse_start, "fit_error", lambda *_: next(errors))
    state, sizes, said = run(sequence, settings(iterations=4 * CHECK_EVERY))
    assert sizes == [(0, 32), (3 * CHECK_EVERY, 64)] and not state.coarse
    assert said[0].startswith("coarse start: half-size frames") and said[-1].endswith(f"iteration {3 * CHECK_EVERY}")


def test_it_ends_with_the_growth_at_the_latest(sequence, monkeypatch):
    monkeypatch.setattr(coarse_start, "fit_error", lambda *_: 2.0)
    monkeypatch.setattr(coarse_start, "lacking", lambda *_: 1.0)
    config = settings()
    config = msgspec.structs.replace(config, density=msgspec.structs.replace(config.density, until=70))
    assert run(sequence, config)[1] == [(0, 32), (70, 64)]


def test_no_coarse_start_without_the_setting_or_for_small_frames(sequence):
    assert not new_training(sequence, settings(coarse_start=False)).coarse
    assert new_training(sequence, settings()).coarse and not new_training(halved(sequence, 0.0), settings()).coarse


def test_a_check_changes_nothing_and_a_better_fit_has_less_error(sequence):
    config = settings()
    state = new_training(sequence, config)
    start = coarse_start.coarse_start(sequence, config)
    constants, frames = start.constants, start.frames
    assert len(frames) == 8 and {frames[0], frames[-1]} == {sequence.train_index[0], sequence.train_index[-1]}
    before = {name: a.copy() for name, a in arrays(state.gaussians).items()}
    generator = dict(state.rng.bit_generator.state)
    state.iteration = CHECK_EVERY
    poor = coarse_start.fit_error(state, constants, frames)
    assert not coarse_ends(state, start)
    latest = start.constants.config.density.until
    assert state.coarse_until == min(int(CHECK_EVERY * (poor / start.lacking) ** 2), latest) > CHECK_EVERY
    assert expected_end(100, 2 * start.lacking, start) == min(400, latest)
    assert expected_end(100, 0.5 * start.lacking, start) == min(100, latest)
    assert expected_end(100, 0.5, start._replace(lacking=0.0)) == latest
    assert all(np.array_equal(a, before[name]) for name, a in arrays(state.gaussians).items())
    assert state.rng.bit_generator.state == generator
    state.coarse_until = told = latest - 40
    assert not coarse_ends(state, start)
    alone = min(int(CHECK_EVERY * (poor / start.lacking) ** 2), latest)
    assert state.coarse_until == (told + alone) // 2 != alone, "the mean with the checks before"
    state.iteration = 0
    trained, *_ = run(sequence, settings(iterations=60))
    assert coarse_start.fit_error(trained, constants, frames) < 0.95 * poor


def test_what_the_half_lacks_is_the_finest_band(sequence):
    """A picture that is constant in blocks of an even ramp lacks nothing; noise of one pixel lacks its size."""
    frames = sequence.train_index[:2]
    smooth = with_images(sequence, np.full_like(sequence.images, 90))
    assert lacking(smooth, frames) == pytest.approx(0, abs=1e-6)
    checker = (np.indices((48, 64)).sum(0) % 2 * 20 + 100).astype(np.uint8)
    noisy = with_images(sequence, np.broadcast_to(checker, sequence.images.shape).copy())
    assert lacking(noisy, frames) == pytest.approx(10 / 255, rel=0.01)
    left = np.arange(64) < 32
    half_noisy = with_images(sequence, np.where(left, checker, 110).astype(np.uint8) + np.zeros_like(sequence.images))
    tissue = replace(half_noisy, masks=np.broadcast_to(~left, sequence.masks.shape).copy())
    assert lacking(tissue, frames) == pytest.approx(0, abs=1e-6), "excluded pixels do not count"
    assert lacking(half_noisy, frames) > 4 / 255


def with_images(sequence, images):
    return replace(sequence, images=images, masks=np.ones_like(sequence.masks))


def test_a_stopped_run_goes_on_the_same_way(sequence, tmp_path, monkeypatch):
    """Stopped within the coarse start: the same parameters as without the stop, bit by bit."""
    errors = {50: 2.0, 100: 0.5}
    monkeypatch.setattr(coarse_start, "lacking", lambda *_: 1.0)
    monkeypatch.setattr(coarse_start, "fit_error", lambda state, *_: errors[state.iteration])
    whole, sizes, _ = run(sequence, settings())
    assert sizes == [(0, 32), (100, 64)]
    first = new_training(sequence, settings())

    class Stop(Exception):
        pass

    def stop(entry):
        if entry["iteration"] == 60:
            raise Stop

    with pytest.raises(Stop):
        train(first, sequence, settings(), stop, lambda state: None, on_message=lambda line: None)
    save_state(tmp_path / "c.npz", first, settings())
    second = state_from_checkpoint(load_checkpoint(tmp_path / "c.npz"), settings())
    assert second.coarse and second.iteration == 60
    again, sizes, _ = run(sequence, settings(), second)
    assert sizes == [(60, 32), (100, 64)]
    for name, array in arrays(whole.gaussians).items():
        np.testing.assert_array_equal(array, getattr(again.gaussians, name), err_msg=name)


def test_a_frame_without_tissue_is_no_perfect_fit(sequence):
    """The error of the others decides, as their detail does."""
    config, masks, index = settings(), sequence.masks.copy(), sequence.train_index
    masks[index[::2]] = False
    start = coarse_start.coarse_start(replace(sequence, masks=masks), config)
    assert len(start.frames) and set(start.frames) <= set(index[1::2])
    assert start.lacking == lacking(sequence, start.frames)
    state, whole = new_training(sequence, config), coarse_start.coarse_start(sequence, config)
    error = coarse_start.fit_error(state, start.constants, start.frames)
    assert error == coarse_start.fit_error(state, whole.constants, start.frames) > 0
    nothing = coarse_start.coarse_start(replace(sequence, masks=np.zeros_like(masks)), config)
    assert len(nothing.frames) == 8 and nothing.lacking == 0.0, "it ends at the latest"
