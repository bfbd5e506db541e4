"""Tests of `evaluation.trajectories`: the displacement that a model renders, and its error against known motion."""

import numpy as np
import pytest

from endotsr.clips.simulator import SimulatorSettings, simulate, with_effects
from endotsr.config import Config, config_from_dict
from endotsr.results.evaluation import trajectories
from endotsr.results.evaluation.trajectories import displacement, evenly, trajectory_error
from endotsr.training.fitting.model import scene_at, spectral_from
from endotsr.training.runs.model import Model
from endotsr.training.scene.gaussians import POSITION_CHANNELS
from endotsr.training.scene.initialisation import initialise

SHIFT = np.array([0.5, -0.3, 0.2])  # mm


@pytest.fixture(scope="module")
def still():
    """A sheet that does not move, seen by a camera that does not."""
    return simulate(with_effects(SimulatorSettings(width=64, height=48, frames=4))).sequence


@pytest.fixture(scope="module")
def model(still):
    """Gaussians on every pixel of the first frame, which do not move."""
    config = config_from_dict({"initialisation": {"first_frame_points": 4000, "other_frame_points": 0}})
    gaussians = initialise(still, config.initialisation, config.model, np.random.default_rng(0))
    return Model(gaussians, spectral_from(config.model, still.times[still.train_index]), config, 0)


def shifted(model: Model, moved: bool = True) -> Model:
    """The same Gaussians with a bump of the FDM that shifts all of them by the same, different at every time."""
    weight = model.gaussians.fdm_weight.copy()
    weight[POSITION_CHANNELS, 0] = SHIFT[:, None] * moved
    return model._replace(gaussians=model.gaussians._replace(fdm_weight=weight))


def test_a_shift_of_all_gaussians_is_the_displacement_of_every_pixel(still, model):
    scene, _ = scene_at(model.gaussians, model.spectral, model.config.model, 0.0)
    moved = scene._replace(position=scene.position + SHIFT[:, None].astype(np.float32))
    found = displacement(scene, moved, still.cameras[0], model)
    assert np.abs(found - SHIFT[:, None, None]).max() < 1e-5
    assert not displacement(scene, scene, still.cameras[0], model).any()


def test_a_pixel_without_gaussians_has_no_displacement(still, model):
    scene, _ = scene_at(model.gaussians, model.spectral, model.config.model, 0.0)
    left = scene.position[0] < 0
    half = type(scene)(*(None if a is None else np.ascontiguousarray(a[..., left]) for a in scene))
    found = displacement(half, half._replace(position=half.position + np.float32(1)), still.cameras[0], model)
    assert not found[:, :, -8:].any() and found[:, :, :24].all()


def test_a_model_that_moves_as_the_tissue_has_no_error(still, model):
    moves = shifted(model)
    scenes = [scene_at(moves.gaussians, moves.spectral, Config().model, float(t))[0] for t in still.times]

    def true_positions(reference: int, frame: int) -> np.ndarray:
        start, end = scenes[reference].position[:, :1], scenes[frame].position[:, :1]
        return on_the_sheet(still, reference) + (end - start)[:, :, None]

    error = trajectory_error(moves, still, true_positions, [0, 1])
    assert error is not None
    assert error.scene_units < 1e-5 and error.pixels < 1e-4
    assert error.motion_scene_units > 0.05 and error.motion_pixels > 0.1


@pytest.mark.parametrize("hole", [slice(0), slice(10, 20)], ids=["whole", "a wound"])
def test_the_error_of_a_model_that_does_not_move_is_the_motion(hole, still, model):
    """A wound has no true position; the errors of the other pixels stay as they are."""

    def true_positions(reference: int, frame: int) -> np.ndarray:
        positions = on_the_sheet(still, reference) + (frame - reference) * SHIFT[:, None, None]
        positions[:, hole, hole] = np.nan
        return positions

    error = trajectory_error(model, still, true_positions, [0])
    assert error is not None
    assert error.scene_units == pytest.approx(np.linalg.norm(SHIFT) * np.mean([1, 2, 3]))
    assert error.motion_scene_units == error.scene_units and error.motion_pixels == error.pixels


def test_without_a_tissue_pixel_there_is_no_error(still, model):
    import dataclasses

    covered = dataclasses.replace(still, masks=np.zeros_like(still.masks))
    assert trajectory_error(model, covered, lambda reference, frame: np.zeros((3, 48, 64)), [0]) is None


def on_the_sheet(still, frame: int) -> np.ndarray:
    """World positions of the pixels of a frame of the sheet at rest."""
    camera, depth = still.cameras[frame], still.depth[frame]
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx * depth
    y = ((np.arange(camera.height) + 0.5 - camera.cy) / camera.fy)[:, None] * depth
    return np.stack([x, y, depth])


def test_a_long_clip_is_compared_at_a_bounded_number_of_frames(still, model, monkeypatch):
    """The first and the last frame are among them; the number of pairs does not grow with the square of the frames."""
    assert evenly(range(63), 64) == list(range(63))
    chosen = evenly(range(300), 64)
    assert len(set(chosen)) == 64 and chosen[0] == 0 and chosen[-1] == 299
    assert max(np.diff(chosen)) - min(np.diff(chosen)) == 1
    asked = set()

    def true_positions(reference: int, frame: int) -> np.ndarray:
        asked.add((reference, frame))
        return on_the_sheet(still, reference)

    monkeypatch.setattr(trajectories, "MOST_REFERENCES", 2)
    monkeypatch.setattr(trajectories, "MOST_TIMES", 2)
    monkeypatch.setattr(trajectories, "training_sample", lambda sequence: [0, 1, 2])
    assert trajectory_error(model, still, true_positions) is not None
    assert asked == {(0, 0), (0, 3), (2, 0), (2, 2), (2, 3)}
