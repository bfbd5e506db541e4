"""Correction of poses in training: disturbed poses are found, and a run without it has nothing of it."""

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
from endotsr.evaluation.run import measure_model
from endotsr.export.model import load_slim_model, save_slim_model
from endotsr.fitting import model as model_module
from endotsr.fitting.checkpoint import load_checkpoint
from endotsr.fitting.model import corrected, corrected_cameras, spectral_from, with_corrected_cameras
from endotsr.fitting.state import new_training, save_state, state_from_checkpoint, workshop
from endotsr.fitting.trainer import train, training_step
from endotsr.runs.files import finite
from endotsr.runs.model import Model
from endotsr.runs.sources import remembered_cameras, sequence_record
from endotsr.scene.parameters import Pose, trained
from endotsr.simulator.settings import SimulatorSettings, with_effects
from endotsr.simulator.simulate import simulate

SIDEWAYS = 4.0  # mm, by which every second training camera is off


def settings(correct: bool, **training) -> Config:
    """A rigid scene: nothing but the correction can follow a wrong pose."""
    return Config(
        model=ModelConfig(
            appearance=False, spectral_motion=False, laplacian=False, deformation=False, pose_correction=correct
        ),
        loss=LossConfig(ssim_weight=0.0),
        optimiser=OptimiserConfig(pose=2e-3),
        density=DensityConfig(start=1000),
        initialisation=InitialisationConfig(first_frame_points=900, other_frame_points=100),
        training=TrainingConfig(**({"iterations": 300, "harmonics_interval": 1000} | training)),
    )


@pytest.fixture(scope="module")
def clip():
    """A scene at rest before a camera that moves."""
    chosen = with_effects(SimulatorSettings(width=64, height=48, frames=10), "camera_motion")
    return simulate(chosen).sequence


@pytest.fixture(scope="module")
def disturbed(clip):
    """Every second training camera stands aside."""
    cameras = list(clip.cameras)
    for i in clip.train_index[1::2]:
        cameras[i] = cameras[i]._replace(translation=cameras[i].translation + [SIDEWAYS, 0, 0])
    return replace(clip, cameras=cameras)


def trained_on(clip, config):
    state = new_training(clip, config)
    return train(state, clip, config, lambda entry: None, lambda reached: None)


@pytest.fixture(scope="module")
def runs(disturbed):
    return {on: trained_on(disturbed, settings(on)) for on in (False, True)}


def model_of(state, clip, config):
    times = clip.times[clip.train_index]
    return Model(state.gaussians, spectral_from(config.model, times), config, state.iteration, state.frames)


def test_wrong_poses_are_found_up_to_a_common_motion(clip, disturbed, runs):
    """A shift and a turn of a camera move the picture alike: compared is where a point of the scene is seen."""
    cameras = corrected_cameras(runs[True].frames, disturbed.cameras, disturbed.times)
    depth = np.median(clip.depth[clip.depth > 0])
    own = [camera.rotation.T @ ([0, 0, depth] - camera.translation) for camera in clip.cameras]
    point = np.mean(own, axis=0)

    def columns(seen):
        places = [c.rotation @ point + c.translation for c in (seen[i] for i in clip.train_index)]
        return np.array([c.fx * p[0] / p[2] for c, p in zip(clip.cameras, places)])

    before = columns(disturbed.cameras) - columns(clip.cameras)
    after = columns(cameras) - columns(clip.cameras)
    assert np.std(before) > 0.4, "the disturbance is too small to be seen"
    assert np.std(after) < 0.35 * np.std(before)


def test_training_frames_are_fitted_as_with_the_true_poses(clip, disturbed, runs):
    def mean(state, sequence, correct):
        metrics, _ = measure_model(model_of(state, sequence, settings(correct)), sequence)
        return metrics["training"]["mean"]["psnr_tissue"]

    best = mean(trained_on(clip, settings(False)), clip, False)
    off, on = (mean(runs[k], disturbed, k) for k in (False, True))
    assert best > off + 0.5, "the disturbance costs nothing"
    assert on > off + 0.7 * (best - off)


def test_off_nothing_is_allocated_or_computed(disturbed, runs, monkeypatch):
    state = runs[False]
    assert state.frames is None and not [name for name in state.adam.first if "pose" in name]

    def forbidden(*_):
        raise AssertionError("computed although it is off")

    monkeypatch.setattr(model_module, "pose_forward", forbidden)
    monkeypatch.setattr(model_module, "pose_reverse", forbidden)
    trained_on(disturbed, settings(False, iterations=3))


def test_a_correction_that_is_not_trained_changes_no_bit(disturbed):
    """A rate of 0: the same Gaussians as without correction."""
    configs = [settings(on, iterations=20) for on in (False, True)]
    configs[1] = msgspec.structs.replace(configs[1], optimiser=OptimiserConfig(pose=0.0))
    one, two = (trained_on(disturbed, config).gaussians for config in configs)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a, b)


def test_translations_move_in_proportion_to_the_depth(disturbed):
    """The rate of the translation is in depths: the first step of Adam is its rate, whatever the gradient."""
    config = settings(True, iterations=300)
    state, shop = new_training(disturbed, config), workshop(disturbed, config)
    training_step(state, shop)
    steps = [np.abs(trained(state.frames)[f"pose_{name}"]).max() for name in ("rotation", "translation")]
    assert shop.depth == pytest.approx(np.median(disturbed.depth[disturbed.depth > 0]), rel=0.2)
    assert steps[1] / steps[0] == pytest.approx(shop.depth, rel=1e-5)


def test_a_resumed_run_has_the_bits_of_an_uninterrupted_one(disturbed, tmp_path):
    config = settings(True, iterations=16)
    state, shop = new_training(disturbed, config), workshop(disturbed, config)
    for _ in range(8):
        training_step(state, shop)
    save_state(tmp_path / "a.npz", state, config)
    resumed = state_from_checkpoint(load_checkpoint(tmp_path / "a.npz"), config)
    for now in (state, resumed):
        train(now, disturbed, config, lambda entry: None, lambda reached: None)
    for name, array in trained(state.frames).items():
        assert array.any()
        np.testing.assert_array_equal(trained(resumed.frames)[name], array)
        np.testing.assert_array_equal(resumed.adam.second[name], state.adam.second[name])


def test_one_of_the_two_arrays_alone_is_refused(disturbed, tmp_path):
    config = settings(True, iterations=1)
    state = trained_on(disturbed, config)
    state.frames = state.frames._replace(pose_translation=None)
    for named in (state.adam.first, state.adam.second, state.adam.step):
        del named["pose_translation"]
    save_state(tmp_path / "a.npz", state, config)
    with pytest.raises(InputError, match="pose_rotation, pose_translation: some are missing; allowed: all 2 or none"):
        load_checkpoint(tmp_path / "a.npz")


def test_a_camera_that_does_not_move_is_refused():
    still = simulate(SimulatorSettings(width=48, height=32, frames=8)).sequence
    with pytest.raises(InputError, match="pose_correction = true: the camera of this sequence does not move"):
        new_training(still, settings(True))


def test_a_slim_model_holds_the_corrected_cameras_and_no_correction(disturbed, runs, tmp_path):
    config = settings(True)
    record = finite(sequence_record(disturbed))
    save_slim_model(tmp_path / "a.npz", model_of(runs[True], disturbed, config), record)
    slim = load_slim_model(tmp_path / "a.npz")
    wanted = corrected_cameras(runs[True].frames, disturbed.cameras, disturbed.times)
    assert slim.model.frames is None
    for found, camera, given in zip(remembered_cameras(slim.record), wanted, disturbed.cameras, strict=True):
        np.testing.assert_array_equal(found.rotation, camera.rotation)
        np.testing.assert_array_equal(found.translation, camera.translation)
        assert not np.array_equal(found.translation, given.translation)


def test_a_sequence_without_corrections_is_the_sequence_itself(disturbed, runs):
    assert with_corrected_cameras(disturbed, None) is disturbed
    seen = with_corrected_cameras(disturbed, runs[True].frames)
    camera = disturbed.cameras[0]
    assert seen.images is disturbed.images and not np.array_equal(seen.cameras[0].rotation, camera.rotation)
    assert corrected(camera, None)[0] is camera
    moved, _ = corrected(camera, Pose(np.zeros(3), np.array([1.0, 2.0, 3.0])))
    np.testing.assert_array_equal(moved.translation, camera.translation + [1, 2, 3])
