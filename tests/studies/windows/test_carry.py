"""A warm start: the picture at the join is the neighbour's, tissue is followed, added and dropped."""

import weakref
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from small_recording import settings, trained, write_recording

from endotsr.errors import InputError
from endotsr.studies.windows.carry import COVERED, CarriedStart, Neighbour, carried_state
from endotsr.studies.windows.make import warm_settings, window_cost
from endotsr.studies.windows.plan import Wanted
from endotsr.training.fitting.model import render_at, spectral_from
from endotsr.training.fitting.schedules import active_degree, residuals_active
from endotsr.training.fitting.state import fresh_state
from endotsr.training.runs.folder import open_run
from endotsr.training.runs.model import load_model
from endotsr.training.runs.sources import load_run_sequence

SHIFT, SHARED, SAVED = 24, 8, 12


@pytest.fixture(scope="module")
def both(cold_run):
    """The neighbour, and the sequence and settings of the window behind it."""
    first, second = (open_run(cold_run / "windows" / name) for name in ("000", "001"))
    neighbour = Neighbour(load_model(first), first.sequence_record().times, SHIFT, SHARED, 0.5)
    return neighbour, load_run_sequence(second), warm_settings(second.config())


def picture(gaussians, model, config, sequence, i, time, frames=None):
    return render_at(gaussians, model, config, sequence.cameras[i], time, frames=frames)


@pytest.mark.parametrize("motion", ["flow", "none"])
def test_the_picture_at_the_join_is_the_neighbours(both, motion):
    neighbour, sequence, config = both
    config = msgspec.structs.replace(
        config, initialisation=msgspec.structs.replace(config.initialisation, motion=motion)
    )
    assert neighbour.model.gaussians.appearance_coefficients.any(), "the colour residual is part of what is carried"
    state = carried_state(neighbour, sequence, config)
    i = int(sequence.train_index[neighbour.join(sequence)])
    model = neighbour.model
    there = picture(
        model.gaussians, model.spectral, model.config, sequence, i, neighbour.times[i + SHIFT], model.frames
    )
    spectral = spectral_from(config.model, sequence.times[sequence.train_index])
    carried = state.gaussians._replace(
        **{k: a[..., : model.gaussians.count] for k, a in state.gaussians._asdict().items() if a is not None}
    )
    here = picture(carried, spectral, config, sequence, i, float(sequence.times[i]), state.frames)
    assert np.abs(here.colour - there.colour).max() < 2e-5
    assert np.abs(here.depth - there.depth).max() < 2e-3


def test_a_warm_state_is_nearer_to_the_frames_than_a_cold_one(both):
    """At the first frame that is shared with nobody: the carried Gaussians have followed the tissue there."""
    from endotsr.training.fitting.state import new_training

    neighbour, sequence, config = both
    spectral = spectral_from(config.model, sequence.times[sequence.train_index])
    errors = []
    for state in (carried_state(neighbour, sequence, config), new_training(sequence, config)):
        out = picture(state.gaussians, spectral, config, sequence, 20, float(sequence.times[20]))
        errors.append(np.square(out.colour - sequence.images[20] / 255)[:, sequence.masks[20]].mean())
    assert errors[0] < 0.5 * errors[1]


def test_the_state_begins_with_residuals_and_without_moments(both):
    neighbour, sequence, config = both
    state = carried_state(neighbour, sequence, config)
    assert residuals_active(1, config) and active_degree(3, config) == 3 and state.iteration == 0
    assert not state.gaussians.appearance_coefficients.any() and not state.gaussians.fdm_weight.any()
    assert state.gaussians.motion_coefficients.any()
    assert not any(moment.any() for moment in (*state.adam.first.values(), *state.adam.second.values()))


def test_tissue_that_is_not_covered_gets_points(both):
    neighbour, sequence, config = both
    count = carried_state(neighbour, sequence, config).gaussians.count
    model = neighbour.model
    i = neighbour.times[int(sequence.train_index[neighbour.join(sequence)]) + SHIFT]
    left = model.gaussians.position[0] > 0
    opaque = model.gaussians._replace(
        opacity_logit=model.gaussians.opacity_logit + 5, log_scale=model.gaussians.log_scale + 0.5
    )
    half = opaque._replace(
        **{k: np.ascontiguousarray(a[..., left]) for k, a in opaque._asdict().items() if a is not None}
    )
    state = carried_state(neighbour._replace(model=model._replace(gaussians=half)), sequence, config)
    fresh = state.gaussians.count - half.count
    assert 20 < fresh and half.count < count and i > 0
    assert np.mean(state.gaussians.position[0, half.count :] < 1.0) > 0.9
    spectral = spectral_from(config.model, sequence.times[sequence.train_index])
    out = picture(state.gaussians, spectral, config, sequence, 0, float(sequence.times[0]))
    assert np.mean(out.opacity[sequence.masks[0]] > COVERED / 2) > 0.9


def test_tissue_out_of_sight_is_dropped(both, monkeypatch):
    monkeypatch.setattr("endotsr.studies.windows.carry.COVERED", 0.0)  # nothing is added
    neighbour, sequence, config = both
    count = neighbour.model.gaussians.count
    aside = [camera._replace(cx=camera.cx - 30.0) for camera in sequence.cameras]
    moved = replace(sequence, cameras=aside)
    state = carried_state(neighbour, moved, config)
    u = state.gaussians.position[0] / state.gaussians.position[2] * aside[0].fx + aside[0].cx
    assert u.min() > -0.2 * aside[0].width and state.gaussians.count < 0.7 * count


def test_the_faintest_are_dropped_and_growth_keeps_its_room(both):
    neighbour, sequence, config = both
    plain = msgspec.structs.replace(config, density=msgspec.structs.replace(config.density, maximum=100))
    count, logit = carried_state(neighbour, sequence, plain).gaussians.count, neighbour.model.gaussians.opacity_logit
    carried = carried_state(neighbour, sequence, plain).gaussians.opacity_logit[:80]
    assert 80 <= count <= 100, "80 are carried, and new tissue takes what is free"
    np.testing.assert_array_equal(np.sort(carried), np.sort(logit)[-80:])


def test_gaussians_do_not_accumulate_along_a_chain(tmp_path):
    """Without the bound each window of this chain ends with more Gaussians than the one before."""
    source = write_recording(tmp_path / "source", frames=104)
    config = settings(40, density={"gradient_threshold": 1e-5, "start": 2, "until": 12, "maximum": 40_000})
    trained(source, tmp_path / "run", Wanted(32, 8, 4), config)
    folders = [tmp_path / "run" / "windows" / f"{k:03d}" for k in range(4)]
    counts = [load_model(open_run(folder)).gaussians.count for folder in folders]
    assert max(counts[1:]) <= counts[0] < 40_000
    assert [open_run(folder).config().density.maximum for folder in folders[1:]] == counts[:3]


def test_a_chain_trains_a_part_of_the_schedule_and_says_so(recording, tmp_path):
    trained(recording, tmp_path / "run", Wanted(32, 8, 2), settings(20))
    warm = tmp_path / "run" / "windows" / "001"
    assert window_cost(warm) | {"seconds": 0, "peak_memory_bytes": 0} == {
        "start": "warm", "iterations": 8, "saved": 12, "seconds": 0, "peak_memory_bytes": 0,
    }  # fmt: skip
    assert open_run(warm).record()["start"] == {"carried_from": "000", "shared_frames": 8, "iterations_saved": 12}
    assert load_model(open_run(warm)).iteration == 8


def test_a_neighbour_of_another_world_is_refused(both, cold_run, tmp_path):
    _, sequence, config = both
    elsewhere = [camera._replace(translation=camera.translation + 1.0) for camera in sequence.cameras]
    start = CarriedStart(str(cold_run / "windows" / "000"), SHIFT, SHARED, SAVED)
    assert start.state(sequence, config).iteration == 0
    with pytest.raises(InputError, match="its world origin differs"):
        start.state(replace(sequence, cameras=elsewhere), config)


def test_the_neighbour_is_gone_before_the_moments_are_made(both, cold_run, monkeypatch):
    """Both at a time were the peak of a warm window."""
    _, sequence, config = both
    start, alive, made = CarriedStart(str(cold_run / "windows" / "000"), SHIFT, SHARED, SAVED), [], []

    def loaded(folder):
        model = load_model(folder)
        alive.append(weakref.ref(model.gaussians.motion_coefficients))
        return model

    def fresh(*words, **more):
        made.append(alive[0]() is None)
        return fresh_state(*words, **more)

    monkeypatch.setattr("endotsr.training.runs.model.load_model", loaded)
    monkeypatch.setattr("endotsr.studies.windows.carry.fresh_state", fresh)
    start.state(sequence, config)
    assert made == [True]


def test_exposures_of_shared_frames_are_carried(tmp_path):
    source = write_recording(tmp_path / "source", "breathing,exposure")
    config = settings(20, model={"exposure": True})
    trained(source, tmp_path / "run", Wanted(32, 8, 2), config)
    first, second = (open_run(tmp_path / "run" / "windows" / name) for name in ("000", "001"))
    start = CarriedStart(str(first.path), SHIFT, SHARED, SAVED)
    state, known = start.state(load_run_sequence(second), second.config()), load_model(first).frames
    assert known.exposure_log_gain.any()
    at = np.interp(first.sequence_record().times[SHIFT], known.times, known.exposure_log_gain[0])
    assert state.frames.exposure_log_gain[0, 0] == pytest.approx(at, abs=1e-6)
    assert state.frames.exposure_log_gain[0, -1] == pytest.approx(known.exposure_log_gain[0, -1], abs=1e-6)
