"""Exposure of the frames in training: a known gain is found, a run without it has nothing of it."""

import copy
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from endotsr.config import (
    Config,
    DensityConfig,
    InitialisationConfig,
    LossConfig,
    ModelConfig,
    OptimiserConfig,
    TrainingConfig,
)
from endotsr.errors import InputError
from endotsr.evaluation.metrics import psnr_tissue
from endotsr.fitting import model as model_module
from endotsr.fitting.checkpoint import load_checkpoint
from endotsr.fitting.model import render_at
from endotsr.fitting.state import new_training, save_state, state_from_checkpoint, workshop
from endotsr.fitting.trainer import train, training_step
from endotsr.scene.parameters import exposure_of, trained
from endotsr.simulator.settings import Brightening, Highlights, SimulatorSettings
from endotsr.simulator.settings import Exposure as CameraExposure
from endotsr.simulator.simulate import simulate

GAIN = np.array([1.0, 0.97, 0.75, 0.8, 0.85, 1.0, 0.7, 0.75, 0.8, 0.95, 0.8, 0.7])  # of the frames, known


def settings(exposure: bool, **training) -> Config:
    """The base model: nothing but the exposure can follow a change of brightness."""
    model = ModelConfig(
        appearance=False, spectral_motion=False, laplacian=False, bases=4, initial_width=0.2, exposure=exposure
    )
    return Config(
        model=model,
        loss=LossConfig(ssim_weight=0.0),
        optimiser=OptimiserConfig(exposure=0.01),
        density=DensityConfig(start=60, interval=30, until=150),
        initialisation=InitialisationConfig(first_frame_points=700, other_frame_points=120),
        training=TrainingConfig(**({"iterations": 300, "harmonics_interval": 1000} | training)),
    )


@pytest.fixture(scope="module")
def clip():
    """A simulated clip whose frames were made darker by `GAIN`; highlights are not cut off, as no gain is above 1."""
    constant = {
        "exposure": CameraExposure(on=False),
        "brightening": Brightening(on=False),
        "highlights": Highlights(on=False),
    }
    still = simulate(SimulatorSettings(width=48, height=32, frames=len(GAIN), **constant)).sequence
    dimmed = np.rint(still.images * GAIN[:, None, None, None]).astype(np.uint8)
    return replace(still, images=dimmed)


def trained_on(clip, config):
    state = new_training(clip, config)
    return train(state, clip, config, lambda entry: None, lambda reached: None)


@pytest.fixture(scope="module")
def runs(clip):
    return {on: trained_on(clip, settings(on)) for on in (False, True)}


def mean_psnr(clip, state, config, indices):
    shop = workshop(clip, config)
    found = []
    for i in indices:
        out = render_at(
            state.gaussians, shop.spectral, config, clip.cameras[i], float(clip.times[i]), frames=state.frames
        )
        found.append(psnr_tissue(out.colour, clip.images[i] / 255.0, clip.masks[i]))
    return float(np.mean(found))


def test_a_clip_with_known_gains_is_fitted_better_with_exposure(clip, runs):
    off, on = (mean_psnr(clip, runs[k], settings(k), clip.train_index) for k in (False, True))
    assert on > off + 1.0, f"training frames: {off:.2f} dB without, {on:.2f} dB with exposure"


def test_the_gains_are_found_up_to_one_factor(clip, runs):
    """At mid grey, since gain and bias can stand in for each other; relative to their mean over the frames."""
    frames = runs[True].frames
    level = 0.4
    found = (np.exp(frames.exposure_log_gain) * level + frames.exposure_bias).mean(axis=0)
    wanted = GAIN[clip.train_index]
    assert np.corrcoef(found, wanted)[0, 1] > 0.95
    assert np.ptp(found / found.mean()) == pytest.approx(np.ptp(wanted / wanted.mean()), rel=0.25)


def test_off_nothing_is_allocated_or_computed(clip, runs, monkeypatch):
    state, config = runs[False], settings(False)
    assert state.frames is None and trained(state.frames) == {} and exposure_of(state.frames, 0) is None
    assert not [name for name in state.adam.first if "exposure" in name]

    def forbidden(*_):
        raise AssertionError("computed although it is off")

    monkeypatch.setattr(model_module, "exposure_forward", forbidden)
    monkeypatch.setattr(model_module, "exposure_reverse", forbidden)
    short = msgspec.structs.replace(config, training=msgspec.structs.replace(config.training, iterations=3))
    trained_on(clip, short)


def test_identity_exposure_that_is_not_trained_changes_no_bit(clip):
    """A rate of 0: the same Gaussians as without exposure."""
    configs = [settings(on, iterations=40) for on in (False, True)]
    configs[1] = msgspec.structs.replace(configs[1], optimiser=OptimiserConfig(exposure=0.0))
    one, two = (trained_on(clip, config).gaussians for config in configs)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a, b)


def test_density_control_leaves_frames_and_their_moments_alone(clip, runs):
    state = runs[True]
    assert state.gaussians.count != new_training(clip, settings(True)).gaussians.count
    assert all(a.shape == (3, len(clip.train_index)) for a in trained(state.frames).values())
    assert state.adam.step["exposure_bias"] == state.adam.step["exposure_log_gain"] == 300


def test_a_resumed_run_has_the_bits_of_an_uninterrupted_one(clip, tmp_path):
    config = settings(True, iterations=20)
    state, shop = new_training(clip, config), workshop(clip, config)
    for _ in range(10):
        training_step(state, shop)
    save_state(tmp_path / "a.npz", state, config)
    resumed = state_from_checkpoint(load_checkpoint(tmp_path / "a.npz"), config)
    for now in (state, resumed):
        train(now, clip, config, lambda entry: None, lambda reached: None)
    for name, array in trained(state.frames).items():
        assert array.any()
        np.testing.assert_array_equal(trained(resumed.frames)[name], array)
        np.testing.assert_array_equal(resumed.adam.second[name], state.adam.second[name])
    np.testing.assert_array_equal(resumed.frames.times, clip.times[clip.train_index])


def test_a_checkpoint_without_frames_has_no_entry_of_them_and_loads(clip, tmp_path):
    config = settings(False, iterations=2)
    save_state(tmp_path / "old.npz", trained_on(clip, config), config)
    with np.load(tmp_path / "old.npz") as file:
        assert not [name for name in file.files if "frames" in name or "exposure" in name]
    assert load_checkpoint(tmp_path / "old.npz").frames is None


def test_frames_of_another_length_are_refused_by_name(clip, tmp_path):
    config = settings(True, iterations=2)
    state = trained_on(clip, config)
    broken = copy.deepcopy(state)
    broken.frames = broken.frames._replace(exposure_bias=broken.frames.exposure_bias[:, :-1])
    save_state(tmp_path / "a.npz", broken, config)
    with pytest.raises(InputError, match=r"a\.npz: exposure_bias: \(3, \d+\) for \d+ training frames"):
        load_checkpoint(tmp_path / "a.npz")
    state.frames.exposure_log_gain[1, 2] = np.nan
    with pytest.raises(FloatingPointError, match=r"exposure_log_gain\[1, 2\] is nan"):
        save_state(tmp_path / "a.npz", state, config)
