"""Parameters of the frames in training: exposure (B13) and corrections of the poses (B16).

Known gains and disturbed poses are found, and a run without them has nothing of them.
"""

import copy
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from endotsr.clips.sequences.record import record_of
from endotsr.clips.simulator.sections import Brightening, GainDrift, Highlights
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate
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
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.results.evaluation.run import measure_model
from endotsr.results.export.model import load_slim_model, save_slim_model
from endotsr.training.fitting import model as model_module
from endotsr.training.fitting.checkpoint import load_checkpoint
from endotsr.training.fitting.model import (
    corrected_cameras,
    render_at,
    spectral_from,
)
from endotsr.training.fitting.state import new_training, save_state, state_from_checkpoint, training_constants
from endotsr.training.fitting.trainer import train, training_step
from endotsr.training.runs.model import Model
from endotsr.training.scene.parameters import exposure_of, trained

GAIN = np.array([1.0, 0.97, 0.75, 0.8, 0.85, 1.0, 0.7, 0.75, 0.8, 0.95, 0.8, 0.7])  # of the frames, known
SIDEWAYS = 4.0  # mm, by which every second training camera is off


def settings(part: str, on: bool, **training) -> Config:
    """The model with the exposure or the correction of the poses, or without it: nothing else can do its work."""
    off = {"appearance": False, "spectral_motion": False, "laplacian": False}
    lengths = {"iterations": 300, "harmonics_interval": 1000} | training
    if part == "exposure":
        return Config(
            model=ModelConfig(**off, bases=4, initial_width=0.2, exposure=on),
            loss=LossConfig(ssim_weight=0.0),
            optimiser=OptimiserConfig(exposure=0.01),
            density=DensityConfig(start=60, interval=30, until=150),
            initialisation=InitialisationConfig(first_frame_points=700, other_frame_points=120),
            training=TrainingConfig(**lengths),
        )
    return Config(
        model=ModelConfig(**off, deformation=False, pose_correction=on),
        loss=LossConfig(ssim_weight=0.0),
        optimiser=OptimiserConfig(pose=2e-3),
        density=DensityConfig(start=1000),
        initialisation=InitialisationConfig(first_frame_points=900, other_frame_points=100),
        training=TrainingConfig(**lengths),
    )


@pytest.fixture(scope="module")
def dimmed():
    """A simulated clip whose frames were made darker by `GAIN`; highlights are not cut off, as no gain is above 1."""
    constant = {
        "exposure": GainDrift(on=False),
        "brightening": Brightening(on=False),
        "highlights": Highlights(on=False),
    }
    still = simulate(SimulatorSettings(width=48, height=32, frames=len(GAIN), **constant)).sequence
    return replace(still, images=np.rint(still.images * GAIN[:, None, None, None]).astype(np.uint8))


@pytest.fixture(scope="module")
def moving():
    """A scene at rest before a camera that moves."""
    chosen = with_effects(SimulatorSettings(width=64, height=48, frames=10), "camera_motion")
    return simulate(chosen).sequence


@pytest.fixture(scope="module")
def disturbed(moving):
    """Every second training camera stands aside."""
    cameras = list(moving.cameras)
    for i in moving.train_index[1::2]:
        cameras[i] = cameras[i]._replace(translation=cameras[i].translation + [SIDEWAYS, 0, 0])
    return replace(moving, cameras=cameras)


@pytest.fixture(scope="module")
def clips(dimmed, disturbed):
    return {"exposure": dimmed, "pose": disturbed}


def trained_on(clip, config):
    state = new_training(clip, config)
    return train(state, clip, config, lambda entry: None, lambda reached: None)


@pytest.fixture(scope="module")
def runs(clips):
    """Trained states by part and whether it is on."""
    return {(part, on): trained_on(clips[part], settings(part, on)) for part in clips for on in (False, True)}


both = pytest.mark.parametrize("part", ["exposure", "pose"])


# --- both ---


@both
def test_off_nothing_is_allocated_or_computed(part, clips, runs, monkeypatch):
    state = runs[part, False]
    assert state.frames is None and trained(state.frames) == {} and exposure_of(state.frames, 0) is None
    assert not [name for name in state.adam.first if part in name]

    def forbidden(*_):
        raise AssertionError("computed although it is off")

    monkeypatch.setattr(model_module, f"{part}_forward", forbidden)
    monkeypatch.setattr(model_module, f"{part}_reverse", forbidden)
    trained_on(clips[part], settings(part, False, iterations=3))


@both
def test_identity_that_is_not_trained_changes_no_bit(part, clips):
    """A rate of 0: the same Gaussians as without the part."""
    configs = [settings(part, on, iterations=40) for on in (False, True)]
    configs[1] = msgspec.structs.replace(configs[1], optimiser=OptimiserConfig(**{part: 0.0}))
    one, two = (trained_on(clips[part], config).gaussians for config in configs)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a, b)


@both
def test_a_resumed_run_has_the_bits_of_an_uninterrupted_one(part, clips, tmp_path):
    clip, config = clips[part], settings(part, True, iterations=20)
    state, constants = new_training(clip, config), training_constants(clip, config)
    for _ in range(10):
        training_step(state, constants)
    save_state(tmp_path / "a.npz", state, config)
    resumed = state_from_checkpoint(load_checkpoint(tmp_path / "a.npz"), config)
    for now in (state, resumed):
        train(now, clip, config, lambda entry: None, lambda reached: None)
    for name, array in trained(state.frames).items():
        assert array.any()
        np.testing.assert_array_equal(trained(resumed.frames)[name], array)
        np.testing.assert_array_equal(resumed.adam.second[name], state.adam.second[name])
    np.testing.assert_array_equal(resumed.frames.times, clip.times[clip.train_index])


# --- exposure ---


def mean_psnr(dimmed, state, config, indices):
    constants = training_constants(dimmed, config)
    found = []
    for i in indices:
        out = render_at(
            state.gaussians, constants.spectral, config, dimmed.cameras[i], float(dimmed.times[i]), frames=state.frames
        )
        found.append(psnr_tissue(out.colour, dimmed.images[i] / 255.0, dimmed.masks[i]))
    return float(np.mean(found))


def test_a_clip_with_known_gains_is_fitted_better_with_exposure(dimmed, runs):
    off, on = (
        mean_psnr(dimmed, runs["exposure", k], settings("exposure", k), dimmed.train_index) for k in (False, True)
    )
    assert on > off + 1.0, f"training frames: {off:.2f} dB without, {on:.2f} dB with exposure"


def test_the_gains_are_found_up_to_one_factor(dimmed, runs):
    """At mid grey, since gain and bias can stand in for each other; relative to their mean over the frames."""
    frames = runs["exposure", True].frames
    level = 0.4
    found = (np.exp(frames.exposure_log_gain) * level + frames.exposure_bias).mean(axis=0)
    wanted = GAIN[dimmed.train_index]
    assert np.corrcoef(found, wanted)[0, 1] > 0.95
    assert np.ptp(found / found.mean()) == pytest.approx(np.ptp(wanted / wanted.mean()), rel=0.25)


def test_density_control_leaves_frames_and_their_moments_alone(dimmed, runs):
    state = runs["exposure", True]
    assert state.gaussians.count != new_training(dimmed, settings("exposure", True)).gaussians.count
    assert all(a.shape == (3, len(dimmed.train_index)) for a in trained(state.frames).values())
    assert state.adam.step["exposure_bias"] == state.adam.step["exposure_log_gain"] == 300


def test_a_checkpoint_without_frames_has_no_entry_of_them_and_loads(dimmed, tmp_path):
    config = settings("exposure", False, iterations=2)
    save_state(tmp_path / "old.npz", trained_on(dimmed, config), config)
    with np.load(tmp_path / "old.npz") as file:
        assert not [name for name in file.files if "frames" in name or "exposure" in name]
    assert load_checkpoint(tmp_path / "old.npz").frames is None


def test_frames_of_another_length_are_refused_by_name(dimmed, tmp_path):
    config = settings("exposure", True, iterations=2)
    state = trained_on(dimmed, config)
    broken = copy.deepcopy(state)
    broken.frames = broken.frames._replace(exposure_bias=broken.frames.exposure_bias[:, :-1])
    save_state(tmp_path / "a.npz", broken, config)
    with pytest.raises(InputError, match=r"a\.npz: exposure_bias: \(3, \d+\) for \d+ training frames"):
        load_checkpoint(tmp_path / "a.npz")
    state.frames.exposure_log_gain[1, 2] = np.nan
    with pytest.raises(FloatingPointError, match=r"exposure_log_gain\[1, 2\] is nan"):
        save_state(tmp_path / "a.npz", state, config)


# --- correction of the poses ---


def model_of(state, clip, config):
    times = clip.times[clip.train_index]
    return Model(state.gaussians, spectral_from(config.model, times), config, state.iteration, state.frames)


def test_wrong_poses_are_found_up_to_a_common_motion(moving, disturbed, runs):
    """A shift and a turn of a camera move the picture alike: compared is where a point of the scene is seen."""
    cameras = corrected_cameras(runs["pose", True].frames, disturbed.cameras, disturbed.times)
    depth = np.median(moving.depth[moving.depth > 0])
    own = [camera.rotation.T @ ([0, 0, depth] - camera.translation) for camera in moving.cameras]
    point = np.mean(own, axis=0)

    def columns(seen):
        places = [c.rotation @ point + c.translation for c in (seen[i] for i in moving.train_index)]
        return np.array([c.fx * p[0] / p[2] for c, p in zip(moving.cameras, places)])

    before = columns(disturbed.cameras) - columns(moving.cameras)
    after = columns(cameras) - columns(moving.cameras)
    assert np.std(before) > 0.4, "the disturbance is too small to be seen"
    assert np.std(after) < 0.35 * np.std(before)


def test_training_frames_are_fitted_as_with_the_true_poses(moving, disturbed, runs):
    def mean(state, sequence, correct):
        metrics, _ = measure_model(model_of(state, sequence, settings("pose", correct)), sequence)
        return metrics["training"]["mean"]["psnr_tissue"]

    best = mean(trained_on(moving, settings("pose", False)), moving, False)
    off, on = (mean(runs["pose", k], disturbed, k) for k in (False, True))
    assert best > off + 0.5, "the disturbance costs nothing"
    assert on > off + 0.7 * (best - off)


def test_translations_move_in_proportion_to_the_depth(disturbed):
    """The rate of the translation is in depths: the first step of Adam is its rate, whatever the gradient."""
    config = settings("pose", True, iterations=300)
    state, constants = new_training(disturbed, config), training_constants(disturbed, config)
    training_step(state, constants)
    steps = [np.abs(trained(state.frames)[f"pose_{name}"]).max() for name in ("rotation", "translation")]
    assert constants.depth == pytest.approx(np.median(disturbed.depth[disturbed.depth > 0]), rel=0.2)
    assert steps[1] / steps[0] == pytest.approx(constants.depth, rel=1e-5)


def test_one_of_the_two_arrays_alone_is_refused(disturbed, tmp_path):
    config = settings("pose", True, iterations=1)
    state = trained_on(disturbed, config)
    state.frames = state.frames._replace(pose_translation=None)
    for named in (state.adam.first, state.adam.second, state.adam.step):
        del named["pose_translation"]
    save_state(tmp_path / "a.npz", state, config)
    with pytest.raises(InputError, match="pose_rotation, pose_translation: some are missing; use all 2 or none"):
        load_checkpoint(tmp_path / "a.npz")


def test_a_camera_that_does_not_move_is_refused():
    still = simulate(SimulatorSettings(width=48, height=32, frames=8)).sequence
    with pytest.raises(InputError, match="pose_correction = true: the camera of this sequence does not move"):
        new_training(still, settings("pose", True))


def test_a_slim_model_holds_the_corrected_cameras_and_no_correction(disturbed, runs, tmp_path):
    config = settings("pose", True)
    record = record_of(disturbed)
    save_slim_model(tmp_path / "a.npz", model_of(runs["pose", True], disturbed, config), record)
    slim = load_slim_model(tmp_path / "a.npz")
    wanted = corrected_cameras(runs["pose", True].frames, disturbed.cameras, disturbed.times)
    assert slim.model.frames is None
    for found, camera, given in zip(slim.record.frame_cameras, wanted, disturbed.cameras, strict=True):
        np.testing.assert_array_equal(found.rotation, camera.rotation)
        np.testing.assert_array_equal(found.translation, camera.translation)
        assert not np.array_equal(found.translation, given.translation)


def test_without_a_gaussian_a_step_changes_the_parameters_of_frames_alone(dimmed):
    """All are pruned: the render is black, and the biases still move towards the frames."""
    config = msgspec.structs.replace(settings("exposure", True), density=DensityConfig(start=0, interval=1, until=3,
                                                                                       prune_opacity=1.0))  # fmt: skip
    state, constants = new_training(dimmed, config), training_constants(dimmed, config)
    training_step(state, constants)
    assert state.gaussians.count == 0 and state.frames is not None
    before = state.frames.exposure_bias.copy()
    training_step(state, constants)
    assert state.gaussians.count == 0 and (state.frames.exposure_bias != before).any()
