"""A training in miniature: reproducible, resumable, and components that are off do not exist.

48x32 pixels, 8 frames, about 300 Gaussians, 60 iterations in which everything happens: densification at 20, 30, 40;
residuals born after 25; smoothness from 10; detail loss from 16, full at 30; harmonics to degree 3.
"""

import copy

import msgspec
import numba
import numpy as np
import pytest

from endotsr.clips.simulator.settings import SimulatorSettings
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
from endotsr.method.equations.deformation import deformation_forward
from endotsr.training.fitting import model as model_module
from endotsr.training.fitting import objective, packed, trainer, view
from endotsr.training.fitting.checkpoint import load_checkpoint
from endotsr.training.fitting.checkpoint_values import check_lengths
from endotsr.training.fitting.divergence import Diverged
from endotsr.training.fitting.fused.step import optimise
from endotsr.training.fitting.model import render_at
from endotsr.training.fitting.records import TERMS, LogEntry
from endotsr.training.fitting.schedules import densify_now
from endotsr.training.fitting.state import new_training, save_state, state_from_checkpoint, training_constants
from endotsr.training.fitting.trainer import calibrated_weight, train, training_step
from endotsr.training.scene.gaussians import arrays

ACTIVATED, LENGTH = 25, 60
RESIDUALS = ("appearance_coefficients", "motion_coefficients")
FDM = ("fdm_weight", "fdm_centre", "fdm_width")


def settings(iterations=LENGTH, optimiser=None, loss=None, training=None, motion="none", **model):
    loss = {"smoothness_from": 10, "laplacian_from": 15, "laplacian_full": 30} | (loss or {})
    return Config(
        model=ModelConfig(**({"bases": 5, "frequencies": 3, "initial_width": 0.1} | model)),
        loss=LossConfig(**loss),
        optimiser=OptimiserConfig(**(optimiser or {})),
        density=DensityConfig(start=10, interval=10, until=45),
        initialisation=InitialisationConfig(first_frame_points=250, other_frame_points=60, motion=motion),
        training=TrainingConfig(
            iterations=iterations,
            residual_activation=ACTIVATED,
            harmonics_interval=15,
            checkpoint_every=10,
            **(training or {}),
        ),
    )


@pytest.fixture(scope="module")
def sequence():
    return simulate(SimulatorSettings(width=48, height=32, frames=8)).sequence


def run(sequence, config, state=None, on_iteration=None, checkpoints=None):
    """The final state and the log; `checkpoints` collects copies of the state."""
    log = []

    def keep(entry):
        log.append(entry)
        if on_iteration:
            on_iteration(entry)

    state = new_training(sequence, config) if state is None else state
    keep_state = (lambda s: checkpoints.append(copy.deepcopy(s))) if checkpoints is not None else (lambda s: None)
    return train(state, sequence, config, keep, keep_state, on_message=lambda text: None), log


@pytest.fixture(scope="module")
def finished(sequence):
    """State, log and the states at every tenth iteration of the uninterrupted run."""
    states = []
    state, log = run(sequence, settings(), checkpoints=states)
    return state, log, {s.iteration: s for s in states}


def everything(state):
    """All numbers of a state by name."""
    groups = {
        "gaussians": arrays(state.gaussians),
        "first": state.adam.first,
        "second": state.adam.second,
        "statistics": state.statistics._asdict(),
    }
    return {f"{group} {name}": array for group, named in groups.items() for name, array in named.items()}


def assert_same(one, two):
    a, b = everything(one), everything(two)
    assert a.keys() == b.keys()
    for name in a:
        assert a[name].dtype == b[name].dtype
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)
    assert one.adam.step == two.adam.step and one.iteration == two.iteration and one.lambda_lap == two.lambda_lap
    assert one.rng_state == two.rng_state


# --- it learns, and everything takes part ---


def test_more_first_points_than_the_maximum_are_said(sequence):
    said, config = [], settings(iterations=1)
    few = msgspec.structs.replace(config, density=msgspec.structs.replace(config.density, maximum=9))
    state = new_training(sequence, few)
    count = state.gaussians.count
    train(state, sequence, few, lambda entry: None, lambda _: None, on_message=said.append)
    (line,) = said
    assert f"density.maximum = 9 is below the {count} first points: they are kept" in line


def test_loss_falls_and_every_part_takes_part(finished):
    state, log, _ = finished
    early, late = log[:8], log[-8:]
    assert np.mean([e["l1"] for e in late]) < 0.6 * np.mean([e["l1"] for e in early])
    assert np.mean([e["depth"] for e in late]) < 0.8 * np.mean([e["depth"] for e in early])
    assert [e["iteration"] for e in log] == list(range(1, LENGTH + 1))
    assert all(np.isfinite(e["loss"]) for e in log)
    timed = "seconds"  # added by the command
    assert {timed, *TERMS, *(key for entry in log for key in entry)} == set(LogEntry.__annotations__)
    assert ["smoothness" in e for e in log] == [i >= 10 for i in range(1, LENGTH + 1)]
    assert ["laplacian" in e for e in log] == [i > 15 for i in range(1, LENGTH + 1)]
    assert ["matern_penalty" in e for e in log] == [i > ACTIVATED for i in range(1, LENGTH + 1)]
    counts = [e["gaussians"] for e in log]
    changes = [log[i]["iteration"] for i in range(LENGTH - 1) if counts[i + 1] != counts[i]]
    assert changes and set(changes) <= {20, 30, 40}
    check_lengths(state.gaussians, state.adam)
    for name in (*RESIDUALS, *FDM):
        assert np.abs(getattr(state.gaussians, name)).max() > 0
    assert state.gaussians.harmonics[9:].any()
    assert log[-1]["psnr"] > log[0]["psnr"] + 3


# --- the same, always ---


def test_two_runs_are_bitwise_equal(finished, sequence):
    state, log = run(sequence, settings())
    assert_same(state, finished[0])
    assert log == finished[1]


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only (NUMBA_NUM_THREADS)")  # type: ignore
def test_one_and_two_threads_are_bitwise_equal(sequence):
    before, results = numba.get_num_threads(), []
    try:
        for threads in (1, 2):
            numba.set_num_threads(threads)
            results.append(run(sequence, settings()))
    finally:
        numba.set_num_threads(before)
    assert_same(results[0][0], results[1][0])
    assert results[0][1] == results[1][1]


@pytest.mark.parametrize("stop", [10, 20, 30, 50])
def test_hard_G5_checkpoint_and_continue_equals_uninterrupted(stop, finished, sequence, tmp_path):
    state, log, states = finished
    save_state(tmp_path / "run.npz", states[stop], settings())
    loaded = state_from_checkpoint(load_checkpoint(tmp_path / "run.npz"), settings())
    assert_same(loaded, states[stop])
    resumed, rest = run(sequence, settings(), loaded)
    assert_same(resumed, state)
    assert rest == log[stop:]


# --- the residuals begin ---


def stepped(state, sequence, config, monkeypatch):
    """One iteration on a copy of the state: the state after it, its log entry and the image it rendered."""
    seen = []
    real = view.image_loss
    with monkeypatch.context() as patch:
        watched = lambda rendered, *rest, **named: seen.append(rendered) or real(rendered, *rest, **named)
        patch.setattr(view, "image_loss", watched)
        state = copy.deepcopy(state)
        entry = training_step(state, training_constants(sequence, config))
    return state, entry, seen[0]


def test_residuals_are_activated_without_changing_the_image(sequence, monkeypatch):
    """At K_s + 1, with and without A and S: image, loss and the step of every other array are bitwise equal."""
    with_all, without = settings(), settings(appearance=False, spectral_motion=False)
    state, _ = run(sequence, settings(iterations=ACTIVATED))
    assert all(getattr(state.gaussians, name) is None for name in RESIDUALS)
    # learning rates look at the length of the run: from here on both take that of the whole
    after, entry, image = stepped(state, sequence, with_all, monkeypatch)
    plain, plain_entry, plain_image = stepped(state, sequence, without, monkeypatch)
    for one, two in zip(image, plain_image):
        np.testing.assert_array_equal(one, two)
    assert entry["matern_penalty"] == 0 and {k: v for k, v in entry.items() if k != "matern_penalty"} == plain_entry
    for name, array in arrays(plain.gaussians).items():
        np.testing.assert_array_equal(array, getattr(after.gaussians, name), err_msg=name)
    assert all(getattr(after.gaussians, name).any() for name in RESIDUALS)  # and they learn at once
    assert all(after.adam.step[name] == 1 for name in RESIDUALS)
    assert after.adam.step["position"] == ACTIVATED + 1


# --- components that are off ---

OFF = {
    "appearance": (
        {"appearance": False},
        [(model_module, "appearance_forward"), (model_module, "normalised_atoms")],
        ("appearance_coefficients",),
    ),
    "spectral_motion": (
        {"spectral_motion": False},
        [(model_module, "motion_forward"), (model_module, "dictionary_forward"), (trainer, "matern_penalty_forward")],
        ("motion_coefficients",),
    ),
    "deformation": ({"deformation": False}, [(model_module, "deformation_forward")], FDM),
    "laplacian": (
        {"laplacian": False},
        [(objective, "laplacian_loss_forward"), (packed, "support_masks")],
        (),
    ),
    "ssim": ({"loss": {"ssim_weight": 0.0}}, [(objective, "masked_ssim_forward")], ()),
    "depth": (
        {"loss": {"depth_weight": 0.0}},
        [(objective, "normalised_depth_forward"), (objective, "depth_target")],
        (),
    ),
    "smoothness": (
        {"loss": {"smoothness_weight": 0.0}},
        [(objective, "smoothness_forward"), (objective, "canny_edges")],
        (),
    ),
}


def forbidden(*arguments, **named):
    raise AssertionError("a component that is off was called")


@pytest.mark.parametrize("component", list(OFF))
def test_a_component_that_is_off_allocates_and_calls_nothing(component, sequence, monkeypatch):
    changes, functions, fields = OFF[component]
    for module, name in functions:
        monkeypatch.setattr(module, name, forbidden)
    state, log = run(sequence, settings(iterations=ACTIVATED + 7, **changes))
    for name in fields:
        assert getattr(state.gaussians, name) is None
        assert name not in state.adam.first and name not in state.adam.second and name not in state.adam.step
    word = {"spectral_motion": "matern_penalty"}.get(component, component)
    assert all(word not in entry for entry in log)


@pytest.mark.parametrize("component", list(OFF))
def test_a_component_that_is_on_is_called(component, sequence, monkeypatch):
    """The same functions, forbidden in a run that needs them: so the test above can fail."""
    for module, name in OFF[component][1]:
        with monkeypatch.context() as patch:
            patch.setattr(module, name, forbidden)
            with pytest.raises(AssertionError, match="is off was called"):
                run(sequence, settings(iterations=ACTIVATED + 7))


# --- the automatic detail weight ---


def test_automatic_weight_is_deterministic_and_equals_the_same_number_given(sequence, tmp_path, monkeypatch):
    automatic = settings(iterations=ACTIVATED + 15, loss={"lambda_lap": "auto"})
    weight = calibrated_weight(sequence, automatic)
    assert weight == calibrated_weight(sequence, automatic) and 0 < weight < 100
    states = []
    state, log = run(sequence, automatic, checkpoints=states)
    assert state.lambda_lap == weight
    given, given_log = run(sequence, settings(iterations=ACTIVATED + 15, loss={"lambda_lap": weight}))
    assert_same(state, given)
    assert log == given_log
    # a resumed run has the weight from its checkpoint and does not calibrate again
    save_state(tmp_path / "run.npz", states[0], automatic)
    loaded = state_from_checkpoint(load_checkpoint(tmp_path / "run.npz"), automatic)
    monkeypatch.setattr(trainer, "calibrated_weight", forbidden)
    resumed, _ = run(sequence, automatic, loaded)
    assert_same(resumed, state)


# --- tracked motion ---


def test_tracked_motion_is_trained_from_the_start_and_keeps_its_moments_at_the_activation(sequence, tmp_path):
    config = settings(iterations=ACTIVATED + 5, motion="flow")
    start = new_training(sequence, config)
    assert np.abs(start.gaussians.motion_coefficients).max() > 0 and start.gaussians.appearance_coefficients is None
    states = []
    state, log = run(sequence, config, checkpoints=states)
    assert state.adam.step["motion_coefficients"] == ACTIVATED + 5 and state.adam.step["appearance_coefficients"] == 5
    assert log[0]["matern_penalty"] > 0
    save_state(tmp_path / "run.npz", states[0], config)
    resumed, _ = run(sequence, config, state_from_checkpoint(load_checkpoint(tmp_path / "run.npz"), config))
    assert states[0].iteration < ACTIVATED
    assert_same(resumed, state)


def test_without_component_s_nothing_is_tracked(sequence, monkeypatch):
    monkeypatch.setattr("endotsr.training.scene.initialisation.follow", forbidden)
    config = settings(iterations=3, motion="flow", spectral_motion=False)
    assert new_training(sequence, config).gaussians.motion_coefficients is None


# --- offsets taken ahead ---


@pytest.mark.parametrize("training", [{}, {"bridge_fraction": 0.5}])
def test_every_step_but_those_after_density_control_finds_its_offsets_taken(training, sequence, monkeypatch):
    """And a run without them has the same numbers."""
    config, calls, counts = settings(iterations=25, training=training), [], [0]

    def counted(*given):
        calls.append(given)
        return deformation_forward(*given)

    monkeypatch.setattr(model_module, "deformation_forward", counted)
    state, _ = run(sequence, config, on_iteration=lambda entry: counts.append(len(calls)))
    controlled = [k for k in range(1, 25) if densify_now(k, config)]
    assert [k for k in range(1, 26) if counts[k] > counts[k - 1]] == [1, *(k + 1 for k in controlled)]
    assert 0 < len(controlled) < 6
    monkeypatch.setattr(trainer, "optimise", lambda *given: optimise(*given[:-1]))
    assert_same(run(sequence, config)[0], state)


# --- the rule of Deform3DGS ---


def test_legacy_skip_leaves_out_the_step_on_densify_iterations(finished, sequence, monkeypatch):
    state = finished[2][10]
    for skip in (False, True):
        config = settings(optimiser={"legacy_skip": skip})
        constants, now = training_constants(sequence, config), copy.deepcopy(state)
        while now.iteration < 19:
            training_step(now, constants)
        before, steps = now.gaussians.harmonics[0].copy(), now.adam.step["position"]
        with monkeypatch.context() as patch:
            if skip:
                patch.setattr(trainer, "optimise", forbidden)
            training_step(now, constants)
        assert now.adam.step["position"] == steps + (0 if skip else 1)
        kept = {tuple(c) for c in now.gaussians.harmonics[0].T} & {tuple(c) for c in before.T}
        assert bool(kept) == skip  # survivors, clones and children have the colours of before
        training_step(now, constants)
        assert now.adam.step["position"] == steps + (1 if skip else 2)


# --- numbers that are not finite ---


def test_a_loss_that_is_not_finite_stops_the_run_and_names_iteration_and_frame(sequence):
    config = settings(iterations=12)
    state = new_training(sequence, config)

    def poison(entry):
        if entry["iteration"] == 5:
            state.gaussians.harmonics[0] = np.nan

    _, frames = run(sequence, config)
    with pytest.raises(Diverged, match=rf"^iteration 6, frame {frames[5]['frame']}: l1 is nan$"):
        run(sequence, config, state, poison)
    assert state.iteration == 5


@pytest.mark.parametrize("name", ["position", "harmonics", "fdm_width", "appearance_coefficients"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_hard_P6_a_state_that_is_not_finite_is_refused_at_the_start(name, value, finished, sequence):
    state = copy.deepcopy(finished[2][30])
    array = getattr(state.gaussians, name)
    array[(*(0,) * (array.ndim - 1), 3)] = value
    place = ", ".join(["0"] * (array.ndim - 1) + ["3"])
    with pytest.raises(ValueError, match=rf"{name}\[{place}\] is {value}"):
        run(sequence, settings(), state)
    if value == np.inf and name in ("fdm_width", "appearance_coefficients"):
        return  # an infinite width or coefficient still gives a finite scene
    constants = training_constants(sequence, settings())
    with pytest.raises(ValueError, match=r"position|harmonics|residual|log_scale|quaternion"):
        render_at(state.gaussians, constants.spectral, settings(), sequence.cameras[0], 0.25)


@pytest.mark.parametrize("name", ["position", "quaternion", "log_scale", "opacity_logit"])
def test_a_nan_parameter_in_the_middle_of_a_run_never_crashes_the_kernels(name, finished, sequence):
    """Such a Gaussian is not drawn (or its NaN reaches the loss): no index is made of it."""
    state = copy.deepcopy(finished[2][30])
    getattr(state.gaussians, name)[..., ::7] = np.nan
    getattr(state.gaussians, name)[..., 1::7] = np.inf
    try:
        training_step(state, training_constants(sequence, settings()))
    except FloatingPointError as error:
        assert "iteration 31" in str(error)


def test_a_checkpoint_never_replaces_a_good_one_by_numbers_that_are_not_finite(finished, tmp_path):
    state = copy.deepcopy(finished[2][30])
    path = tmp_path / "checkpoint.npz"
    save_state(path, state, settings())
    good = path.read_bytes()
    state.gaussians.fdm_centre[4, 1, 2] = np.nan
    with pytest.raises(FloatingPointError, match=r"fdm_centre\[4, 1, 2\] is nan: .* the last checkpoint is kept"):
        save_state(path, state, settings())
    assert path.read_bytes() == good and list(tmp_path.iterdir()) == [path]
