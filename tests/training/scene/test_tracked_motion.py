"""Tests of `scene.tracked_motion`: coefficients of the translation residual fitted to tracks."""

import numpy as np
import pytest

from endotsr.config import Config
from endotsr.method.equations.dictionary import dictionary_forward, frequencies
from endotsr.method.equations.matern import matern_weights
from endotsr.training.fitting.model import scene_at, spectral_from
from endotsr.training.scene import tracked_motion
from endotsr.training.scene.initialisation import gaussians_at
from endotsr.training.scene.tracked_motion import with_tracked_motion

N, TIMES = 40, np.arange(63)[np.arange(63) % 8 != 1] / 63
OMEGA = frequencies(8, 1.0, 16.0)
RHO = matern_weights(OMEGA, 0.2)


@pytest.fixture
def gaussians(rng):
    return gaussians_at(rng.uniform(-20, 20, (3, N)), rng.uniform(0.2, 0.8, (3, N)), Config().model, np.float64)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def fitted(gaussians, position, followed=None):
    everywhere = np.ones((len(TIMES), N), bool) if followed is None else followed
    return with_tracked_motion(gaussians, TIMES, position, everywhere, OMEGA, RHO)


def positions(gaussians, times=TIMES):
    spectral = spectral_from(Config().model, TIMES)
    return np.stack([scene_at(gaussians, spectral, Config().model, float(t))[0].position for t in times])


def test_a_slow_motion_is_followed_between_the_training_times_too(gaussians, rng):
    direction = rng.standard_normal((3, N))
    move = lambda t: np.sin(2 * np.pi * 1.5 * np.asarray(t))[:, None, None] * direction
    found = fitted(gaussians, gaussians.position + move(TIMES))
    every = np.arange(63) / 63
    error = positions(found, every) - gaussians.position - move(every)
    assert np.sqrt(np.square(error).mean()) < 0.05 * np.sqrt(np.square(move(every)).mean())


def test_a_point_that_does_not_move_keeps_its_place_and_zero_coefficients(gaussians):
    found = fitted(gaussians, np.broadcast_to(gaussians.position, (len(TIMES), 3, N)))
    np.testing.assert_allclose(found.position, gaussians.position, atol=1e-12)
    assert np.abs(found.motion_coefficients).max() < 1e-12


def test_the_solution_is_the_minimum_of_the_penalised_squares(gaussians, rng):
    position, followed = rng.standard_normal((len(TIMES), 3, N)), rng.random((len(TIMES), N)) < 0.7
    found = fitted(gaussians, position, followed)
    atoms = np.stack([dictionary_forward(float(t), OMEGA)[0] for t in TIMES])
    trust = np.where(followed, 1, tracked_motion.UNFOLLOWED)[:, None]
    weights = np.tile(tracked_motion.RIDGE * RHO + tracked_motion.LEAST_RIDGE, 2)

    def cost(centre, coefficients):
        residual = centre + np.einsum("dkn,tk->tdn", coefficients, atoms) - position
        return (trust * residual**2).sum() + (weights[:, None] * coefficients**2).sum()

    best = cost(found.position, found.motion_coefficients)
    for _ in range(20):
        shift = 1e-3 * rng.standard_normal(found.position.shape)
        change = 1e-3 * rng.standard_normal(found.motion_coefficients.shape)
        assert cost(found.position + shift, found.motion_coefficients + change) > best
        assert cost(found.position - shift, found.motion_coefficients - change) > best


def test_noise_that_changes_from_frame_to_frame_is_smoothed(gaussians, rng):
    noise = 0.1 * rng.standard_normal((len(TIMES), 3, N))
    found = positions(fitted(gaussians, gaussians.position + noise))
    assert np.diff(found, axis=0).std() < 0.2 * np.diff(noise, axis=0).std()


def test_points_are_independent_of_how_many_are_solved_at_once(gaussians, rng, monkeypatch):
    position = gaussians.position + rng.standard_normal((len(TIMES), 3, N))
    together = fitted(gaussians, position)
    monkeypatch.setattr(tracked_motion, "POINTS_AT_ONCE", 7)
    np.testing.assert_allclose(
        fitted(gaussians, position).motion_coefficients, together.motion_coefficients, atol=1e-12
    )


def test_float32_gaussians_get_float32_coefficients(gaussians):
    single = gaussians_at(gaussians.position, np.full((3, N), 0.5), Config().model, np.float32)
    found = fitted(single, np.broadcast_to(gaussians.position, (len(TIMES), 3, N)))
    assert found.motion_coefficients.dtype == found.position.dtype == np.float32
    assert found.motion_coefficients.shape == (3, 16, N) and found.motion_coefficients.flags.c_contiguous
