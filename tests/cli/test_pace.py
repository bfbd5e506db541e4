"""Settings for a wish in minutes."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from endotsr.cli.parts.options import base_settings
from endotsr.cli.train import config_of_minutes
from endotsr.clips.sequences.forecast.seconds import vector_factor
from endotsr.clips.sequences.forecast.work import at_start, work_left
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PRESETS, QUICK, lengthened, with_settings
from endotsr.errors import InputError
from endotsr.training.fitting.state import new_training
from endotsr.training.runs import pace
from endotsr.training.runs.pace import SHARP_LENGTH, paced, paced_for, seconds_of_unit

SHARP = PRESETS["sharp"]


@pytest.fixture(scope="module")
def still():
    return simulate(SimulatorSettings(frames=11, width=64, height=48)).sequence


def test_the_ends_are_the_presets():
    quick, best = paced(SHARP, 0.0), paced(SHARP, 1.0)
    for name in ("initialisation", "loss", "optimiser", "density"):
        assert getattr(quick, name) == getattr(PRESETS["quick"], name), name
    assert quick.training.iterations == 1600 and quick.training.coarse_start and quick.density.maximum == 22_000
    assert lengthened(SHARP, 55).training.iterations == SHARP_LENGTH == best.training.iterations
    assert best.initialisation == SHARP.initialisation and not best.training.coarse_start
    assert (best.density.growth, SHARP.density.growth) == ("budget", "threshold")
    longer = paced(SHARP, 2.0).training.iterations / best.training.iterations
    assert longer == pytest.approx(SHARP_LENGTH / QUICK.training.iterations, rel=1e-3)


@pytest.mark.parametrize("minutes", [1.0, 3.0, 10.0, 40.0])
def test_the_planned_time_is_the_wish(still, minutes):
    config = paced_for(minutes, still, SHARP, unit=0.12, threads=1)
    pixels = still.width * still.height
    planned = 0.12 * work_left(config, pixels, at_start(config, pixels), vector_factor())
    gaps, times, size = 8, 12, 64 * 48 / (640 * 512)  # of training frames; two gaps have a frame between
    assert np.diff(still.train_index).tolist() == [2, 1, 1, 1, 1, 1, 1, 2]
    sizes = 1.25 if config.training.coarse_start else 1.0
    planned += 0.12 / vector_factor() * size * (0.5 * gaps + 0.8 * times) * sizes
    assert 0.97 * 60 * minutes < planned <= 60 * minutes


def test_more_minutes_are_never_less_of_anything(still):
    found = [paced_for(m, still, SHARP, unit=0.12, threads=1) for m in np.geomspace(0.5, 60, 9)]
    for name in ("training.iterations", "density.maximum", "initialisation.first_frame_points"):
        section, key = name.split(".")
        values = [getattr(getattr(config, section), key) for config in found]
        assert values == sorted(values), name


def test_too_few_minutes_are_refused_with_the_least(still):
    with pytest.raises(InputError, match=r"0\.001 minutes are not allowed: the shortest training of this clip takes"):
        paced_for(0.001, still, SHARP, unit=0.12, threads=1)


def test_the_machine_is_timed_without_a_trace(still):
    assert 0 < seconds_of_unit(still, SHARP) < 60


def test_a_late_iteration_of_the_whole_model_takes_longer_than_the_timed_ones(still, monkeypatch):
    """A clock on which each call takes a second: an iteration of one second is 0.76 of a late one."""
    monkeypatch.setattr(pace, "time", SimpleNamespace(perf_counter=itertools.count(0.0).__next__))
    monkeypatch.setattr(pace, "training_step", lambda state, constants: None)
    monkeypatch.setattr("endotsr.method.kernels.vectors.REGISTER", 64)  # bytes, of a processor with AVX-512
    points = new_training(
        still, with_settings(SHARP, initialisation=with_settings(QUICK.initialisation, motion="none"))
    )
    work = 0.08 + 0.35 * 64 * 48 / (640 * 512) + 0.57 * points.gaussians.count / 60_000
    assert seconds_of_unit(still, SHARP) == pytest.approx(1 / work / 0.76)


@pytest.mark.parametrize("words", [["--minutes", "5"], ["--minutes=5"]])
def test_a_wish_in_minutes_begins_from_sharp_however_it_is_written(words):
    assert base_settings(words)[0].preset == "sharp"
    assert base_settings([*words, "--preset", "quick"])[0].preset == "quick"
    assert base_settings([])[0].preset == "paper"


@pytest.mark.parametrize("side", [96, 48])
def test_the_line_on_minutes_is_of_this_clip_and_of_the_points_that_it_starts_with(side, monkeypatch):
    """The shortest trainings start with more points than density control may reach, and lose none of them.

    A frame with fewer pixels than points gives one point per pixel.
    """
    clip = simulate(SimulatorSettings(frames=11, width=64, height=side)).sequence
    monkeypatch.setattr("endotsr.method.kernels.vectors.REGISTER", 64)  # bytes, of a processor with AVX-512
    config, line = config_of_minutes(0.13, clip, SHARP, 0.1, 1)
    asked, most = config.initialisation, config.density.maximum
    points = min(asked.first_frame_points, 64 * side) + asked.other_frame_points
    assert (most < points) == (side == 96) and line.endswith(f" iterations, {max(most, points)} Gaussians")
    assert "an iteration of 60 000 Gaussians takes 65 ms" in line or side == 96, "and 100 ms at 640x512"
